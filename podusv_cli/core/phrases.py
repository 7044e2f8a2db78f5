"""Parts of messages: what was found, what was probably meant, how to write it instead."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable
from difflib import get_close_matches
from typing import Any

MOST, NEAREST = 12, 5  # words that a message lists; of more than that, so many
MOST_LINES = 3  # of a text that is shown as it is
LONGEST_WORD = 400  # characters that are shown as they are
# A name with an ending or in a folder: YAML takes it for no number and no word such as null.
PLAIN_PATH = re.compile(r"(\.\./)*[A-Za-z_][\w-]*[./][\w./-]*", re.ASCII)


def quote(text: str) -> str:
    """The text in quotes on one line, cut where it is long."""
    return repr(text if len(text) <= 60 else text[:57] + "...")


def describe_found(content: Any, text: str) -> str:
    """A value as its writer would recognise it, for a message; `text` is a scalar as written."""
    if isinstance(content, dict):
        return "a mapping of keys" if content else "an empty mapping"
    if isinstance(content, tuple):
        return f"a list of {len(content)}"
    if isinstance(content, str):
        return quote(content)
    return f"{text:.60}" or "nothing"


def as_yaml(content: Any) -> str:
    """A plain value as it would stand in a scenario, cut where it is long."""
    text = content if isinstance(content, str) and content else json.dumps(content)
    return quote(text) if len(text) > 60 or not text.isprintable() else text


def quote_for_yaml(text: str) -> str:
    """Text as YAML has it between double quotes, on one line."""
    marks = {'"': r"\"", "\\": r"\\"}
    shown = (marks.get(c, c if c.isprintable() else rf"\U{ord(c):08x}") for c in text)
    return f'"{"".join(shown)}"'


def path_for_yaml(path: str) -> str:
    """A path as YAML has it: plain where nothing in it has another meaning there, else quoted."""
    return path if PLAIN_PATH.fullmatch(path) else quote_for_yaml(path)


def value_text(value: Any) -> str:
    """A value of a scenario as text, with all digits; a dash for None, a count for many lines.

    Of a long word, such as the weights of a policy, the length and the end.
    """
    if isinstance(value, (list, tuple)):
        return " ".join(map(value_text, value))
    if isinstance(value, str) and value.count("\n") > MOST_LINES:
        return f"{len(value.splitlines()):,} lines"
    if isinstance(value, str) and len(value) > LONGEST_WORD and not set(value) & {" ", "\n"}:
        return f"{len(value):,} characters that end in {value[-8:]}"
    if value is None:
        return "-"
    text = f"{value:g}" if isinstance(value, float) else str(value)
    return text if not isinstance(value, float) or float(text) == value else repr(value)


def without_case(word: str) -> str:
    """A word without what is easily typed otherwise: case and underscores."""
    return word.casefold().replace("_", "")


# Words that others use, and the keys that podusv has for them.
SYNONYMS = {
    "gnss": "position",
    "gps": "position",
    "compass": "heading",
    "gyro": "yaw_rate",
    "speed_log": "velocity",
    "rate": "period",
    "frequency": "period",
}


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """`; did you mean 'length'?`, or nothing where no known word is close.

    A word with other case or underscores first, then a synonym, then one that is spelt alike.
    """
    words = list(known)
    alike = [other for other in words if without_case(other) == without_case(word)]
    meant = [other for other in words if other == SYNONYMS.get(word.casefold())]
    close = alike or meant or get_close_matches(word, words, n=1)
    return f"; did you mean '{close[0]}'?" if close else ""


def unknown_word(what: str, word: str, known: Iterable[str], listed: str = "") -> str:
    """`unknown key; did you mean 'length'? (allowed: ...)`; `what` is the kind of word.

    Of many words the nearest, if there is a command (`listed`) that lists all of them.
    """
    words = list(known)
    allowed = ", ".join(words)
    if listed and len(words) > MOST:
        near = get_close_matches(word, words, n=NEAREST, cutoff=0.0)
        allowed = f"{', '.join(near)} and {len(words) - len(near)} more, see {listed}"
    return f"unknown {what}{did_you_mean(word, words)} (allowed: {allowed})"


# Text that looks like a value of another type, and how to write that value.
NUMBER_HINTS = (
    (r"[-+]?0\d+(\.\d*)?", "numbers have no leading zeros"),
    (r"[-+]?[\d.]+([eE][-+]?\d+)?", "leave out the quotes"),
    (r"[-+]?\d+(:\d+)+", "write the number out, colons are not read as minutes"),
    (r"[-+]?\d+,\d+(\s*\D.*)?", "write a decimal point"),
    (r"[-+]?\d[\d_]*(\.\d*)?", "leave out the underscores"),
    (r"0[xob][\da-fA-F]+", "write it in decimal"),
    (r"[-+]?\.?(nan|inf|infinity)", "numbers must be finite"),
)
HINTS: dict[type, tuple[tuple[str, str], ...]] = {
    float: NUMBER_HINTS,
    int: NUMBER_HINTS,
    bool: (("yes|on|y|true|1", "write true"), ("no|off|n|false|0", "write false")),
    tuple: (("[^,]+(,[^,]+)+", "write a list as [1, 2, 3]"),),
}


def hint(text: str, types: Iterable[type]) -> str:
    """`; leave out the quotes`, or nothing where the text looks like none of the types.

    `text` is what was written, `types` those of which one was wanted. The first form that fits
    counts.
    """
    hints = (hint for kind, hints in HINTS.items() if kind in types for hint in hints)
    fitting = (advice for form, advice in hints if re.fullmatch(form, text.strip(), re.IGNORECASE))
    advice = next(fitting, "")
    return f"; {advice}" if advice else ""
