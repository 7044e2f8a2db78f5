"""The columns of a log, and what each may be: by its name, its unit and its range."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from podusv_cli.components.actuators.base import Actuator
from podusv_cli.core.earth import PLACE
from podusv_cli.core.escaping import visible
from podusv_cli.core.kernel import Vector
from podusv_cli.core.phrases import quote_for_yaml
from podusv_cli.identify.logs.checks import FINER, SLOWEST
from podusv_cli.identify.logs.contents import Columns, Contents, LogFault, list_names
from podusv_cli.identify.logs.formats import contents_of
from podusv_cli.identify.logs.ranges import (
    PLACES,
    TO_PULSES,
    integers_of,
    like_pulses,
    on_earth,
    without_none,
)
from podusv_cli.identify.logs.reading import UNITS, clock_of, mark_new_values, split_unit
from podusv_cli.identify.logs.topics import TIME

SERVO = r"rcou\.c\d+|servo_output_raw\.servo\d+_raw"  # channels, of which many drive nothing
SIDES = "left|right|port|starboard|stbd"
# What the end of a column's name says of it, the likelier first; "_?" may be a blank, too. "#"
# stands for 1, 2, ... in the order of the log.
NAMES = {
    TIME: r"time|t|timestamp|time_?stamp|stamp|timeus|epoch|secs?|seconds|date_?time|zeit",
    "lat": r"lat|latitude|latitud|breite|breitengrad",
    "lon": r"lon|lng|long|longitude|longitud|"
    "länge|längengrad|laenge|laengengrad",
    "x": r"x|north|northing|pos_?n|pn|position\.x",
    "y": r"y|east|easting|pos_?e|pe|position\.y",
    "psi": r"psi|hdt\.heading|att\.yaw|attitude\.yaw|heading|hdg|compass|yaw|kompass|steuerkurs",
    "u": r"u|surge|linear\.x|speed_?x|vx",
    "v": r"v|sway|linear\.y|speed_?y|vy",
    "r": r"r|yaw_?rate|yawspeed|rate_?of_?turn|rot|angular\.z|angular_velocity\.z|gyro_?z|gyrz"
    r"|xyz\[2\]",
    "n_#": rf"n_?\d|(?<![./ _])(n_?)?({SIDES})|.*rpm.*|.*rps.*|"
    rf".*propeller.*|.*motor.*|.*esc.*speed.*|{SERVO}",
    "delta_#": r"delta_?\d|rsa_starboard|.*rudder.*|.*azimuth.*|.*steer.*|.*pod_?angle.*",
    "tau_u": r"tau_u|surge_?force|force\.x",
    "tau_v": r"tau_v|sway_?force|force\.y",
    "tau_r": r"tau_r|yaw_?moment|torque\.z",
}
# Columns that are none of these, whatever their last word: clocks of messages, what is wanted,
# where a plane touches the earth, satellites, how uncertain a value is, which engine it is, a
# course in hundredths of a degree (MAVLink's hdg, beside which ATTITUDE has a yaw).
NEVER = re.compile(
    r"^(cmd|orgn|rall|fnce|home|mission|wpl|gsv)[._]|satellite|timestamp|_flags$|position_int\.hdg"
    r"|\.time$|setpoint|(^|[._ ])(ref|reset|manual|input|target|desired)_|covariance|variance"
    r"|(^|[._ ])(std|eph|epv|evh|evv)|engine_no"
    # Tests, faults and limits; accelerations; which satellites are used; a wind's filter; others.
    r"|innov|test_ratio|^test_motor|fail|saturation|_mask$|_limits\.|accel|^gps(_\d)?\.u$"
    r"|^(airspeed_autocal|transponder|adsb|ais|follow_|landing_)|^(sensor|vehicle)_(gyro|mag|magnetometer|imu|baro|air_data)"
)
# Messages that are taken where no other has the quantity: single filters and sensors, a simulator.
SECOND = re.compile(r"^(estimator_|sensor_|ahr2|ahrs2|sim\d*[._]|simstate)")
PARTS = "n_part_cmd_#"  # speeds that are asked for in parts of full speed
FULL = 1.001  # largest of these
PERCENT = 100.0  # largest of these in percent
DRIVES = {"n_#", PARTS, "delta_#", "tau_u", "tau_v", "tau_r"}  # what an actuator does
# Of each of these a log needs one, the first where nothing is known.
DRIVEN = ("n_1", "n_part_cmd_1", "delta_1", "tau_u")
NEEDED = ((TIME,), ("x", "lat"), ("y", "lon"), ("psi",), DRIVEN)
FORMS = ("^({})$", "([./ ]|_(?=...))({})$")  # the whole name, or its last part
# Of quantities the unit that the end of a name means, and that which a range means that begins so.
ENDINGS = {
    "deg_s": "deg/s",
    "degs": "deg/s",
    "dps": "deg/s",
    "deg": "deg",
    "rad": "",
    "kn": "kn",
    "kts": "kn",
    "knots": "kn",
    "kmh": "km/h",
    "rpm": "rpm",
    "ms": "ms",
    "us": "us",
    "ns": "ns",
    "timeus": "us",
}
BEYOND = {
    "psi": ((7.0, "deg"),),
    "r": ((4.0, "deg/s"),),
    "n_#": ((100.0, "rpm"),),
    "delta_#": ((3.2, "deg"),),
}


@dataclass(frozen=True)
class Listed:
    """A column: new values a second, their range, the share that is missing, and what it may be."""

    name: str
    rate: float
    least: float
    most: float
    missing: float
    quantity: str = ""
    unit: str = ""

    @property
    def guess(self) -> str:
        """As in a table."""
        return f"{self.quantity} [{self.unit}]" if self.unit else self.quantity

    @property
    def cells(self) -> tuple[str, ...]:
        """The column as a row of a table under `Listing.HEAD`; "-" where there is no number."""
        numbers = (f"{self.rate:.4g}", f"{self.least:.5g}", f"{self.most:.5g}")
        shown = (text.replace("nan", "-") for text in numbers)
        return self.name, *shown, f"{self.missing:.1%}", self.guess


@dataclass(frozen=True)
class Listing:
    """All columns of a log, and what is doubtful about the file."""

    HEAD: ClassVar = ("column", "new values a second", "least", "most", "missing", "may be")

    columns: list[Listed]
    turned: bool  # whether headings are those of quaternions, which ROS counts from the east
    warnings: tuple[str, ...] = ()

    def as_json(self) -> dict[str, Any]:
        """What `--json` prints."""
        return {
            "format": 1,
            "columns": [asdict(own) for own in self.columns],
            "mapping": self.mapping(),
            "warnings": list(self.warnings),
        }

    def mapping(self) -> list[str]:
        """Lines to write under `identify`; comments say what could not be guessed."""
        lines = ["columns:"]
        for own in self.columns:
            if own.quantity:
                unit = f" [{own.unit}]" if own.unit else ""
                lines.append(f"  {own.quantity}: {quote_for_yaml(split_unit(own.name)[0] + unit)}")
        known = {own.quantity for own in self.columns}
        clocks = {own.name for own in self.columns}
        if all(clock_of(own.name, clocks) for own in self.columns if own.quantity):
            known |= {TIME}  # every message has its own
        lacking = [names[0] for names in NEEDED if not known & {*names}]
        lines += [f"  # {name}: ?   (not guessed; see podusv docs identify)" for name in lacking]
        if any(own.unit == "us" and own.quantity.startswith("n_part") for own in self.columns):
            lines.append(f"  # [us] needs {TO_PULSES} in each of actuator.pods")
        left = [visible(own.name) for own in self.columns if not own.quantity]
        if left:
            lines.append(f"  # columns not guessed: {list_names(left)}")
        if self.turned:
            lines.append("frame: enu  # ROS counts x to the east, y to the north, turns to port")
        return lines


def listing(path: Path) -> Listing:
    """The columns of a log. Raises LogFault, StorageError."""
    return list_contents(contents_of(path), path.name)


def list_contents(contents: Contents, name: str, actuator: Actuator | None = None) -> Listing:
    """The columns of what a file called `name` holds.

    What they may be is for a boat with this actuator, where it is given.
    """
    columns = contents.columns
    guesses = dict(_guesses(columns))
    if actuator:
        guesses = dict(_of_boat(guesses, columns, actuator))
    doubts = [f"{name!r} {doubt}" for name, doubt in contents.doubts.items() if name in guesses]
    for column, reason in _no_places(columns, guesses):
        doubts.append(f"{column!r} is not taken for {guesses.pop(column)}: {reason}")
    for column, reason in _no_clocks(contents):
        doubts.append(f"{column!r} is not taken for {TIME}: it {reason}")
    return Listing(
        [_list_column(own, columns, guesses) for own in columns],
        any(own.endswith("orientation.yaw") for own in guesses),
        tuple(f"{name}: {line}." for line in (*contents.warnings, *doubts)),
    )


def _of_boat(
    guesses: dict[str, str], columns: Columns, actuator: Actuator
) -> Iterator[tuple[str, str]]:
    """The guesses that this actuator takes, as many of each as it has.

    Where it counts in parts, numbers up to 100 are percents.
    """
    fixed = {name for name in actuator.zero_where_missing if name != _hide_number(name)}
    signals = (*actuator.replayed, *actuator.lagged)
    known = Counter(_hide_number(s.name) for s in signals if s.name not in fixed)
    taken = Counter[str]()
    for column, guess in guesses.items():
        most = float(np.nanmax(np.abs(columns[column]), initial=0.0))
        if guess == "n_#" and known[PARTS] and "rp" not in _plain(column) and most <= PERCENT:
            guess = PARTS
        if guess not in DRIVES or taken[guess] < known[guess]:
            taken[guess] += 1
            yield column, guess


def _hide_number(name: str) -> str:
    """`n_part_cmd_2` as all of its kind: `n_part_cmd_#`."""
    return re.sub(r"\d+$", "#", name)


def _places(guesses: dict[str, str]) -> dict[str, str]:
    """The columns of latitude and longitude, by quantity."""
    return {guess: column for column, guess in guesses.items() if guess in PLACES}


def _no_places(columns: Columns, guesses: dict[str, str]) -> list[tuple[str, str]]:
    """Columns that are called so and have no places on earth in degrees, and why."""
    found = []
    for signal in PLACE:
        column = _places(guesses).get(signal.name)
        if column is None or _unit(column, columns, guesses):
            continue
        try:
            on_earth(signal, without_none(columns[column])[0])
        except LogFault as fault:
            found.append((column, str(fault)))
    return found


def _no_clocks(contents: Contents) -> Iterator[tuple[str, str]]:
    """Columns that are called as a clock is and have no number, and what they have."""
    for column, values in contents.columns.items():
        if re.fullmatch(_pattern(TIME), _plain(column)) and not np.isfinite(values).any():
            yield column, contents.doubts.get(column, "has no number")


def _list_column(name: str, columns: Columns, guesses: dict[str, str]) -> Listed:
    """What a column has, and which quantity it may be."""
    values, quantity = columns[name], guesses.get(name, "")
    known = values[np.isfinite(values)]
    ends = (float(known.min()), float(known.max())) if len(known) else (np.nan, np.nan)
    seconds = _duration(name, columns, guesses)
    rate = float(np.sum(mark_new_values(values))) / seconds if seconds > 0.0 else np.nan
    unit = _unit(name, columns, guesses) if quantity else ""
    missing = 1.0 - len(known) / max(len(values), 1)
    return Listed(name, rate, *ends, missing, _number_name(quantity, name, guesses), unit)


def _number_name(quantity: str, name: str, guesses: dict[str, str]) -> str:
    """`n_2` for the second of several."""
    alike = [column for column, guess in guesses.items() if guess == quantity]
    return quantity.replace("#", str(alike.index(name) + 1)) if quantity else ""


def _guesses(columns: Columns) -> Iterator[tuple[str, str]]:
    """Columns and what they are, each quantity once but those that are numbered."""
    taken: set[str] = set()
    ranked = sorted(columns, key=lambda column: bool(SECOND.match(column.lower())))
    for quantity in NAMES:
        pattern = _pattern(quantity)
        numbered = "#" in quantity
        likely = [pattern] if numbered else pattern.split("|")
        for form in [form.format(name) for form in FORMS for name in likely]:
            for column in ranked:
                free = column not in taken and (numbered or quantity not in taken)
                may_be = _may_be_clock if quantity == TIME else _may_be
                if free and re.search(form, _plain(column)) and may_be(column, columns):
                    taken |= {column, quantity}
                    parts = quantity == "n_#" and _in_parts(column, columns)
                    yield column, PARTS if parts else quantity


def _may_be(column: str, columns: Columns) -> bool:
    """Whether a column can be a quantity; velocities beside positions are those of the earth."""
    plain = _plain(column)
    if NEVER.search(column.lower()) or NEVER.search(plain):
        return False
    if not np.isfinite(columns[column]).any():
        return False
    if re.search(SERVO, column.lower()):
        return like_pulses(columns[column]) and float(np.nanmin(columns[column])) < float(
            np.nanmax(columns[column])
        )
    beside = plain.removesuffix("vx").removesuffix("vy")
    if beside == plain:
        return True
    known = {*map(_plain, columns)}
    on_earth = ({f"{beside}x", f"{beside}y"}, {f"{beside}lat", f"{beside}lon"})
    return not any(places <= known for places in on_earth)


def _in_parts(column: str, columns: Columns) -> bool:
    """Whether a propeller's numbers are percents, pulses, or from full astern to full ahead."""
    values = columns[column]
    if _in_pulses(column, values):
        return True
    most = float(np.nanmax(np.abs(values), initial=0.0))
    return split_unit(column)[1] == "%" or ("rp" not in _plain(column) and 0.0 < most <= FULL)


