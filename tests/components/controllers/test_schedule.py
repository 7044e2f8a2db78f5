"""The law `schedule`: its rows, what is between them, its feedback, and motions repeated by it."""

import math

import numpy as np
import pytest
from command_samples import write
from conftest import NONLINEAR, corrected, run
from pydantic import ValidationError
from scenario_samples import SOUND, findings

from podusv_cli.components.controllers.pid import Pid
from podusv_cli.components.controllers.schedule import Schedule
from podusv_cli.core.kernel import bundle, call
from podusv_cli.core.phrases import value_text
from podusv_cli.core.timed_rows import LARGEST
from podusv_cli.scenario.load import load
from podusv_cli.scenario.resolved import resolved_yaml


@pytest.fixture(autouse=True)
def _in_a_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "sub").mkdir()


OPEN = "t, tau_u, tau_r\n# a comment\n0, 1, -1\n\n2, 3, -2\n3, 3, 5\n"
PSI = 2  # position of the heading in a state


def demand(law, t, x=(0.0,) * 6):
    """Demand and signals at time t for the state x."""
    tau, signals = np.full(2, np.nan), np.full(2, np.nan)
    k = bundle(law.constants_with(NONLINEAR))
    none = np.zeros(0)
    call(
        law.law,
        t=t,
        x=np.array(x),
        memory=none,
        target=np.zeros(6),
        k=k,
        table=law.table(),
        tau=tau,
        rate=none,
        signals=signals,
        work=np.zeros(1),
    )
    return [*tau, *signals]


def rows(*lines):
    return "".join(", ".join(f"{number:.17g}" for number in line) + "\n" for line in lines)


@pytest.mark.parametrize(
    ("t", "linear", "held"),
    [
        (-1.0, (1, -1), (1, -1)),
        (0.0, (1, -1), (1, -1)),
        (0.5, (1.5, -1.25), (1, -1)),
        (2.0, (3, -2), (3, -2)),
        (2.5, (3, 1.5), (3, -2)),
        (3.0, (3, 5), (3, 5)),
        (99.0, (3, 5), (3, 5)),
    ],
)
def test_the_demand_is_a_straight_line_or_held_between_rows_and_the_nearest_row_beyond(
    t, linear, held
):
    assert demand(Schedule(rows=OPEN), t) == [*linear, 0.0, 0.0]
    assert demand(Schedule(rows=OPEN, between="hold"), t) == [*held, 0.0, 0.0]


def test_the_gains_multiply_the_state_s_errors_and_are_lines_themselves():
    surge, yaw = np.arange(1.0, 7.0), np.arange(10.0, 16.0)
    before, after = np.zeros(12), np.concatenate([surge, yaw])
    law = Schedule(rows=rows([0, 1, 2, *[0.0] * 6, *before], [1, 1, 2, *[0.0] * 6, *after]))
    error = np.array([0.1, -0.2, 0.3, 0.05, -0.04, 0.02])
    for t in (0.25, 1.0, 5.0):
        added = min(t, 1.0) * np.array([surge @ error, yaw @ error])
        assert demand(law, t, -error) == pytest.approx([1 + added[0], 2 + added[1], *added])


def test_a_heading_that_passes_half_a_turn_goes_on():
    gains = np.zeros(12)
    gains[6 + PSI] = 1.0
    there = [[t, 0, 0, 0, 0, math.remainder(3.0 + t, 2 * math.pi), 0, 0, 0, *gains] for t in (0, 1)]
    law = Schedule(rows=rows(*there))
    for heading in (3.5, 3.5 - 2 * math.pi):
        assert demand(law, 0.5, [0, 0, heading, 0, 0, 0])[1] == pytest.approx(0.0, abs=1e-12)
    assert demand(law, 0.5, [0, 0, 3.4, 0, 0, 0])[1] == pytest.approx(0.1)


def scheduled(recording, gains, every=10):
    """A run as a schedule, with constant gains."""
    names = ("time", "tau_u", "tau_r", "x", "y", "psi", "u", "v", "r")
    motion = np.column_stack([recording[name][::every] for name in names])
    return Schedule(rows=rows(*np.hstack([motion, np.tile(gains, (len(motion), 1))])))


def test_feedback_repeats_a_motion_that_the_demand_alone_loses():
    # The hull does not keep its course: departures grow by e in a second or two.
    original = run(corrected(controller=Pid(K_Pu=100.0)), 20.0)
    gains = np.zeros(12)
    gains[[0, 3, 6 + PSI, 6 + 5]] = 20.0, 40.0, 20.0, 20.0
    kept = run(corrected(controller=scheduled(original, gains)), 20.0)
    lost = run(corrected(controller=scheduled(original, np.zeros(12))), 20.0)
    away = [np.hypot(o["x"] - original["x"], o["y"] - original["y"]) for o in (kept, lost)]
    assert away[0].max() < 0.1 < 10.0 < away[1].max()
    assert abs(kept["feedback_r"]).max() > 0.0
    assert not lost["feedback_u"].any()


