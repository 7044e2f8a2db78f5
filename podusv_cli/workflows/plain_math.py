"""Equations of the pages as a terminal shows them: the symbols have the names that logs have.

The pages have equations in LaTeX between lines of `$$`. `\\tau_u` becomes tau_u, `\\dot\\psi_e`
psi_e', `\\hat W_u` W_hat_u and `m_{11}` m11; rows and columns of `aligned` stay beside each other.
Only what the pages use is known: letters, accents, fractions, roots, cases and matrices.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

SIZES = re.compile(r"\\(left|right)(?![a-z])\.?")  # of parentheses
BLOCK = re.compile(r"^( *)\$\$\n(.*?)\n *\$\$$", re.M | re.S)
TOKEN = re.compile(r"\\[A-Za-z]+|\\.|\s+|[A-Za-z]+|[\d.]+|.", re.S)
ACCENTS = {"dot": "'", "ddot": "''"}
MARKS = {"hat": "_hat", "tilde": "_tilde", "bar": "_bar"}
TEXTS = {"text", "mathrm", "mathsf"}
NAMES = {
    "le": "<=",
    "ge": ">=",
    "ne": "!=",
    "pm": "+-",
    "times": "x",
    "cdot": "\v",
    "leftarrow": "<-",
    "lvert": "|",
    "rvert": "|",
    "lVert": "|",
    "rVert": "|",
    "lbrace": "{",
    "rbrace": "}",
    "varphi": "phi",
    "star": "*",
    "quad": "\t",
    "qquad": "\t",
    "ldots": "...",
    "infty": "inf",
}
ENDS = {"}", "&", "\\\\", "\\end"}
GAP = "   "  # between equations in a row


def plain_blocks(markdown: str) -> str:
    """Markdown whose equations in LaTeX are code blocks in plain symbols."""
    return BLOCK.sub(_format_code, markdown)


def _format_code(block: re.Match[str]) -> str:
    """A block of LaTeX as a code block of plain text, with its indent."""
    indent = block[1]
    lines = ["```", *plain(block[2]).splitlines(), "```"]
    return "\n".join(indent + line for line in lines)


def plain(latex: str) -> str:
    """An equation in plain symbols, a line for each row, its columns below each other."""
    body = re.sub(r"\\(begin|end)\{(aligned|gathered)\}", "", latex).strip()
    rows = _LatexReader(SIZES.sub("", body)).read_rows()
    # The last cell of a row has no width: nothing stands behind it.
    widths = [max(map(len, column)) for column in zip(*_pad_rows(rows), strict=True)]
    return "\n".join(_format_row(row, widths) for row in rows)


def _pad_rows(rows: list[list[str]]) -> Iterator[list[str]]:
    """The rows, as long as the longest; the last cell of a row sets no width."""
    most = max(map(len, rows))
    return ([*row[:-1], *[""] * (most - len(row) + 1)] for row in rows)


def _format_row(cells: list[str], widths: list[int]) -> str:
    """A row of cells as text, a left and a right side at a time, as `aligned` pairs its columns.

    A right side alone, such as the number of the equation, follows at once: lines stay short.
    """
    padded = [cell.ljust(width) for cell, width in zip(cells, widths, strict=False)]
    line = " ".join(padded[:2])
    for left, right in zip(padded[2::2], padded[3::2], strict=False):
        line = f"{line}{GAP}{left} {right}" if left.strip() else f"{line.rstrip()}{GAP}{right}"
    return line.rstrip()


@dataclass(frozen=True)
class _MathSymbol:
    """A symbol or a group with what is written at it."""

    base: str
    below: str = ""
    after: str = ""  # primes
    above: str = ""

    def __str__(self) -> str:
        return f"{self.base}{self.below}{self.after}{self.above}"


class _LatexReader:
    """Reads LaTeX token by token."""

    def __init__(self, latex: str) -> None:
        self._tokens: list[str] = TOKEN.findall(latex)
        self._at = 0

    def read_rows(self) -> list[list[str]]:
        """The cells of the rows up to the end of this text or environment."""
        rows = [[self._read_cell()]]
        while self._peek() in ("&", "\\\\"):
            if self._take() == "&":
                rows[-1].append(self._read_cell())
            # A `\\` at the end opens no row; a first cell may be empty where more cells follow.
            elif (cell := self._read_cell()) or self._peek() == "&":
                rows.append([cell])
        return rows

    def _read_cell(self) -> str:
        """Symbols side by side up to the end of a cell, a group or the text."""
        symbols: list[_MathSymbol] = []
        while (token := self._peek()) and token not in ENDS:
            if token == "_" and symbols:
                self._take()
                symbols[-1] = replace(symbols[-1], below=_format_index(self._read_group()))
            elif token == "^" and symbols:
                self._take()
                symbols[-1] = replace(symbols[-1], above=_format_power(self._read_group()))
            else:
                symbols.append(self._read_symbol())
        return _join(symbols)

    def _read_symbol(self) -> _MathSymbol:
        """The next symbol, group or command; the token is taken."""
        token = self._take()
        if token == "{":
            return _MathSymbol(self._read_rest_of_group())
        if token.isspace():
            return _MathSymbol(" ")
        if not token.startswith("\\"):
            return _MathSymbol(token)
        return self._read_command(token[1:])

    def _read_command(self, name: str) -> _MathSymbol:
        """What a command stands for, such as `frac`, with the groups that it takes."""
        readers: dict[str, Callable[[], _MathSymbol]] = {
            "frac": self._read_fraction,
            "tfrac": self._read_fraction,
            "sqrt": lambda: _MathSymbol(f"sqrt({self._read_group()})"),
            "begin": self._read_environment,
        }
        if name in readers:
            return readers[name]()
        if name in TEXTS:
            return _MathSymbol(self._read_words())
        if name in ACCENTS:
            return _MathSymbol(self._read_group(), after=ACCENTS[name])
        if name in MARKS:
            return _MathSymbol(self._read_group() + MARKS[name])
        return _MathSymbol(NAMES.get(name, name if name.isalpha() else name.strip(",;!") or " "))

    def _read_fraction(self) -> _MathSymbol:
        """A fraction on one line; brackets only where it would read otherwise without them."""
        over, under = self._read_group(), self._read_group()
        over = f"({over})" if re.search(r" [-+x] |, ", _without_brackets(over)) else over
        under = f"({under})" if re.search(r"[\s/+-]", _without_brackets(under)) else under
        return _MathSymbol(f"{over}/{under}")

    def _read_environment(self) -> _MathSymbol:
        """Cases or a matrix on one line, up to its `end`."""
        kind = self._read_words()
        rows = self.read_rows()
        self._take()
        self._read_words()
        if kind == "cases":
            return _MathSymbol("{" + "; ".join(" ".join(filter(None, row)) for row in rows) + "}")
        return _MathSymbol("[" + ", ".join("[" + ", ".join(row) + "]" for row in rows) + "]")

    def _read_group(self) -> str:
        """What the next braces hold, else the next symbol."""
        while self._peek().isspace():
            self._take()
        return str(self._read_symbol())

    def _read_rest_of_group(self) -> str:
        """The text up to the closing brace, which is taken, too."""
        inside = self._read_cell()
        self._take()
        return inside

    def _read_words(self) -> str:
        """What the next braces hold, as it is written; the braces are taken."""
        self._take()
        words = ""
        while self._peek() not in ("}", ""):
            words += self._take()
        self._take()
        return words

    def _peek(self) -> str:
        return self._tokens[self._at] if self._at < len(self._tokens) else ""

    def _take(self) -> str:
        self._at += 1
        return self._tokens[self._at - 1]


def _join(symbols: list[_MathSymbol]) -> str:
    """Symbols in a row, with a space between names, which LaTeX does not need."""
    text = ""
    for symbol in map(str, symbols):
        apart = re.search(r"[\w'*]$", text) and re.match(r"\w", symbol)
        text += f" {symbol}" if apart else symbol
    # Wide gaps stand as tabs until here, and products (a dot without spaces) as \v.
    spaced = re.sub(r"\s*\t\s*", GAP, re.sub(r"[ \n]+", " ", text))
    return re.sub(r" (?=[,;.])", "", re.sub(r"\s*\v\s*", ".", spaced)).strip()


def _format_index(index: str) -> str:
    """What stands below a symbol, as keys and logs are called: m11, X_udot."""
    if len(index) > 1 and index.isdigit():
        return index
    # A dot above an index, as in X_{\dot u}, has become a prime by now.
    named = re.sub(r"(?<=\w) (?=\w)", "", index.replace("'", "dot"))
    named = re.sub(r",(?=\S)", "_", named)
    return f"_{named}" if re.fullmatch(r"\w+", named) else f"_({index})"


def _format_power(power: str) -> str:
    """An exponent after `^`; a star or prime stands by itself."""
    if power in ("*", "'"):
        return power
    return f"^{power}" if re.fullmatch(r"-?[\w.]+", power) else f"^({power})"


def _without_brackets(text: str) -> str:
    """A text without what its parentheses and bars hold."""
    emptied = re.sub(r"\([^()]*\)|\|[^|]*\|", "", text)
    return text if emptied == text else _without_brackets(emptied)
