"""`podusv live`: claims, margins, limits, laws that are added, plug-ins and reports."""

from __future__ import annotations

import json
import os
import shlex
import signal
import time
from pathlib import Path
from threading import Timer
from typing import Any

import numpy as np
import pytest
from plugin_samples import LAW

from podusv_cli.cli.demo import SCENARIO
from podusv_cli.engine.running.simulate import run, run_together
from podusv_cli.scenario.load import load
from podusv_cli.workflows.live import Live
from podusv_cli.workflows.live_verdicts import claims_about

OWN = "podusv:own_vessel.yaml"
LEGS = "podusv:laws/legs.yaml"
SHORT = ("simulation.duration=20.0",)
ADDED = {"controllers.second.kind": "momentum_vector"}


def framed(live: Live, moved: dict[str, Any], *, rest: bool, wanted: bool = False) -> Any:
    asked = {"moved": moved, "signals": [], "rest": rest, "controls": wanted}
    return live.answer("frame", asked)


@pytest.fixture(scope="module")
def demo() -> Live:
    live = Live(SCENARIO)
    live.frame({}, (), rest=True, wanted=True)
    return live


def test_verdicts_are_those_of_compare_and_turn_while_a_value_moves(demo: Live, podusv) -> None:
    at_first = {v["name"]: v["answer"] for v in framed(demo, {}, rest=True)["verdicts"]}
    moved = {"actuator.surge_limit": 4.1}
    rest, moving = (framed(demo, moved, rest=rest) for rest in (True, False))
    assert moving["verdicts"] == rest["verdicts"]
    said = podusv(*rest["command"].split()[1:], "--no-figures", "--out", "r", "--json")
    judged = {claim["claim"]: claim["verdict"] for claim in json.loads(said.out)["claims"]}
    words = {True: "reproduced", False: "not reproduced", None: "cannot tell"}
    assert {v["name"]: words[v["answer"]] for v in rest["verdicts"]} == judged
    turned = [v["name"] for v in rest["verdicts"] if v["answer"] is not at_first[v["name"]]]
    assert turned == ["D1"]


def test_only_what_can_be_told_is_judged_while_a_value_moves(tmp_path: Path) -> None:
    """A margin takes as long as ten runs, so a claim about one waits until the hand rests."""
    file = tmp_path / "claims.yaml"
    file.write_text(
        f"extends: {OWN}\nsimulation: {{duration: 20}}\nclaims:\n"
        "  late: {says: may be late, expect: pid.delay_margin > 0.5}\n"
        "  near: {says: comes near, expect: pid.e_steady < 100}\n"
    )
    live = Live(str(file))
    names = [
        [verdict["name"] for verdict in framed(live, {}, rest=rest)["verdicts"]]
        for rest in (True, False)
    ]
    assert names == [["late", "near"], ["near"]]
    assert framed(live, {}, rest=True)["verdicts"][0]["answer"] is True


def test_claims_about_laws_that_are_not_shown_are_left_out() -> None:
    live = Live(SCENARIO, laws=["pid", "momentum_vector"])
    assert [v["name"] for v in framed(live, {}, rest=True)["verdicts"]] == ["D2"]
    assert claims_about([], ["pid"]) == []


def test_a_claim_that_a_law_of_another_kind_cannot_answer_is_told_and_the_page_goes_on(
    tmp_path: Path,
) -> None:
    file = tmp_path / "claims.yaml"
    file.write_text(
        f"extends: {OWN}\nsimulation: {{duration: 20}}\nclaims:\n"
        "  winds: {says: winds up, expect: max(abs(pid.z_u)) > 0.5}\n"
    )
    live = Live(str(file))
    first = framed(live, {}, rest=True, wanted=True)
    assert [v["name"] for v in first["verdicts"]] == ["winds"]
    frame = framed(live, {"controller.kind": "momentum_vector"}, rest=True)
    assert frame["verdicts"] == []
    assert "claims.winds.expect" in frame["findings"][-1][0]


