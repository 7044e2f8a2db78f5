"""What is refused before a run because podusv could not read it back afterwards."""

from __future__ import annotations

from bisect import bisect_left
from pathlib import Path
from typing import Any

import pytest
import yaml
from conftest import example, kinds
from scenario_samples import SOUND, loaded

from podusv_cli.core.errors import StorageError
from podusv_cli.scenario import limits, yaml_text
from podusv_cli.scenario.load import load_resolved, resolved_yaml
from podusv_cli.scenario.model import Scenario
from podusv_cli.storage import json_files, manifest

NODES, CHARACTERS = 500, 5000  # instead of the real limits, which take seconds to reach


@pytest.fixture(autouse=True)
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    for room in (yaml_text, limits):
        monkeypatch.setattr(room, "MAX_NODES", NODES)
        monkeypatch.setattr(room, "MAX_CHARACTERS", CHARACTERS)


def changed(**parts: Any) -> Scenario:
    return loaded().scenario.model_copy(update=parts)


def along(count: int) -> Scenario:
    points = tuple((float(i), 0.0) for i in range(count))
    return changed(path=kinds("paths")["waypoints"](points=points))


def dsc(count: int) -> Any:
    """A law with so many centres."""
    network = {"centers": tuple((float(i), 0.0, 0.0) for i in range(count)), "widths": (1.0,) * 3}
    return example(kinds("controllers")["dsc"], network=network)


def refused(scenario: Scenario) -> list[tuple[str, str]]:
    return limits.limits(allow_large=True)(scenario)


def lost(scenario: Scenario) -> bool:
    """Whether podusv cannot read the scenario of a run back."""
    try:
        load_resolved(resolved_yaml(scenario), "resolved.yaml")
    except StorageError:
        return True
    return False


@pytest.mark.parametrize("large", [along, lambda count: changed(controller=dsc(count))])
def test_lists_are_refused_from_the_first_item_on_that_could_not_be_read_back(large: Any) -> None:
    most = 3 + bisect_left(range(3, 300), True, key=lambda count: bool(refused(large(count)))) - 1
    assert 50 < most < 200
    assert not lost(large(most))
    assert lost(large(most + 1))


@pytest.mark.parametrize("sign", ["a", "ψ", "😀", '"'])
def test_text_is_refused_from_the_first_sign_on_that_could_not_be_read_back(sign: str) -> None:
    def described(count: int) -> Scenario:
        return changed(description="ψ" + sign * count)

    none, one = (len(resolved_yaml(described(count))) for count in (0, 1))
    most = (CHARACTERS - none) // (one - none)
    assert not refused(described(most))
    assert not lost(described(most))
    assert refused(described(most + 1))
    assert lost(described(most + 1))


def test_each_run_of_a_comparison_has_to_be_readable_not_all_together() -> None:
    several = {f"law_{i}": dsc(3) for i in range(20)}
    assert not refused(changed(controllers=several))
    assert [key for key, _ in refused(changed(controllers=several | {"more": dsc(150)}))] == [
        "controllers.more.network.centers"
    ]


def test_runs_are_refused_whose_manifest_could_not_be_read_back(tmp_path: Path) -> None:
    law = example(kinds("controllers")["pid"])
    laws = {f"a_rather_long_name_of_law_{i:04}": law for i in range(limits.MOST_RUNS + 1)}
    scenario = changed(controllers=laws)
    ((key, text),) = limits.limits(read_back=True)(scenario)
    assert (key, text.split(";")[0]) == (
        "controllers",
        "has 1,001 runs, more than the 1,000 that podusv reads back as one comparison",
    )
    entry = manifest.FileEntry(sha256="a" * 64, bytes=10**9)
    names = ("scenario.yaml", "resolved.yaml", "log.h5", "metrics.json", "metrics.csv",
             "theory.json", "figures/controls.png", "provenance.json", "manifest.json",
             "missing.json")  # fmt: skip
    files = {f"{label}/{name}": entry for label in laws for name in names}
    whole = manifest.Manifest(podusv_format=1, status="finished", files=files)
    (tmp_path / "manifest.json").write_bytes(json_files.encode(whole.model_dump()))
    assert len(manifest.read(tmp_path).files) == len(files)


def test_too_much_is_told_at_the_largest_value_with_what_to_do() -> None:
    kinds_of_events = (yaml.ScalarEvent, yaml.SequenceStartEvent, yaml.MappingStartEvent)
    events = yaml.parse(resolved_yaml(along(200)))
    count = sum(isinstance(event, kinds_of_events) for event in events)
    text = f"with every default written out the scenario has {count} values, more than the 500 "
    assert refused(along(200)) == [
        ("path.points", f"{text}that podusv reads back; give fewer here")
    ]
    ((key, text),) = refused(changed(description="a" * 5000))
    assert key == "description"
    assert text.endswith("more than the 5,000 that podusv reads back; shorten this")


@pytest.mark.parametrize("command", ["run", "compare", "validate"])
def test_commands_refuse_it_before_anything_is_computed(podusv: Any, command: str) -> None:
    text = SOUND + f"description: {'😀' * 600}\n"
    with open("long.yaml", "w") as file:
        file.write(text)
    said = podusv(command, "long.yaml")
    assert said.code == 2
    assert said.err.startswith("long.yaml:6:14: description: with every default")


@pytest.mark.parametrize(("at_once", "largest"), [(1, 1000), (2, 1100), (3, 1110), (9, 1110)])
def test_runs_made_at_once_may_be_those_that_need_the_most_disk(at_once: int, largest: int) -> None:
    sizes = [limits.Size(1, 1, 50, 0.0, scratch, compressed=True) for scratch in (100, 10, 1000)]
    packed = limits.LEAST_COMPRESSED * 150
    assert limits.needed(sizes, at_once) == pytest.approx(packed + largest)
