"""Text of users, as it goes to a terminal or into a file: shown, never obeyed.

Folder names, descriptions, claims and arguments may hold anything. One function a format.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable

# Also * and _ at an end of a word, and ] where a link's target follows.
MARKDOWN = re.compile(r"[\\`<>&]|(?<!\s)\*|\*(?!\s)|(?<![^\W_])_|_(?![^\W_])|\](?=[(\[])")
LATEX = str.maketrans(
    {sign: rf"\{sign}" for sign in "_%&#${}"}
    | {"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}"}
)
# What a spreadsheet takes for the beginning of a formula, in the wide forms of East Asia, too.
FORMULA = tuple("=+-@\uff1d\uff0b\uff0d\uff20")


def visible(text: object) -> str:
    r"""The text on one line; what would move a cursor or turn letters around, as `\x1b`."""
    return _spelt(str(text), _entity_name)


def markdown(text: str) -> str:
    """Text in one line that is nothing but text, inside a paragraph."""
    return MARKDOWN.sub(r"\\\g<0>", visible(" ".join(text.split())))


def markdown_cell(text: str) -> str:
    """Text in one line in a cell of a table: as `markdown`, and no | ends the cell."""
    return markdown(text).replace("|", "\\|")


def markdown_code(text: str) -> str:
    """A cell in the type of code; there, nothing but the end of the cell is escaped."""
    one_line = visible(" ".join(text.split()))
    return "`" + one_line.replace("`", "'").replace("|", "\\|") + "`"


def csv(text: str) -> str:
    """A cell, before a CSV writer quotes it; a formula begins with ', so that it is none."""
    shown = visible(text)
    return f"'{shown}" if shown.startswith(FORMULA) else shown


def latex(text: str) -> str:
    """Text in one line that is nothing but text in LaTeX, outside of formulas."""
    return visible(text).translate(LATEX)


def figure(text: str) -> str:
    """Text of a figure: $ begins no formula, and _ ahead hides it from no legend."""
    shown = visible(text).replace("$", r"\$")
    return f" {shown}" if shown.startswith("_") else shown


def lines(text: object) -> str:
    """Text with its line breaks, before a template engine escapes markup."""
    return "\n".join(map(visible, str(text).split("\n")))


def json(encoded: str) -> str:
    """Encoded JSON; letters that do not show, which only strings can hold, as JSON escapes them."""
    return "\n".join(_spelt(line, _json_named) for line in encoded.split("\n"))


def _spelt(text: str, name: Callable[[str], str]) -> str:
    """The text, each letter that does not show by its name."""
    return text if text.isprintable() else "".join(c if _shows(c) else name(c) for c in text)


def _shows(letter: str) -> bool:
    """Whether a letter is seen by a reader, as itself or as a space."""
    return letter.isprintable() or unicodedata.category(letter) == "Zs"  # spaces of any width


def _entity_name(letter: str) -> str:
    r"""A letter as Python names it, as `\u200b`."""
    return letter.encode("unicode_escape").decode()


def _json_named(letter: str) -> str:
    r"""A letter as JSON names it, `\u` and four hexadecimal digits; two of these beyond 16 bits."""
    units = letter.encode("utf-16-be", "surrogatepass").hex()
    return "".join(f"\\u{units[i : i + 4]}" for i in range(0, len(units), 4))