SCHEDULE = "controller: {kind: schedule, file: demand.csv}\n"


def with_schedule(text=SCHEDULE):
    return "\n".join(line for line in SOUND.splitlines() if "controller" not in line) + "\n" + text


def test_a_schedule_comes_from_a_file_beside_the_scenario_and_stays_in_it():
    write("sub/demand.csv", OPEN)
    write("sub/a.yaml", with_schedule())
    got = load("sub/a.yaml")
    assert (got.scenario.controller.file, got.scenario.controller.rows) == (None, OPEN)
    assert got.origins["controller.rows"] == "sub/demand.csv"
    write("b.yaml", resolved_yaml(got.scenario))
    assert load("b.yaml").scenario.controller == got.scenario.controller


def test_one_of_several_laws_may_have_a_schedule():
    write("demand.csv", OPEN)
    several = "controllers: {one: {kind: pid}, two: {kind: schedule, file: demand.csv}}\n"
    write("a.yaml", with_schedule(several))
    assert load("a.yaml").scenario.controllers["two"].rows == OPEN


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "the schedule needs at least two lines, has 0"),
        ("0,1,1\n", "the schedule needs at least two lines, has 1"),
        (
            "0,1,1\n1,2\n",
            "line 2 of the schedule has 2; every line must have 3 (t, tau_u, tau_r) "
            "or 4 (t, tau_u, tau_r, tau_v) "
            "or 21 (t, tau_u, tau_r, x, y, psi, u, v, r, then the gains of tau_u and tau_r) "
            "or 28 (t, tau_u, tau_r, tau_v, x, y, psi, u, v, r, then the gains of all three)",
        ),
        ("t,tau_u,tau_r\n0,1,1\n1,s3cret,2\n", "line 3, column 2 of the schedule is no number"),
        ("0,1,1\n1,nan,2\n", "line 2, column 2 of the schedule is not a finite number"),
        ("0,1,1\n0,1,2\n", "line 2 of the schedule: its time is not after that of the line before"),
        (
            "t,tau_r,s3cret\n0,1,1\n1,1,2\n",
            "line 1 of the schedule names columns that are not t [s], tau_u [N], tau_r [N m] "
            "(in any order, units may be left out): column 3 is none of these",
        ),
    ],
)
def test_a_wrong_schedule_is_told_in_a_sentence_that_repeats_none_of_it(text, says):
    write("demand.csv", text)
    write("a.yaml", with_schedule())
    (said,) = findings("a.yaml")
    assert said == f"demand.csv: controller.rows: {says}"


def test_a_header_of_a_motion_names_the_columns_up_to_the_gains():
    row = ",".join(["1"] * 20)
    head = "t, tau_u, tau_r, x, y, psi, u, v, r, then the gains of tau_u and tau_r"
    Schedule(rows=f"{head}\n0,{row}\n1,{row}\n")
    with pytest.raises(ValidationError, match="line 1 of the schedule names columns in another or"):
        Schedule(rows=f"{head.replace('u, v', 'v, u')}\n0,{row}\n1,{row}\n")


def test_a_motion_with_a_sway_force_has_a_feedback_of_three_loads():
    """Two rows 2 s apart, a quarter of the way between them; the heading goes the short way."""
    random = np.random.default_rng(5)
    demands, states, gains = (random.normal(0, 1, (2, n)) for n in (3, 6, 18))
    states[:, 2] = 3.1, -3.1
    rows = np.column_stack([[0.0, 2.0], demands, states, gains])
    law = Schedule(rows="\n".join(", ".join(map(repr, row)) for row in rows.tolist()))
    tau, signals, x = np.full(3, np.nan), np.full(2, np.nan), random.normal(0, 1, 6)
    k = bundle(law.constants())
    call(law.law, t=0.5, x=x, k=k, table=law.table(), tau=tau, signals=signals)
    states[1, 2] = 2.0 * np.pi - 3.1
    there = states[0] + 0.25 * (states[1] - states[0])  # rates of two rows are those of their line
    error = there - x
    error[2] -= 2.0 * np.pi * np.round(error[2] / (2.0 * np.pi))
    K = (gains[0] + 0.25 * (gains[1] - gains[0])).reshape(3, 6)
    expected = demands[0] + 0.25 * (demands[1] - demands[0]) + K @ error
    np.testing.assert_allclose(tau, expected, rtol=1e-12)
    assert law.asks_sway()
    head = "t, tau_u, tau_r, tau_v, x, y, psi, u, v, r, then the gains of all three"
    assert Schedule(rows=f"{head}\n{law.rows}\n").table() == pytest.approx(law.table())


def test_a_schedule_that_the_resolved_scenario_could_not_hold_is_refused():
    line = "0.1, 1.0, 1.0\n"
    with pytest.raises(ValidationError, match="longer than 900,000 characters"):
        Schedule(rows=line * (LARGEST // len(line) + 1))


def test_many_lines_are_counted_where_a_value_is_shown():
    assert value_text("a\n" * 3001) == "3,001 lines"
    assert value_text("a\nb") == "a\nb"
