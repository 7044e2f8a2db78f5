"""A resolved scenario is complete, and reads back to the same bits."""

from typing import Any, Literal, get_args, get_origin

import pytest
import yaml
from hypothesis import HealthCheck, given, reject, settings
from hypothesis import strategies as st
from pydantic import ValidationError
from scenario_samples import SOUND, loaded, write

from podusv_cli.core import json_text
from podusv_cli.core.about import BESIDE_RUNS
from podusv_cli.core.component import Component
from podusv_cli.core.errors import SizingError
from podusv_cli.core.system import name_refused
from podusv_cli.engine.loop.closed_loop import unmet
from podusv_cli.scenario.doubt import Doubt
from podusv_cli.scenario.identify import Identify
from podusv_cli.scenario.keys import limits, members, sections
from podusv_cli.scenario.limits import LEAST_COMPRESSED, Size, disk_needed
from podusv_cli.scenario.load import load, load_stored, load_text, values
from podusv_cli.scenario.model import Scenario
from podusv_cli.scenario.resolved import HEADING, resolved_yaml
from podusv_cli.scenario.sections import LABEL
from podusv_cli.scenario.sweep import Sweep
from podusv_cli.scenario.tune import Tune
from podusv_cli.scenario.yaml_text import MAX_NODES, read
from podusv_cli.storage import manifest

LARGEST = 1e6  # inertia of more than this overflows where two are multiplied
TEXT = st.text(st.characters(exclude_categories=("Cs", "Cc"), include_characters="\t\n"))


SWEEP = {
    "draws": 3,
    "vary": {
        "vessel.m": {"times": {"normal": {"sigma": 0.1, "within": (-0.5, 1e-3)}}},
        "hull": {"keys": ("vessel",), "rows": "X_u,Y_v\n-1.5,-2\n-1e-300,-.25\n"},
    },
    "grid": {"path": ({"kind": "line", "x": (1, 2.5)}, None, True), "name": ("a: b", "")},
    "claims": {"S1": {"says": "#", "source": "ours", "expect": "share(a.iae < b.iae) > 0.5"}},
}
TUNE = {
    "objective": ("median(iae)", "failures"),
    "space": {"around": 10.0, "pid.K_Pu": {"log": (1e-3, 2.5)}, "fold": {"choice": ("none", 1)}},
}
DOUBT = {"printed": ("path",), "vary": {"start.y": {"plus": {"uniform": (-1, 0.25)}}}}
IDENTIFY = {
    "logs": ({"file": "a.csv", "span": (0, 1e3)}, {"file": "b.csv", "role": "judge"}),
    "columns": {"psi": "heading [deg]"},
    "priors": {"m11": 1e-3},
}
# Sections of which hardly any mixture of values is possible.
SAMPLES = {Sweep: SWEEP, Tune: TUNE, Doubt: DOUBT, Identify: IDENTIFY}


def numbers(found: dict[str, Any]) -> st.SearchStrategy[float]:
    return st.floats(
        found.get("gt", found.get("ge", -LARGEST)),
        found.get("lt", found.get("le", LARGEST)),
        exclude_min="gt" in found,
        exclude_max="lt" in found,
    )


def contents(annotation: Any, found: dict[str, Any]) -> st.SearchStrategy[Any]:
    """Anything that a type allows within the field's limits."""
    for section in sections(annotation).values():
        if section in SAMPLES:
            return st.sampled_from([None, SAMPLES[section]])
    if sections(annotation):
        return st.one_of(*(components(part) for part in sections(annotation).values()))
    simple = {
        float: numbers(found),
        int: st.integers(int(found.get("ge", 1)), 5),
        bool: st.booleans(),
        str: st.from_regex(found["pattern"], fullmatch=True) if "pattern" in found else TEXT,
        type(None): st.none(),
    }
    kinds = [one for one in members(annotation) if one in simple]
    several = [simple[one] for one in kinds]
    several += [
        st.sampled_from(get_args(one)) for one in members(annotation) if get_origin(one) is Literal
    ]
    several += [lists(one, found) for one in members(annotation) if get_origin(one) is tuple]
    several += [
        st.dictionaries(
            st.from_regex(LABEL, fullmatch=True), contents(get_args(one)[1], {}), max_size=2
        )
        for one in members(annotation)
        if get_origin(one) is dict
    ]
    return st.one_of(*several)