def test_margins_are_those_of_the_command(podusv) -> None:
    live = Live(OWN)
    live.frame({}, (), rest=True, wanted=True)
    moved = {"controller.K_Pu": 61.3, "vessel.m": 51.3}
    shown = {
        row[0]: row[3] for row in live.answer("margins", {"moved": moved})["margins"]["pid"]["rows"]
    }
    sets = [word for key, x in moved.items() for word in ("--set", f"{key}={x}")]
    (law,) = json.loads(podusv("margins", OWN, *sets, "--json").out)["laws"].values()
    text = json.dumps(law)
    assert shown["gain_margin_u"] == "any"
    for name in ("phase_margin_u", "phase_margin_r", "delay_margin", "decay_rate"):
        assert json.dumps(shown[name]) in text, name


def test_a_law_without_margins_says_why(demo: Live) -> None:
    told = demo.answer("margins", {"moved": {}})["margins"]
    assert {*told} == {"pid_winds_up", "pid", "momentum_vector"}
    assert all("steadily" in law["why"] and law["rows"] == [] for law in told.values())


def test_a_run_at_its_limits_and_one_that_diverges_are_told_in_words(demo: Live) -> None:
    frame = framed(demo, {}, rest=False)
    fractions = next(r for r in frame["numbers"] if r["name"] == "saturated_fraction")["values"]
    assert (
        frame["limits"]["pid"] == f"at the actuator's limits {100 * fractions[1]:.3g} % of the time"
    )
    live = Live(OWN, [*SHORT, "actuator.kind=ideal", "control.period=0.5"])
    live.frame({}, (), rest=True, wanted=True)
    frame = framed(live, {"controller.K_Pu": 10000.0}, rest=False)
    assert frame["limits"] == {"pid": ""}
    assert frame["endings"]["pid"].startswith("diverged at t = ")


def test_what_a_loop_dies_of_stands_first_and_is_a_whole_number_of_steps() -> None:
    live = Live(OWN, ["measurement.kind=sensors", "measurement.heading.noise=0.01"])
    first = live.frame({}, (), rest=True, wanted=True)["controls"]
    keys = [control["key"] for control in first[:4]]
    assert keys[:3] == ["control.period", "actuator.command.delay", "measurement.kind"]
    assert "measurement.heading.noise" in [c["key"] for c in first[:12]]
    assert first[1]["quantum"] == 0.01
    delay = {"actuator.command.delay": 0.37}
    moving, rest = (framed(live, delay, rest=rest) for rest in (False, True))
    assert moving["curves"] == rest["curves"]
    assert moving["curves"] != framed(live, {}, rest=False)["curves"]


def test_a_waypoint_is_moved_to_the_numbers_of_run_and_saved_in_its_list(podusv) -> None:
    live = Live(LEGS, ["simulation.duration=40.0"])
    controls = live.frame({}, (), rest=True, wanted=True)["controls"]
    first = {c["key"]: c["value"] for c in controls if c["part"] == "waypoints"}
    moved = {key: first[key] - 1.25 for key in ("path.points[1][0]", "path.points[1][1]")}
    moving, rest = (framed(live, moved, rest=rest) for rest in (False, True))
    for part in ("numbers", "curves", "chase", "command"):
        assert moving[part] == rest[part], part
    saved = live.answer("save", {"moved": moved, "name": "elsewhere"})
    points = load("elsewhere.yaml").scenario.path.waypoints()
    assert saved["command"].endswith("elsewhere.yaml")
    assert list(points[1]) == [*moved.values()]
    assert list(points[0]) == [first["path.points[0][0]"], first["path.points[0][1]"]]


def test_several_laws_march_at_once_to_the_bits_of_one_after_the_other() -> None:
    plans = [single.plan() for single in load(SCENARIO).scenario.singles().values()]
    for one, together in zip(map(run, plans), run_together(plans), strict=True):
        assert one.status == together.status
        assert one.signals.keys() == together.signals.keys()
        for name, numbers in one.signals.items():
            np.testing.assert_array_equal(numbers, together.signals[name])
        np.testing.assert_array_equal(one.seen, together.seen)


