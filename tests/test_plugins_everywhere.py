"""What a plug-in offers is known wherever podusv's own is: schema, completion, verify, Python."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from command_samples import Command
from plugin_samples import LAW, SCENARIO, put
from test_cli_words import offered_for

import podusv_cli as podusv_python
from podusv_cli.core.plugins import from_file
from podusv_cli.scenario.schema import json_schema

MORE = """
from podusv_cli.core.derived import difference
from podusv_cli.core.finding import after
from podusv_cli.figures.panels import signals_over_time
from podusv_cli.figures.sheet import figure
from podusv_cli.metrics.metric import Accumulator, Metric, gathered


@kernel
def watch(t, weight, s, row, k, seen):
    seen[0] = max(seen[0], abs(s[1]))


largest_east = Metric(
    "largest_east", "m", "largest |y|", Accumulator(watch, lambda _: 1, lambda _: {}), gathered(0)
)
GAP = Signal("gap", "m", "cross-track error less the distance to the target")
gap = difference(GAP, "e_ct", "z_e")
gaps = figure("gaps", caption="The gap over time", signals=("gap",))(signals_over_time("gap"))


@after("wide-gap", about="controller", meaning="the gap is wide")
def wide_gap(scenario, log):
    yield "the gap is wide"
"""
CLAIM = """
claims:
  C1: {says: s, source: t, expect: 'min(cross_track.gap) < 0 and cross_track.largest_east > 1'}
"""


@pytest.fixture
def scenario(podusv: Command) -> str:
    """A scenario whose plug-in has a law, a metric, a derived signal, a figure and a finding."""
    return put(SCENARIO + CLAIM, LAW + MORE)


def test_the_schema_has_kinds_and_findings_of_plug_ins(podusv: Command, scenario: str) -> None:
    told = json.loads(podusv("schema", "--plugin", "laws/my_law.py").out)
    assert "gain" in told["definitions"]["CrossTrack"]["properties"]
    assert "wide-gap" in told["properties"]["silence"]["items"]["enum"]
    assert "CrossTrack" not in json.loads(podusv("schema").out)["definitions"]


def test_a_class_of_a_plug_in_may_have_the_name_of_one_of_podusv() -> None:
    law = LAW.replace("class CrossTrack", "class Vessel")
    vessels = json_schema((), (from_file("namesake.py", law),))["definitions"]
    (own,) = (made for name, made in vessels.items() if name.endswith("__vessel__Vessel"))
    assert "otter" in own["properties"]["preset"]["enum"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("typed", "offered"),
    [
        ("podusv run --plugin {} a.yaml --set controller.kind=cr", {"controller.kind=cross_track"}),
        ("podusv plot --plugin {} x --figure ga", {"gaps"}),
        ("podusv explain --plugin {} wide", {"wide-gap"}),
        ("podusv explain --plugin no.py near-t", {"near-target"}),
    ],
)
def test_a_shell_completes_what_plug_ins_offer(
    scenario: str, tmp_path: Path, typed: str, offered: set[str]
) -> None:
    script = "import sys\nfrom podusv_cli import cli\ncli.main()"
    line = typed.format(Path("laws/my_law.py").resolve())
    assert set(offered_for(line, tmp_path, script)) == offered


def test_commands_tell_of_them(podusv: Command, scenario: str) -> None:
    given = ("--plugin", "laws/my_law.py")
    assert "The gap over time" in podusv("list", *given).out
    assert "shows gap" in podusv("explain", "gaps", *given).out
    assert "cross-track error less" in podusv("explain", "gap", *given).out
    assert podusv("explain", "gaps").code == 2
    assert "largest_east" in podusv("verify", scenario).out


def test_claims_use_its_metric_and_derived_signal(podusv: Command, scenario: str) -> None:
    said = podusv("compare", scenario, "--out", "c", "--no-figures")
    assert "C1  reproduced" in said.out


@pytest.mark.usefixtures("scenario")
def test_python_knows_them() -> None:
    run = podusv_python.simulate("a.yaml")
    assert run.metrics["largest_east"] == pytest.approx(2.0, abs=0.2)
    assert (run["gap"] == run["e_ct"] - run["z_e"]).all()
    assert len(run.plot("gaps").axes) == 1
    assert any("wide-gap" in line for line in run.warnings)
    assert "largest_east" in podusv_python.verify("a.yaml").loc["cross_track"].index
    many = podusv_python.simulate_many("a.yaml", {"controller.gain": [0.5, 1.0]})
    assert many["largest_east"].notna().all()
    assert f"{run.metrics['largest_east']:.5g} m" in run._repr_html_()
