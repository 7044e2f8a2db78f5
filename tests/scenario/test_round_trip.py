"""Every registered component: its runs are read again by all commands that take finished runs."""

import json
from itertools import cycle, islice
from typing import Any

import pytest
from command_samples import ROOT
from conftest import ROOMS, example, kinds
from old_results import draw_quickly
from paper_samples import untimed
from rotation import one_in
from storage_samples import files

from podusv_cli.scenario.load import load, load_stored
from podusv_cli.scenario.presets import preset_names, with_presets
from podusv_cli.scenario.resolved import resolved_yaml
from podusv_cli.workflows import compare, execute

SECTIONS = {room: room.removesuffix("s") for room in ROOMS}
CSV = "0, 0\n10, 1\n18, 6\n"


def registered() -> dict[str, list[dict[str, Any]]]:
    """Every choice for each section of a scenario, as plain data."""
    found = {
        section: [example(kind).model_dump(mode="json") for kind in kinds(room).values()]
        for room, section in SECTIONS.items()
    }
    found["path"].append({"kind": "waypoints", "file": "points.csv"})
    exact, sensors = found["measurement"]  # of which the first leaves nothing to estimate
    found["measurement"] = [
        exact if estimator["kind"] == "none" else sensors for estimator in found["estimator"]
    ]
    pods, vessels = (with_presets()[key][1] for key in ("actuator.pod", "vessel"))
    found["actuator"] += [{"kind": "pod", "preset": name} for name in preset_names(pods)]
    found["vessel"] = [{"preset": name} for name in preset_names(vessels)]
    return found


def scenarios() -> list[dict[str, Any]]:
    """So many scenarios that every choice is in one of them; kinds first, then presets."""
    found = registered()
    count = max(map(len, found.values()))
    columns = [islice(cycle(choices), count) for choices in found.values()]
    return [dict(zip(found, row, strict=True)) for row in zip(*columns, strict=True)]


def named(parts: dict[str, Any]) -> str:
    return "-".join(part.get("preset") or part["kind"] for part in parts.values())


@pytest.mark.slow
@pytest.mark.parametrize(
    "parts",
    [pytest.param(s, marks=[pytest.mark.slow] * (i > 3)) for i, s in enumerate(scenarios())],
    ids=named,
)
def test_a_run_of_every_component_is_plotted_repeated_and_compared(
    podusv, parts, tmp_path, monkeypatch
):
    draw_quickly(monkeypatch)
    for room in (compare, execute):
        monkeypatch.setattr(room, "law_costs", untimed)
    brief = {"simulation": {"step": 0.01, "duration": 0.05, "compiled": False}}
    (tmp_path / "b.yaml").write_text(json.dumps(parts | brief))
    (tmp_path / "points.csv").write_text(CSV)
    made = podusv("run", "b.yaml", "--out", "b", "--no-figures", "-q")
    assert made.code == 0, made.err
    (tmp_path / "points.csv").unlink()
    for words in (
        ("plot", "b", "--figure", "trajectory"),
        ("rerun", "b", "--out", "again"),
        ("compare", "b", "again", "--no-figures", "-q"),
        ("diff", "b", "again"),
        ("run", "b/resolved.yaml", "--out", "c", "--no-figures", "-q"),
        ("diff", "b", "c"),
    ):
        said = podusv(*words)
        assert said.code == 0, f"{words}: {said.err}"
    assert files(tmp_path / "b")["log.h5"] == files(tmp_path / "c")["log.h5"]


CONFIGS = ROOT / "configs"
SHIPPED = {path.relative_to(CONFIGS).as_posix(): path for path in CONFIGS.rglob("*.yaml")}
# Of these others are made, which have the same keys: by other numbers, or by `extends`.
ALIKE = {
    *(f"sea/state_{state}.yaml" for state in (2, 3, 5, 6)),
    *(f"studies/sea_state_{state}.yaml" for state in (2, 6)),
    *(f"studies/tune_{name}.yaml" for name in ("phases", "hull")),
    *(name for name in SHIPPED if name.startswith("bench/")),
}


@pytest.mark.parametrize("name", one_in(3, sorted(SHIPPED)))
def test_a_shipped_scenario_says_what_it_is_for_and_its_runs_read_back(name):
    path = SHIPPED[name]
    first, second, *_ = path.read_text().splitlines()
    assert first.startswith("# ")
    prefix = "# yaml-language-server: $schema="
    assert second.startswith(prefix)
    assert (path.parent / second.removeprefix(prefix)).resolve().name == "schema.json"
    if "not meant to be run" in first:
        return
    scenario = load(path).scenario
    assert scenario.description
    of_each_law = {type(single.controller): single for single in scenario.singles().values()}
    for one in () if name in ALIKE else of_each_law.values():
        assert load_stored(resolved_yaml(one), "resolved.yaml").scenario == one