def _in_pulses(column: str, values: Vector) -> bool:
    """Whether a propeller's numbers are pulses [us], by unit or by size."""
    unit, most = split_unit(column)[1], float(np.nanmax(np.abs(values), initial=0.0))
    return unit == "us" or (
        not unit and "rp" not in _plain(column) and most > 100.0 and like_pulses(values)
    )


def _pattern(quantity: str) -> str:
    return NAMES[quantity].replace("_?", "[_ ]?")


def _may_be_clock(column: str, columns: Columns) -> bool:
    """Whether a column can have the times of a whole file: numbers, and no message's own times."""
    return clock_of(column, columns) is None and bool(np.isfinite(columns[column]).any())


@lru_cache(maxsize=10_000)  # a log of PX4 has a thousand names, each asked for dozens of times
def _plain(column: str) -> str:
    """A name in small letters, without its unit, but that of a propeller's speed."""
    own, unit = split_unit(column)
    if unit == "rpm":
        own = f"{own} rpm"
    name = own.lower().replace("-", "_").removesuffix("_")
    ending = next((e for e in ENDINGS if name.endswith(f"_{e}")), "")
    return name.removesuffix(f"_{ending}") if ending else name


def _unit(name: str, columns: Columns, guesses: dict[str, str]) -> str:
    """Of a column: in brackets, at the end of its name, or by its range."""
    quantity, (own, unit) = guesses[name], split_unit(name)
    values, _ = without_none(columns[name])
    most = float(np.nanmax(np.abs(values), initial=0.0))
    if unit:
        return unit
    if quantity == PARTS:
        return "us" if _in_pulses(name, columns[name]) else "%" if most > FULL else ""
    ending = next((e for e in ENDINGS if re.search(rf"(^|[._]){e}$", own.lower())), None)
    if ending is not None:
        return ENDINGS[ending]
    if quantity == TIME:
        steps = np.diff(values[np.isfinite(values)])
        step = float(np.median(steps)) if len(steps) else 0.0
        return next((u for u, f in {"": 1.0, **FINER}.items() if step * f < SLOWEST), "")
    places = _places(guesses)
    if quantity in PLACES and places.keys() == PLACES.keys():
        lat, lon = (without_none(columns[places[place]])[0] for place in PLACES)
        return "1e-7 deg" if integers_of(lat, lon) else ""
    return next((unit for least, unit in BEYOND.get(quantity, ()) if most > least), "")


def _duration(name: str, columns: Columns, guesses: dict[str, str]) -> float:
    """Of the values of a column [s]; NaN where nobody knows."""
    own = clock_of(name, columns)
    clock = own or next((column for column, guess in guesses.items() if guess == TIME), None)
    if clock is None or not np.isfinite(columns[clock]).any():
        return np.nan
    unit = "" if own else _unit(clock, columns, guesses)
    return float(np.nanmax(columns[clock]) - np.nanmin(columns[clock])) * UNITS["s"].get(unit, 1.0)
