"""Amounts of data and time in words; units and symbols as formulas and as text."""

from __future__ import annotations

import re
from html.entities import html5

BYTES = {"bytes": 1.0, "kB": 1e3, "MB": 1e6, "GB": 1e9, "TB": 1e12, "PB": 1e15}
RAISED = str.maketrans("0123456789-−", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻⁻")
ACCENTS = {"hat": "\N{COMBINING CIRCUMFLEX ACCENT}", "dot": "\N{COMBINING DOT ABOVE}", "mathrm": ""}
BELOW = re.compile(r"_(\{(?:[^{}]|\{[^{}]*\})*\}|[^{])")  # what stands below the line in a symbol
TIMES = {"s": 1.0, "min": 60.0, "h": 3600.0, "days": 86400.0, "years": 31557600.0}


def bytes_in_words(count: float) -> str:
    """A number of bytes such as `3.2 GB`."""
    return _in_words(count, BYTES)


def time_in_words(seconds: float) -> str:
    """A time [s] such as `1.4 min`."""
    return _in_words(seconds, TIMES)


def raise_powers(unit: str) -> str:
    """A unit with its powers raised, as LaTeX and matplotlib read it: `m$^2$ s` for `m2 s`."""
    return re.sub(r"(?<=[A-Za-z])(\d)", r"$^\1$", unit)


def letters_of_symbol(symbol: str) -> list[tuple[str, str]]:
    """The symbol of a signal (LaTeX) as text: pairs of what stands on the line and below it.

    Commands become letters, accents combining marks behind their letter, powers raised digits.
    """
    plain = re.sub(
        r"\\([A-Za-z]+) ?", lambda m: ACCENTS.get(m[1], html5.get(f"{m[1]};", m[1])), symbol
    )
    plain = re.sub(r"(.*?)([\u0302\u0307])(.)", r"\1\3\2", plain)
    plain = re.sub(r"\^(.)", lambda m: m[1].translate(RAISED), plain)
    parts = [re.sub("[{}_]", "", part) for part in BELOW.split(plain)]
    return [pair for pair in zip(parts[::2], [*parts[1::2], ""], strict=True) if any(pair)]


def exponent(formula: str) -> str:
    """A number that matplotlib set as a formula, as plain text: `2×10⁻³`."""
    plain = re.sub(r"\\mathdefault\{((?:[^{}]|\{[^}]*\})*)\}|\$", r"\1", formula)
    plain = plain.replace(r"\times", "×")
    return re.sub(r"\^\{([^}]*)\}", lambda power: power[1].translate(RAISED), plain)


def _in_words(amount: float, units: dict[str, float]) -> str:
    """An amount in the largest of these units that it reaches; their sizes rise."""
    fitting = [unit for unit, size in units.items() if amount >= size] or [next(iter(units))]
    digits = f"{amount / units[fitting[-1]]:.2g}"
    return f"{float(digits):g} {fitting[-1]}"
