"""Recorded commands of propellers and pods, which a schedule gives them in place of a demand."""

import math
from pathlib import Path

import numpy as np
import pytest
from rotation import one_in
from scenario_samples import findings, write

import podusv
from podusv_cli.components.actuators.recorded import Recorded
from podusv_cli.core.errors import UsageError
from podusv_cli.export.law import ExportedLaw
from podusv_cli.scenario.load import load, load_stored
from podusv_cli.scenario.resolved import resolved_yaml

HULL = {
    "m": 41.3,
    "I_z": 7.9,
    "X_udot": -3.7,
    "Y_vdot": -29.1,
    "N_rdot": -4.3,
    "X_u": -6.1,
    "Y_v": -23.7,
    "N_r": -9.7,
}
PODS = (
    {
        "x": -0.83,
        "y": 0.11,
        "T_nn": 0.041,
        "T_nn_astern": 0.023,
        "T_nV": 0.013,
        "n_max": 17.3,
        "n_max_astern": 9.1,
        "n_rate": 21.0,
        "n_lag": 0.37,
        "angle_limit": 0.61,
        "angle_rate": 0.43,
        "angle_lag": 0.29,
    },
    {
        "x": -0.79,
        "y": -0.31,
        "T_nn": 0.037,
        "T_nn_astern": 0.031,
        "T_nV": 0.009,
        "n_max": 13.7,
        "n_max_astern": 11.9,
        "n_rate": 19.0,
        "n_lag": 0.53,
        "angle_limit": 0.0,
    },
)
# The second is faster than it can be at the third row, and the first turned further.
ROWS = np.array(
    [
        [0.37, 11.3, 4.1, 0.23],
        [1.91, -7.7, 9.3, -0.41],
        [3.23, 5.9, 15.1, 0.77],
        [5.3, 8.3, 2.9, 0.1],
    ]
)
COMMANDS = ("t [s]", "n_1", "n_2 [1/s]", "delta_1")
STEP, DURATION = 0.01, 6.5


def text(names=COMMANDS, rows=ROWS):
    lines = [", ".join(f"{number:.17g}" for number in row) for row in np.array(rows).tolist()]
    return "\n".join([", ".join(names), *lines, ""])


def scenario(between="linear", **others):
    return {
        "name": "replayed",
        "vessel": {"length": 2.1, "beam": 0.9, **HULL},
        "actuator": {"kind": "pod", "pods": PODS},
        "path": {"kind": "line"},
        "disturbance": {"kind": "none"},
        "start": {"x": 1.7, "y": -0.9, "psi": 0.83, "u": 0.41, "v": -0.07, "r": 0.03},
        "controller": {"kind": "schedule", "rows": text(), "between": between},
        "simulation": {"duration": DURATION, "step": STEP},
        **others,
    }


def commands(t: float, between: str) -> tuple[list[float], list[float]]:
    """Speeds and angles that are asked for, within their limits."""
    times = ROWS[:, 0]
    last = max(int(np.searchsorted(times, t, side="right")) - 1, 0)
    given = [
        float(ROWS[last, 1 + i] if between == "hold" else np.interp(t, times, ROWS[:, 1 + i]))
        for i in range(3)
    ]
    most = ((-9.1, 17.3), (-11.9, 13.7), (-0.61, 0.61))
    first, second, angle = (
        min(max(x, low), high) for x, (low, high) in zip(given, most, strict=True)
    )
    return [first, second], [angle, 0.0]


def rates(t: float, s: list[float], between: str) -> list[float]:
    """Newton's second law for a hull that is symmetric fore and aft, and first-order lags."""
    _, _, psi, u, v, r, *pods = s
    speeds, angles = commands(t, between)
    tau = [0.0, 0.0, 0.0]
    turned = []
    for i, pod in enumerate(PODS):
        n, delta = pods[i], pods[2 + i]
        through = (u - pod["y"] * r) * math.cos(delta) + (v + pod["x"] * r) * math.sin(delta)
        gain = pod["T_nn"] if n >= 0.0 else pod["T_nn_astern"]
        thrust = gain * abs(n) * n - pod["T_nV"] * through * abs(n)
        along, across = thrust * math.cos(delta), thrust * math.sin(delta)
        tau = [tau[0] + along, tau[1] + across, tau[2] + pod["x"] * across - pod["y"] * along]
        most = pod["n_rate"]
        turned.append(min(max((speeds[i] - n) / pod["n_lag"], -most), most))
    swung = min(max((angles[0] - pods[2]) / 0.29, -0.43), 0.43)
    m11, m22, m33 = 41.3 + 3.7, 41.3 + 29.1, 7.9 + 4.3
    return [
        u * math.cos(psi) - v * math.sin(psi),
        u * math.sin(psi) + v * math.cos(psi),
        r,
        (tau[0] + m22 * v * r - 6.1 * u) / m11,
        (tau[1] - m11 * u * r - 23.7 * v) / m22,
        (tau[2] - (m22 - m11) * u * v - 9.7 * r) / m33,
        *turned,
        swung,
        0.0,
    ]


