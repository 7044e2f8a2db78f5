"""Numbers and tables put into a page whose words stay; each page's recipe says which."""

import re
from collections.abc import Iterable, Sequence
from functools import partial
from typing import Any

NUMBER = r"([^\s,;.]+(?:\.\d+)?)"


def with_rows(page: str, head: str, rows: Iterable[Sequence[str]]) -> str:
    """The page with other rows in the one table whose first line begins with `head`."""
    shown = "".join(f"| {' | '.join(row)} |\n" for row in rows)
    text, found = re.subn(
        rf"(?m)(^{re.escape(head)}.*\n\|---.*\n)(?:\|.*\n)+", lambda match: match[1] + shown, page
    )
    if found != 1:
        raise SystemExit(f"{found} tables begin with: {head}")
    return text


def with_numbers(page: str, sentences: Iterable[tuple[Any, ...]]) -> str:
    """The page with numbers in place of each {} of a sentence; where lines break stays.

    A sentence is a tuple of its words and its numbers, and has to be on the page once or more.
    """
    for sentence, *numbers in sentences:
        words = r"\s+".join(map(re.escape, sentence.split())).replace(r"\{\}", NUMBER)
        page, found = re.subn(words, partial(_replace_numbers, numbers=numbers), page)
        if not found:
            raise SystemExit(f"the page has no sentence like: {sentence}")
    return page


def _replace_numbers(match: re.Match[str], numbers: Sequence[Any]) -> str:
    text, start = match[0], match.start()
    for group, number in reversed([*enumerate(numbers, 1)]):
        first, last = (at - start for at in match.span(group))
        text = f"{text[:first]}{number}{text[last:]}"
    return text


def ratio(row: Any) -> tuple[str, str, str]:
    """The median of the paired ratio and its interval, three decimals."""
    return f"{row.ratio:.3f}", f"{row.ratio_low:.3f}", f"{row.ratio_high:.3f}"
