"""A table that fits a terminal: heads in several lines, the first column wrapped."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Sequence

SPACES = ("  ", " ")  # between columns, the wider one where there is room
NARROWEST = 24  # of a first column of several words
SHORT = 5  # parts of a head that stay in one line


def grid(head: Sequence[str], rows: Sequence[Sequence[str]], room: int) -> list[str]:
    """The lines of the table, none longer than `room` letters; none where that is not possible.

    Heads may have line breaks, and are broken at underscores. The first column may be wrapped.
    """
    columns = list(zip(*rows, strict=True))
    stacks = [
        _break_head(word, max(SHORT, *map(len, column)))
        for word, column in zip(head, columns, strict=True)
    ]
    widths = [max(map(len, (*s, *column))) for s, column in zip(stacks, columns, strict=True)]
    words = [word for cell in (*stacks[0], *columns[0]) for word in cell.split()]
    # How narrow the first column may become: no word of it is broken.
    least = max(min(widths[0], NARROWEST), *map(len, words))
    besides = {space: sum(len(space) + width for width in widths[1:]) for space in SPACES}
    fitting = [space for space in SPACES if least + besides[space] <= room]
    if not fitting:
        return []
    space = fitting[0]
    widths[0] = min(widths[0], room - besides[space])
    height = max(map(len, stacks))
    # Heads of fewer lines stand at the bottom.
    lines = [
        list(line) for line in zip(*([""] * (height - len(s)) + s for s in stacks), strict=True)
    ]
    for first, *rest in rows:
        *above, last = textwrap.wrap(first, widths[0], break_on_hyphens=False)
        lines += [*([line] for line in above), [last, *rest]]
    return [
        space.join(cell.ljust(width) for cell, width in zip(line, widths, strict=False)).rstrip()
        for line in lines
    ]


def _break_head(word: str, width: int) -> list[str]:
    """A head in lines no longer than `width`, as far as its underscores allow that."""
    lines = []
    for line in word.split("\n"):
        lines.append("")
        for part in re.findall("[^_]+_?|_", line):
            if lines[-1] and len(lines[-1] + part) > width:
                lines.append("")
            lines[-1] += part
    return lines
