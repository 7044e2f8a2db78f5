"""Parameter files of autopilots: their numbers by name, as keys of podusv's laws.

Mission Planner and MAVProxy write `NAME,VALUE` or `NAME VALUE`, QGroundControl five columns with
vehicle, component, name, value and type. What parameters mean is as in the firmwares that the laws
name.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping

from podusv_cli.core.units import NUMBER

NAME = re.compile(r"[A-Z][A-Z0-9_]{1,31}")
OF_QGROUNDCONTROL = 5  # columns
MOST_LISTED = 24  # parameters that have no key, in a remark

Parameters = Mapping[str, float]
Keys = dict[str, float | str]


def parameters(text: str) -> dict[str, float]:
    """The parameters of a file's text by name. Raises ValueError for a line that is none.

    A name that comes twice must have the same number.
    """
    found: dict[str, float] = {}
    # Programs on Windows begin a text with a byte order mark
    for number, line in enumerate(text.removeprefix("\ufeff").splitlines(), 1):
        cells = _cells(line.partition("#")[0])
        if not cells:
            continue
        if len(cells) == OF_QGROUNDCONTROL:
            cells = cells[2:4]
        if len(cells) != 2 or not NAME.fullmatch(cells[0]) or not NUMBER.fullmatch(cells[1]):
            raise ValueError(f"line {number} has no name and number of a parameter")
        value = float(cells[1])
        if found.setdefault(cells[0], value) != value:
            raise ValueError(f"line {number} gives {cells[0]} a second time, and another number")
    return found


def _cells(line: str) -> list[str]:
    """The parts of a line between tabs, where it has one, else between commas, else blanks.

    So a decimal comma is no separator, and what has one is no number.
    """
    mark = next((mark for mark in ("\t", ",") if mark in line), None)
    return [cell.strip() for cell in line.split(mark)] if line.strip() else []


def untaken(given: Parameters, taken: set[str], groups: re.Pattern[str]) -> str:
    """Which parameters of these groups have no key, in words; "" where all have one."""
    names = [name for name in given if groups.match(name) and name not in taken]
    more = f" and {len(names) - MOST_LISTED} more" if len(names) > MOST_LISTED else ""
    return f"these parameters have no key: {', '.join(names[:MOST_LISTED])}{more}" if names else ""


ARDUPILOT = {  # parameter: key of the law, and what one of it is in the key's unit
    "ATC_SPEED_P": ("speed_P", 1.0),
    "ATC_SPEED_I": ("speed_I", 1.0),
    "ATC_STR_RAT_FF": ("rate_FF", 1.0),
    "ATC_STR_RAT_P": ("rate_P", 1.0),
    "ATC_STR_RAT_I": ("rate_I", 1.0),
    "ATC_STR_RAT_MAX": ("r_m", math.radians(1.0)),
    "PSC_POS_P": ("pos_P", 1.0),
    "PSC_VEL_P": ("vel_P", 1.0),
    "PSC_VEL_FF": ("vel_FF", 1.0),
    "NAVL1_PERIOD": ("l1_period", 1.0),
    "NAVL1_DAMPING": ("l1_damping", 1.0),
    "NAVL1_XTRACK_I": ("l1_I", 1.0),
    "WP_RADIUS": ("l1_least", 1.0),
}
OF_ARDUPILOT = re.compile(r"ATC_|PSC_|NAVL1_|CRUISE_|MOT_|WP_|TURN_|SERVO\d+_FUNCTION")
CRUISE = ("CRUISE_THROTTLE", "CRUISE_SPEED", "ATC_SPEED_FF")  # the throttle of a wanted speed
PX4 = {
    "RO_SPEED_P": ("speed_P", 1.0),
    "RO_SPEED_I": ("speed_I", 1.0),
    "RO_YAW_RATE_P": ("rate_P", 1.0),
    "RO_YAW_RATE_I": ("rate_I", 1.0),
    "RO_YAW_P": ("yaw_P", 1.0),
    "RO_SPEED_LIM": ("U", 1.0),
    "RO_YAW_RATE_LIM": ("r_m", math.radians(1.0)),
    "RO_YAW_RATE_TH": ("r_least", math.radians(1.0)),
    "RO_SPEED_TH": ("u_least", 1.0),
    "PP_LOOKAHD_GAIN": ("lookahead", 1.0),
    "PP_LOOKAHD_MIN": ("lookahead_min", 1.0),
    "PP_LOOKAHD_MAX": ("lookahead_max", 1.0),
    "RD_TRANS_DRV_TRN": ("stops_at", 1.0),
    "RD_TRANS_TRN_DRV": ("drives_at", 1.0),
}
LIMITS = ("r_m", "U")  # keys that are limits
OF_PX4 = re.compile(r"RO_|RD_|PP_")
FULL_SPEED, TRACK, CORRECTION = "RO_MAX_THR_SPEED", "RD_WHEEL_TRACK", "RO_YAW_RATE_CORR"


def of_ardupilot(text: str, beside: Collection[str]) -> tuple[Keys, list[str]]:
    """Keys of `ardupilot` that a parameter file gives, and remarks. Raises ValueError.

    `beside` are keys that the scenario itself gives. The throttle of a wanted speed is
    ATC_SPEED_FF + CRUISE_THROTTLE/(100 CRUISE_SPEED) (AR_AttitudeControl::get_throttle_out_speed).
    Limits of 0 mean none.
    """
    given = parameters(text)
    keys, taken, remarks = _direct(given, ARDUPILOT, beside)
    throttle, speed, feed = (given.get(name, 0.0) for name in CRUISE)
    if {*CRUISE} & given.keys() and (speed > 0.0 or feed > 0.0):
        keys["speed_FF"] = feed + (0.01 * throttle / speed if speed > 0.0 else 0.0)
        taken |= {*CRUISE}
    # Rover before 4.3 has L1 guidance and no position controller
    if "PSC_POS_P" not in given and "NAVL1_PERIOD" in given and "guidance" not in beside:
        keys["guidance"] = "l1"
        remarks.append("it has NAVL1_PERIOD and no PSC_POS_P, so guidance is l1")
    return _demand_keys(keys, given, taken, OF_ARDUPILOT, remarks)


def of_px4(text: str, beside: Collection[str]) -> tuple[Keys, list[str]]:
    """Keys of `px4` that a parameter file gives, and remarks. Raises ValueError.

    `beside` are keys that the scenario itself gives. The throttle of a wanted speed is
    1/RO_MAX_THR_SPEED, the steering of a wanted yaw rate
    RD_WHEEL_TRACK RO_YAW_RATE_CORR/(2 RO_MAX_THR_SPEED) (RoverControl.cpp). Limits of 0 mean none.
    """
    given = parameters(text)
    keys, taken, remarks = _direct(given, PX4, beside)
    if given.get(FULL_SPEED, 0.0) > 0.0:
        keys["speed_FF"] = 1.0 / given[FULL_SPEED]
        taken.add(FULL_SPEED)
        if TRACK in given:
            corrected = given[TRACK] * given.get(CORRECTION, 1.0)
            keys["rate_FF"] = corrected / (2.0 * given[FULL_SPEED])
            taken |= {TRACK, CORRECTION}
    return _demand_keys(keys, given, taken, OF_PX4, remarks)


def _direct(
    given: Parameters, table: Mapping[str, tuple[str, float]], beside: Collection[str]
) -> tuple[Keys, set[str], list[str]]:
    """Keys that are a parameter times a factor, as `table` says, what they took, and remarks.

    A limit of 0 or less is none for the firmware, and podusv's laws have one: this is said, but for
    keys `beside` that the scenario gives.
    """
    there = [name for name in table if name in given]
    none = [name for name in there if table[name][0] in LIMITS and given[name] <= 0.0]
    keys: Keys = {
        table[name][0]: given[name] * table[name][1] for name in there if name not in none
    }
    return (
        keys,
        {*there},
        [
            f"{name} sets no limit; podusv's own stands"
            for name in none
            if table[name][0] not in beside
        ],
    )


def _demand_keys(
    keys: Keys, given: Parameters, taken: set[str], groups: re.Pattern[str], remarks: list[str]
) -> tuple[Keys, list[str]]:
    """Keys and remarks, with one on what has no key. Raises ValueError where nothing is taken.

    `given` are the file's parameters, `taken` those that became keys; of `groups` the others are
    named.
    """
    if not keys:
        raise ValueError("has no parameter that this law has a key for")
    return keys, [*remarks, *filter(None, [untaken(given, taken, groups)])]
