"""Units that people write in place of podusv's own, and numbers that are written with one."""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Mapping
from fractions import Fraction
from typing import NamedTuple

from podusv_cli.core.phrases import did_you_mean

# A number as scenarios and files write it; Python takes 1_0 and digits of other scripts, too.
NUMBER = re.compile(r"[-+]?(\.[0-9]+|(0|[1-9][0-9]*)(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
PI = Fraction(math.pi)
LARGEST = Fraction(sys.float_info.max)
PURE = "1"  # stands for no unit
# Of each of podusv's units, those that may stand in its place, and what one of them is in it.
# They are exact: 57 cm are 0.57 m, and 180 deg are math.pi to the last digit.
UNITS: dict[str, dict[str, Fraction]] = {
    "s": {
        "ms": Fraction(1, 10**3),
        "us": Fraction(1, 10**6),
        "ns": Fraction(1, 10**9),
        "min": Fraction(60),
        "h": Fraction(3600),
    },
    "m": {
        "mm": Fraction(1, 1000),
        "cm": Fraction(1, 100),
        "km": Fraction(1000),
        "ft": Fraction(3048, 10000),
        "nmi": Fraction(1852),
    },
    "m2": {"cm2": Fraction(1, 10**4), "ft2": Fraction(3048, 10000) ** 2},
    "rad": {"deg": PI / 180, "mrad": Fraction(1, 1000)},
    "m/s": {
        "cm/s": Fraction(1, 100),
        "mm/s": Fraction(1, 1000),
        "ft/s": Fraction(3048, 10000),
        "km/h": Fraction(1000, 3600),
        "kn": Fraction(1852, 3600),
        "mph": Fraction(1609344, 3600 * 10**3),
    },
    "m/s2": {"cm/s2": Fraction(1, 100)},
    "rad/s": {"deg/s": PI / 180},
    "kg": {"g": Fraction(1, 1000), "t": Fraction(1000), "lb": Fraction(45359237, 10**8)},
    "kg/m3": {"g/cm3": Fraction(1000)},
    "N": {
        "kN": Fraction(1000),
        "kgf": Fraction(980665, 10**5),
        "lbf": Fraction(45359237 * 980665, 10**13),
    },
    "N m": {"kN m": Fraction(1000)},
    # Of a propeller's speed; rad/s is left out, since a gain in 1/s is no speed.
    "1/s": {"rpm": Fraction(1, 60)},
    "1/s2": {"rpm/s": Fraction(1, 60)},
    "Hz": {"mHz": Fraction(1, 1000)},
    PURE: {"%": Fraction(1, 100)},
}
SPELLINGS = {
    "degree": "deg",
    "degrees": "deg",
    "dps": "deg/s",
    "kt": "kn",
    "kts": "kn",
    "knot": "kn",
    "knots": "kn",
    "kmh": "km/h",
    "kph": "km/h",
    "sec": "s",
    "second": "s",
    "seconds": "s",
    "minute": "min",
    "minutes": "min",
    "hr": "h",
    "hour": "h",
    "hours": "h",
    "Nm": "N m",
    "kNm": "kN m",
    "rev/min": "rpm",
    "rps": "1/s",
    "1/min": "rpm",
    "metre": "m",
    "metres": "m",
    "mi/h": "mph",
}
SIGNS = str.maketrans({"°": "deg", "º": "deg", "·": " ", "*": " ", "^": "", "²": "2", "³": "3"})


class Scale(NamedTuple):
    """A unit that has its zero elsewhere: `zero` is 0 of podusv's, and one more is `factor`."""

    zero: float
    factor: float


Scales = Mapping[str, Mapping[str, Scale]]  # by signal, then by unit
WITH_UNIT = re.compile(rf"({NUMBER.pattern})(?:\s*(?=[^\W\d_]|[°º%])|\s+(?=1/))(\S.*)")


def units_allowed_for(unit: str) -> dict[str, Fraction]:
    """What may be written where podusv has `unit`, its own first, and what one of each is in it.

    A unit may be several, as "m or m/s" is.
    """
    own = unit.split(" or ") if unit else [PURE]
    return {name: f for one in own for name, f in ({one: Fraction(1)} | UNITS.get(one, {})).items()}


def spell_unit(unit: str) -> str:
    """A unit as the table has it: `deg` for `°`, `kn` for `knots`, `N m` for `Nm`."""
    plain = " ".join(unit.translate(SIGNS).split())
    return SPELLINGS.get(plain, plain)


def split_quantity(text: str) -> tuple[str, str] | None:
    """Number and unit of "45 deg", "45deg" or "45°"; None for any other text."""
    match = WITH_UNIT.fullmatch(text.strip())
    return (match[1], match[match.lastindex or 0].strip()) if match else None


def number(text: str, unit: str) -> int | float | None:
    """A number with a unit in podusv's `unit`, rounded once; None where the unit does not fit.

    A whole number in the own unit stays one, since a count may be wanted.
    """
    parts = split_quantity(text)
    factor = units_allowed_for(unit).get(spell_unit(parts[1])) if parts else None
    if parts is None or factor is None or not math.isfinite(float(parts[0])):
        return None
    own = Fraction(repr(float(parts[0]))) * factor  # its text may have an exponent of any size
    if abs(own) > LARGEST:
        return None
    return int(parts[0]) if factor == 1 and parts[0].lstrip("+-").isdigit() else float(own)


def pattern(unit: str) -> str:
    """A regular expression of JSON schemas that a number with a fitting unit matches.

    With all spellings, and signs that the table has not.
    """
    ways = [way for way in units_allowed_for(unit) if way != PURE]
    ways += [other for other, way in SPELLINGS.items() if way in ways]
    ways += [sign for sign, way in (("°", "deg"), ("°/s", "deg/s")) if way in ways]
    words = "|".join(re.sub(r"[().^*]", r"\\\g<0>", way) for way in ways)
    return rf"^\s*{NUMBER.pattern}\s*({words})\s*$"


def misfit(text: str, unit: str) -> str:
    """Why a number with a unit is none in podusv's `unit`, and what would be; "" where it fits.

    Also empty for a text that is no number with a unit.
    """
    parts = split_quantity(text)
    if parts is None or number(text, unit) is not None:
        return ""
    units = units_allowed_for(unit)
    if spell_unit(parts[1]) in units or not math.isfinite(float(parts[0])):
        return "; it is too large, numbers must be finite"
    if list(units) == [PURE, "%"]:
        return f"; it has no unit here: write {parts[0]}"
    meant = did_you_mean(spell_unit(parts[1]), units)
    return f"; {parts[1]} does not fit{meant} (units here: {', '.join(units)})"