def lists(annotation: Any, found: dict[str, Any]) -> st.SearchStrategy[Any]:
    parts = get_args(annotation)
    if parts[-1] is Ellipsis:
        return st.lists(contents(parts[0], found), max_size=4).map(tuple)
    return st.tuples(*(contents(part, found) for part in parts))


def components(model: type[Component], **chosen: Any) -> st.SearchStrategy[dict[str, Any]]:
    """Values for all fields of a model, as plain data."""
    fields = {
        name: contents(field.annotation, limits(field))
        for name, field in model.model_fields.items()
    }
    return st.fixed_dictionaries(fields | chosen)


SCENARIOS = components(
    Scenario,
    simulation=st.builds(
        lambda step, steps, compiled: {
            "step": step,
            "duration": steps * step,
            "compiled": compiled,
        },
        st.sampled_from([0.01, 0.001, 1 / 3]),
        st.integers(1, 10**6),
        st.booleans(),
    ),
    control=st.just({"period": 0.0}),
)


def possible(data: dict[str, Any]) -> Scenario:
    """The scenario of the data, with what excludes each other put right."""
    for vessel in (data["vessel"], data["nominal"]):
        vessel.update(preset="paper", x_g=0.0, Y_rdot=0.0, N_vdot=0.0, X_udot=-1.0, Y_vdot=-1.0)
        vessel.update(N_rdot=-1.0)
    data["plugins"] = {}  # none of these files exists
    if data["path"]["kind"] in ("waypoints", "legs", "legs_hold"):
        points = ((0.0, 0.0), (1.0, 0.5), *data["path"]["points"])
        data["path"].update(file=None, speed=0.5, points=tuple(dict.fromkeys(points)))
    if data["actuator"]["kind"] == "pod":
        data["actuator"].update(preset="otter")
    for law in (data["controller"], *data["controllers"].values()):
        step = data["simulation"]["step"]
        sampled = {"rate": "analytic", "hold_below": 0.0, "check_every": step, "execute": step}
        sampled["file"] = None  # nor any of an autopilot
        law.update({key: value for key, value in sampled.items() if key in law})
        if "network" in law:
            low, high, widths = (-1.0, -1.0, -1.0), (1.0, 2.0, 0.5), (1.0, 2.0, 3.0)
            law["network"].update(low=low, high=high, widths=widths)
    windows, radii = data["metrics"]["windows"], data["metrics"]["radii"]
    windows.update({name: (abs(start), abs(start) + 1.0) for name, (start, _) in windows.items()})
    radii.update({name: abs(radius) + 0.1 for name, radius in radii.items()})
    # Their times have to fit the step: a test of their own is below.
    data.update(measurement={"kind": "exact"}, estimator={"kind": "none"})
    data["actuator"].update(command=None)
    try:
        made = Scenario.model_validate(data).in_numbers()
    except (ValidationError, SizingError):
        return reject()
    seas, step = made.disturbances().values(), made.simulation.step
    refused = any(any(sea.conflicts(made.vessel, step)) for sea in seas)
    missing = any(any(unmet(law, made.path, made.actuator, 0)) for law in made.laws().values())
    return reject() if refused or missing or name_refused(made.name) else made


# podusv refuses most mixtures of values, as it should; in place of the checks of conftest.py.
UNHURRIED = (HealthCheck.filter_too_much, HealthCheck.too_slow)


@settings(max_examples=5, deadline=None, suppress_health_check=UNHURRIED)
@given(SCENARIOS)
@pytest.mark.long
def test_a_resolved_scenario_reads_back_to_the_same_bits(data):
    scenario = possible(data)
    again = load_stored(resolved_yaml(scenario), "resolved.yaml").scenario
    assert again == scenario
    assert repr(again) == repr(scenario), "-0.0 equals 0.0, but is not the same number"


def test_every_value_is_written_out_and_none_is_a_default_any_more():
    first = loaded(SOUND)
    again = load_text(resolved_yaml(first.scenario), "resolved.yaml")
    assert list(again.origins) == list(first.origins)
    assert all(origin.startswith("resolved.yaml:") for origin in again.origins.values())


def test_the_same_scenario_gives_the_same_text_and_another_one_another():
    text = resolved_yaml(loaded(SOUND).scenario)
    assert text == resolved_yaml(loaded(SOUND).scenario)
    assert resolved_yaml(load_text(text, "b.yaml").scenario) == text
    assert resolved_yaml(loaded(SOUND, ["start.x=1e-300"]).scenario) != text