def test_an_interrupt_ends_all_marches_at_once() -> None:
    long = ["simulation.duration=20000.0", "log.every=1000"]
    plans = [single.plan() for single in load(SCENARIO, long).scenario.singles().values()]
    run_together([single.plan() for single in load(SCENARIO).scenario.singles().values()])
    Timer(0.3, os.kill, (os.getpid(), signal.SIGINT)).start()
    began = time.monotonic()
    recordings = run_together(plans)
    assert [recording.status for recording in recordings] == ["interrupted"] * 3
    assert all(0 < len(recording["time"]) < 2000 for recording in recordings)
    assert time.monotonic() - began < 10.0


def test_a_law_that_is_added_is_shown_beside_the_one_that_was_alone(podusv) -> None:
    live = Live(OWN, SHORT)
    alone = live.frame({}, (), rest=True, wanted=True)
    assert "momentum_vector" in alone["kinds"]
    moved = {**ADDED, "controllers.pid.K_Pu": 77.7}
    frame = framed(live, moved, rest=True, wanted=True)
    assert frame["added"] == ["second"]
    assert [run["label"] for run in frame["curves"]["runs"]] == ["pid", "second"]
    assert framed(live, moved, rest=False)["curves"] == frame["curves"]
    assert (
        framed(live, ADDED, rest=False)["chase"]["runs"][0]["x"] == alone["chase"]["runs"][0]["x"]
    )
    saved = live.answer("save", {"moved": moved, "name": "two"})
    assert saved["command"] == "podusv compare two.yaml"
    said = podusv(*saved["command"].split()[1:], "--no-figures", "--out", "r", "--json")
    runs = {run["controller"]: run["metrics"] for run in json.loads(said.out)["runs"]}
    energy = next(row for row in frame["numbers"] if row["name"] == "energy")["values"]
    assert energy == [runs["pid"]["energy"], runs["momentum_vector"]["energy"]]


@pytest.mark.parametrize(
    "moved",
    [
        {"controllers.x.kind": "evil"},
        {"controllers.../x.kind": "pid"},
        {"controllers.x.y.kind": "pid"},
        {"controllers.x.file": "evil.py"},
        {"controllers.x.kind": 3.0},
        {"controllers.x.kind": ["pid"]},
    ],
)
def test_no_other_law_is_added(moved: dict[str, Any]) -> None:
    live = Live(OWN, SHORT)
    live.frame({}, (), rest=True, wanted=True)
    (refused,) = framed(live, moved, rest=True)["refused"]
    assert "not among the values that this page moves" in refused["text"]


@pytest.mark.long
def test_the_report_is_that_of_compare_and_lies_in_the_results(demo: Live, podusv) -> None:
    moved = {"actuator.surge_limit": 4.1, "simulation.duration": 30.0}
    told = demo.answer("report", {"moved": moved})
    file = Path(told["file"])
    assert file.parent.parent.resolve() == (Path("results") / "demo").resolve()
    assert file.read_text("utf-8") == told["page"]
    made = json.loads((file.parent / "provenance.json").read_text("utf-8"))
    assert made["argv"] == framed(demo, moved, rest=False)["command"].split()


def test_plug_ins_of_the_command_line_are_moved_and_saved(tmp_path: Path, podusv) -> None:
    law = tmp_path / "law.py"
    law.write_text(LAW)
    live = Live(OWN, [*SHORT, "controller={kind: cross_track}"], files=[str(law)])
    keys = [c["key"] for c in live.frame({}, (), rest=True, wanted=True)["controls"]]
    assert "controller.gain" in keys
    assert "cross_track" in live.kinds
    moved = {"controller.gain": 2.3}
    frame = framed(live, moved, rest=False)
    assert frame["command"].endswith(f"--plugin {law}")
    saved = live.answer("save", {"moved": moved, "name": "own_law"})
    for command in (frame["command"], saved["command"]):
        assert podusv(*shlex.split(command)[1:], "--no-figures", "--force", "--out", "r").code == 0


def test_a_question_that_no_page_asks_is_answered_in_a_sentence(demo: Live) -> None:
    (refused,) = demo.answer("frames", {"moved": {}})["refused"]
    assert refused["text"].startswith("unknown question 'frames'; did you mean 'frame'?")