def marched(between: str) -> np.ndarray:
    """The same by a plain loop of classical Runge-Kutta."""
    s = np.array([1.7, -0.9, 0.83, 0.41, -0.07, 0.03, 0.0, 0.0, 0.0, 0.0])
    track = [s]
    for k in range(round(DURATION / STEP)):
        t = k * STEP
        a = np.array(rates(t, s.tolist(), between))
        b = np.array(rates(t + 0.5 * STEP, (s + 0.5 * STEP * a).tolist(), between))
        c = np.array(rates(t + 0.5 * STEP, (s + 0.5 * STEP * b).tolist(), between))
        d = np.array(rates(t + STEP, (s + STEP * c).tolist(), between))
        s = s + STEP / 6.0 * (a + 2.0 * b + 2.0 * c + d)
        track.append(s)
    return np.array(track)


@pytest.mark.parametrize("between", ["linear", "hold"])
def test_the_pods_do_what_a_plain_loop_says(between):
    run = podusv.simulate(scenario(between))
    track = marched(between)
    for i, name in enumerate(("x", "y", "psi", "u", "v", "r")):
        assert np.abs(run[name] - track[:, i]).max() < 1e-10, name
    assert np.abs(run["n"] - track[:, 6:8]).max() < 1e-9
    assert np.abs(run["delta"] - track[:, 8:10]).max() < 1e-10
    asked = np.array([np.concatenate(commands(t, between)) for t in run["time"]])
    assert np.abs(np.hstack([run["n_cmd"], run["delta_cmd"]]) - asked).max() < 1e-12
    assert run["saturated"].max() == 1.0, "where a row is beyond a limit"
    assert run["saturated"][0] == 0.0
    assert not np.any(run["tau_u_cmd"])
    assert not np.any(run["tau_r_cmd"])


BOAT = """
vessel: {preset: otter}
actuator: {kind: pod, preset: otter}
path: {kind: sinusoid, speed: 0.73}
disturbance: {kind: current, speed: 0.17, direction: 1.1}
controller: {kind: momentum_vector}
simulation: {duration: 23.6, step: 0.01}
"""


def of_log(run):
    """A schedule of what the pods of a run were asked for."""
    (speed,) = (name for name in ("n", "n_part") if name in run.log)
    count = run["delta"].shape[1]
    names = [f"{name}_{i}" for name in (speed, "delta") for i in range(1, count + 1)]
    rows = np.column_stack([run["time"], run[f"{speed}_cmd"], run["delta_cmd"]])
    return text(["t", *names], rows)


MODEL_SHIP = (
    BOAT.replace(
        "actuator: {kind: pod, preset: otter}", "actuator: {kind: pod, preset: cybership2_pod}"
    )
    .replace("preset: otter", "preset: cybership2")
    .replace("0.73", "0.31")
    .replace("0.17", "0.03")
)


def off(run, again):
    """The largest distance between two tracks [m]."""
    return np.hypot(again["x"] - run["x"], again["y"] - run["y"]).max()


@pytest.mark.parametrize(("boat", "within"), one_in(2, [(BOAT, 2e-4), (MODEL_SHIP, 0.02)]))
def test_a_run_s_own_commands_give_its_own_track(tmp_path, monkeypatch, boat, within):
    """Only what commands do within a step is not in a log: less, the shorter the step is.

    The otter's propellers move on smoothly, the pod of the model ship jumps by 70 degrees.
    """
    monkeypatch.chdir(tmp_path)
    errors = []
    for step in (0.02, 0.01, 0.005):
        write("task.yaml", boat.replace("step: 0.01", f"step: {step}"))
        run = podusv.simulate("task.yaml")
        write("commands.csv", of_log(run))
        replay = {"kind": "schedule", "file": "commands.csv"}
        errors.append(off(run, podusv.simulate("task.yaml", {"controller": replay})))
    assert np.hypot(run["x"], run["y"]).max() > 2.0
    assert errors[1] < within
    assert errors[2] < errors[0] / 4.0
    held = podusv.simulate("task.yaml", {"controller": {**replay, "between": "hold"}})
    assert off(run, held) > errors[2], "commands that are held come half a step late"


