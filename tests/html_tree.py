"""A page of HTML as a tree, for tests that ask what it says and not how it is spelled."""

from __future__ import annotations

from collections.abc import Iterator
from html.parser import HTMLParser

VOID = {"meta", "img", "br", "wbr", "input", "link", "hr", "col", "source"}


class Element:
    """An element: its tag, attributes, and what it holds, text and elements."""

    def __init__(self, tag: str = "", attributes: dict[str, str] | None = None) -> None:
        self.tag, self.attributes = tag, attributes or {}
        self.parts: list[str | Element] = []

    @property
    def text(self) -> str:
        """All text inside, white space as one blank."""
        return " ".join(self.raw.split())

    @property
    def raw(self) -> str:
        """All text inside as it is."""
        return "".join(part if isinstance(part, str) else part.raw for part in self.parts)

    def all(self, tag: str = "", **attributes: str) -> list[Element]:
        """The elements inside with this tag and these attributes; `kind` is one of the classes."""
        kind = attributes.pop("kind", "")
        return [
            e
            for e in self.inside()
            if tag in ("", e.tag)
            and (not kind or kind in e.attributes.get("class", "").split())
            and attributes.items() <= e.attributes.items()
        ]

    def inside(self) -> Iterator[Element]:
        """Every element inside."""
        for part in self.parts:
            if isinstance(part, Element):
                yield part
                yield from part.inside()

    def rows(self) -> list[list[str]]:
        """The text of every cell of every row of every table inside."""
        return [
            [cell.text for cell in row.inside() if cell.tag in ("td", "th")]
            for row in self.all("tr")
        ]


class _Reader(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.open = [Element()]

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        element = Element(tag, {name: value or "" for name, value in attrs})
        self.open[-1].parts.append(element)
        if tag not in VOID:
            self.open.append(element)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        element = Element(tag, {name: value or "" for name, value in attrs})
        self.open[-1].parts.append(element)

    def handle_endtag(self, tag: str) -> None:
        assert self.open[-1].tag == tag, f"</{tag}> ends <{self.open[-1].tag}>"
        self.open.pop()

    def handle_data(self, data: str) -> None:
        self.open[-1].parts.append(data)


def tree(page: str) -> Element:
    """The page; AssertionError where an element is not ended in its place."""
    reader = _Reader()
    reader.feed(page)
    reader.close()
    assert len(reader.open) == 1, f"<{reader.open[-1].tag}> is not ended"
    return reader.open[0]
