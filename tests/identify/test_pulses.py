"""Pulses of PWM as commands, in logs and schedules."""

from __future__ import annotations

import numpy as np
import pytest

import podusv
from podusv_cli.core.signal import STATE, Signal
from podusv_cli.identify.logs.checks import check_log
from podusv_cli.identify.logs.commands import with_actuator_state
from podusv_cli.identify.logs.contents import LogFault
from podusv_cli.identify.logs.reading import NamedQuantities, table
from podusv_cli.scenario.load import load_text

PWM_BOAT = """
name: pwm
vessel: {preset: otter}
path: {kind: line, speed: 0.0}
disturbance: {kind: none}
controller: {kind: pid}
actuator:
  kind: pod
  counts: parts
  pods:
    - {x: 0, y: -0.395, TABLE, pwm: {span: SPAN}}
    - {x: 0, y: 0.395, TABLE, pwm: {span: SPAN}}
simulation: {duration: 10.0}
identify:
  logs: [{file: log.csv}]
  columns: {n_part_cmd_1: COLUMN}
""".replace("TABLE", "table: [[-1, -66], [0, 0], [1, 119]], n_rate: 10, n_lag: 0.1, angle_limit: 0")


def pulses_log(folder, span, column, pulses):
    """The table of a log whose column `left` has these pulses, as `identify` takes it."""
    boat = PWM_BOAT.replace("SPAN", f"{span}").replace("COLUMN", f'"{column}"')
    rows = [f"{0.1 * i:g},{0.05 * i:g},0,0,{us:g},1500" for i, us in enumerate(pulses)]
    (folder / "log.csv").write_text(
        "time,x,y,psi,left,n_part_cmd_2 [us]\n" + "\n".join([*rows, ""])
    )
    scenario = load_text(boat, str(folder / "boat.yaml")).scenario
    named = NamedQuantities(scenario.identify.columns, scales=scenario.actuator.scales)
    wanted = (*STATE, *scenario.actuator.lagged)
    return table(folder / "log.csv", wanted, named)


@pytest.mark.parametrize(("span", "column"), [(400, "left [us]"), (-400, "-left [us]")])
def test_pulses_become_parts_of_full_speed(tmp_path, span, column):
    """(1700 - 1500)/400; none is rest, and 65535 of a channel that is not driven is no number."""
    read = pulses_log(tmp_path, span, column, [1500, 1700, 1900, 1100, 0, 65535, 1300])
    assert read.columns["n_part_cmd_1"] == pytest.approx(
        [0.0, 0.5, 1.0, -1.0, 0.0, np.nan, -0.5], nan_ok=True
    )
    assert read.columns["n_part_cmd_2"] == pytest.approx([0.0] * 7)
    assert "is 0 us once, which is no pulse and taken for rest" in read.warnings[0]
    assert "out of range once: 65535 us" in read.warnings[0]


def test_pulses_without_pwm_or_unit_are_told(tmp_path):
    with pytest.raises(LogFault, match=r"pulses of PWM need pwm: \{rest: 1500, span: 400\}"):
        table(
            pulses_log_file(tmp_path),
            (*STATE, Signal("n_part_cmd_1", "1", "")),
            NamedQuantities({"n_part_cmd_1": "left [us]"}),
        )
    for column in ("left", "left [%]"):
        read = pulses_log(tmp_path, 400, column, [1500, 1700, 1900, 1100, 1300] * 8)
        actuator = load_text(PWM_BOAT.replace("SPAN", "400"), "boat.yaml").scenario.actuator
        with pytest.raises(LogFault, match=r"pulses of PWM are written as \[us\]"):
            check_log(with_actuator_state(read, actuator), actuator, 2.0)


def pulses_log_file(folder):
    pulses_log(folder, 400, "left [us]", [1500, 1700, 1900])
    return folder / "log.csv"


def test_a_schedule_takes_pulses(tmp_path):
    (tmp_path / "c.csv").write_text("t,n_part_1 [us],n_part_2 [us]\n0,1700,1300\n10,1700,1300\n")
    text = PWM_BOAT.replace("SPAN", "400").replace("{kind: pid}", "{kind: schedule, file: c.csv}")
    (tmp_path / "boat.yaml").write_text(text)
    run = podusv.simulate(tmp_path / "boat.yaml", {"identify": None})
    assert run["n_part"][-1] == pytest.approx([0.5, -0.5], abs=1e-6)