def test_commands_do_what_they_did_in_a_log_whatever_failed(tmp_path, monkeypatch):
    """A pod that fails does so behind its commands, as with a law."""
    monkeypatch.chdir(tmp_path)
    failing = {"actuator.failure": {"time": 9.1, "pod": 1, "effectiveness": 0.31}}
    write("task.yaml", BOAT)
    run = podusv.simulate("task.yaml", failing)
    law = {"controller": {"kind": "schedule", "rows": of_log(run)}}
    again = podusv.simulate("task.yaml", failing | law)
    assert off(run, again) < 1e-3
    assert off(run, podusv.simulate("task.yaml", law)) > 0.1, "with a pod that does not fail"


def test_a_study_has_the_bits_of_runs_alone(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    drawn = {"draws": 9, "vary": {"vessel.m": {"times": {"uniform": [0.8, 1.2]}}}}
    study = podusv.sweep(scenario(sweep=drawn), out="study", figures=False)
    nominal = podusv.load(scenario()).nominal.model_dump()
    for row in study.table.to_dict("records")[:3]:
        changes = {"vessel.m": 41.3 * row["vessel.m"], "nominal": nominal}
        assert podusv.simulate(scenario(), changes).metrics["energy"] == row["energy"]


def test_columns_may_stand_in_any_order_and_fixed_angles_be_there():
    one = podusv.simulate(scenario())
    order = [2, 0, 3, 1]
    other = text([COMMANDS[i] for i in order], ROWS[:, order])
    asked = text(["t", "n_cmd_1 [1/s]", "n_cmd_2", "delta_cmd_1"])
    whole = text([*COMMANDS, "delta_2 [rad]"], np.column_stack([ROWS, np.zeros(len(ROWS))]))
    for rows in (other, whole, asked):
        again = podusv.simulate(scenario(), {"controller.rows": rows})
        assert again["x"].tolist() == one["x"].tolist()


def test_a_comparison_has_a_law_beside_recorded_commands(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write("commands.csv", text())
    laws = {"pid": {"kind": "pid"}, "recorded": {"kind": "schedule", "file": "commands.csv"}}
    made = podusv.compare(scenario(controllers=laws), out="both", figures=False)
    alone = podusv.simulate(scenario())
    assert made["recorded"]["x"].tolist() == alone["x"].tolist()
    assert np.any(made["pid"]["tau_u_cmd"])


TASK = """
vessel: {preset: otter}
actuator: {kind: pod, preset: otter}
path: {kind: line, speed: 0.5}
disturbance: {kind: none}
controller: {kind: schedule, file: commands.csv}
"""


def test_columns_of_commands_may_have_the_units_that_logs_have():
    actuator = load("podusv:pod/vessels/otter.yaml", [f"actuator={{pods: {list(PODS)}}}"])
    pods = actuator.scenario.actuator
    names = ("n_2 [rps]", "t [ms]", "delta_1 [°]", "n_1 [rpm]")
    rows = ROWS[:, [2, 0, 3, 1]] * [1.0, 1e3, 180.0 / math.pi, 60.0]
    own = pods.commands(Recorded(text(), held=False))
    assert pods.commands(Recorded(text(names, rows), held=False)) == pytest.approx(own, rel=1e-14)


def test_what_is_wrong_with_commands_is_one_sentence_at_their_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write("task.yaml", TASK)

    def said(names, rows, *overrides):
        write("commands.csv", text(names, rows))
        (sentence,) = findings("task.yaml", *overrides)
        assert sentence.startswith("commands.csv: controller.rows: ")
        return sentence

    sound = [[0.0, 7.3, 5.1], [1.7, 3.9, 2.3]]
    assert "takes surge force and yaw moment; write columns t, tau_u, tau_r" in said(
        ["t", "n_1", "n_2"], sound, "actuator={kind: ideal}"
    )
    three = "columns that are not t [s], n_1 [1/s], n_2 [1/s]"
    assert three in said(["t", "n_1", "n_3"], sound)
    assert three in said(["t", "n_1 [knots]", "n_2 [rpm]"], sound)
    assert "every line must have 5" in said(["t", "n_1"], [[0.0, 1.3], [1.0, 2.1]])
    assert "its time is not after that of the line before" in said(
        ["t", "n_1", "n_2"], [sound[1], sound[0]]
    )
    assert "needs at least two lines" in said(["t", "n_1", "n_2"], sound[:1])
    write("commands.csv", text(["t", "n_1", "n_2"], sound))
    given = load("task.yaml").scenario
    Path("commands.csv").unlink()
    assert load_stored(resolved_yaml(given), "a.yaml").scenario == given


def test_commands_are_no_law_to_export():
    with pytest.raises(UsageError, match="gives recorded commands to propellers, which is no law"):
        ExportedLaw.of(podusv.load(scenario(), {"control.period": 0.1}))