def test_keys_stand_in_the_order_of_the_fields_behind_the_kind():
    text = resolved_yaml(loaded(SOUND).scenario)
    assert text.startswith(HEADING)
    assert HEADING.startswith("#")
    assert HEADING.count("\n") == 1
    node = read(text, "a.yaml", [])
    assert node is not None
    optional = ("origin", *BESIDE_RUNS)
    assert [*node.mapping] == [key for key in Scenario.model_fields if key not in optional]
    law = list(node.mapping["controller"].mapping)
    assert law[:3] == ["kind", "k_ze", "k_psie"]


@pytest.mark.parametrize(
    "number", [1e-5, 1e16, 1e22, 5e-324, 1.7976931348623157e308, 0.1 + 0.2, -0.0]
)
def test_a_float_reads_back_whatever_its_notation(number):
    scenario = loaded(SOUND, [f"start.x={number!r}"]).scenario
    again = load_text(resolved_yaml(scenario), "a.yaml").scenario
    assert repr(again.start.x) == repr(number)


@pytest.mark.parametrize(
    "text",
    [
        "no",
        "null",
        "017",
        "1e-3",
        "1:30",
        "~",
        "# x",
        "a: b",
        "'",
        '"',
        " x ",
        "x\n\ny\t",
        "\u2028",
        "💥",
        "é\u0301",
        "- a",
        "[1]",
        "true",
        "0x1F",
        "2026-11-20",
        "<<",
        "=",
        "\ufeffa",
    ],
)
def test_a_text_reads_back_whatever_it_looks_like(text):
    scenario = loaded(SOUND).scenario.model_copy(update={"description": text})
    assert load_text(resolved_yaml(scenario), "a.yaml").scenario == scenario


def test_other_readers_of_yaml_find_the_same_values():
    scenario = loaded(SOUND).scenario
    found = yaml.safe_load(resolved_yaml(scenario))
    assert found["controller"] == scenario.controller.model_dump()
    assert found["vessel"] == scenario.vessel.model_dump()


def test_values_are_all_leaves_by_their_dotted_keys():
    scenario = loaded(SOUND).scenario
    found = values(scenario)
    assert found["vessel.m"] == scenario.vessel.m
    assert found["path.kind"] == "line"
    assert found["controllers"] == {}
    assert not any(content for content in found.values() if isinstance(content, dict))


# --- what podusv accepts, it reads back afterwards; what runs need of the disk


@pytest.fixture
def of_two_files(tmp_path, monkeypatch):
    """A scenario of more values than one file may have."""
    monkeypatch.chdir(tmp_path)
    several = MAX_NODES // 3 - 100
    write("base.yaml", f"path: {{kind: waypoints, points: {[[i, 0.0] for i in range(several)]}}}\n")
    codes = ", ".join(["saturated"] * several)
    rest = "".join(line for line in SOUND.splitlines(True) if not line.startswith("path"))
    write("a.yaml", f"extends: base.yaml\n{rest}silence: [{codes}]\n")
    return load("a.yaml").scenario


@pytest.mark.slow
def test_a_scenario_of_several_long_files_is_read_back(of_two_files):
    text = resolved_yaml(of_two_files)
    assert load_stored(text, "resolved.yaml").scenario == of_two_files


@pytest.mark.slow
def test_the_manifest_of_many_runs_is_read_back(tmp_path):
    entry = manifest.FileEntry(sha256="a" * 64, bytes=10**9)
    names = (
        "scenario.yaml",
        "resolved.yaml",
        "log.h5",
        "metrics.json",
        "metrics.csv",
        "theory.json",
        "figures/controls.png",
        "provenance.json",
        "manifest.json",
        "missing.json",
    )
    files = {f"a_rather_long_name_of_law_{i:04}/{n}": entry for i in range(3000) for n in names}
    whole = manifest.Manifest(podusv_format=manifest.FORMAT, status="finished", files=files)
    (tmp_path / "manifest.json").write_bytes(json_text.encode(whole.model_dump()))
    assert len(manifest.read(tmp_path).files) == len(files)


@pytest.mark.parametrize(("at_once", "largest"), [(1, 1000), (2, 1100), (3, 1110), (9, 1110)])
def test_runs_made_at_once_may_be_those_that_need_the_most_disk(at_once, largest):
    sizes = [Size(1, 1, 50, 0.0, scratch, compressed=True) for scratch in (100, 10, 1000)]
    packed = LEAST_COMPRESSED * 150
    assert disk_needed(sizes, at_once) == pytest.approx(packed + largest)
