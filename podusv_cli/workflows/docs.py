"""`podusv docs`: the pages that come with podusv, their sections, and a search in them."""

from __future__ import annotations

import posixpath
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from podusv_cli.core.errors import UsageError
from podusv_cli.core.phrases import did_you_mean
from podusv_cli.scenario import shipped
from podusv_cli.workflows import examples
from podusv_cli.workflows.plain_math import plain_blocks

CONTENTS = "index.rst"  # the contents of the site: captions, and the pages below each
CAPTION = re.compile(r"^   :caption: (.+)$")
# Pages that are written; those that are made lie in another folder.
ENTRY = re.compile(r"^   (?:.* <)?/?((?:results/|laws/)?\w+)>?$")
HEADING = re.compile(r"^(#{1,4}) (.+)$")
FENCE = re.compile(r"^ *```")
MARKS = re.compile(r"`|\*\*|(?<!\w)\*(?=\w)|(?<=[\w.:])\*(?!\w)")
BAR = "\v"  # stands for a bar that ends no cell
CODE = re.compile(r"`(\w+)`")
CONFIG = re.compile(r"\bconfigs/([\w/]+\.yaml)")
LINK = re.compile(r"(!?)\[([^]]*)\]\(([^)\s]+)\)")
# What a match counts; those in the text up to `MOST`.
IN_NAME, IN_TITLE, IN_HEADING, MOST = 100, 40, 20, 10


@dataclass(frozen=True)
class Section:
    """A heading of a page and the text below it, up to the next heading."""

    page: str
    level: int
    heading: str
    text: str

    @property
    def title(self) -> str:
        """The heading as plain text."""
        return _plain(self.heading)

    def score(self, words: Sequence[re.Pattern[str]]) -> int:
        """How well the section answers a search for `words`; 0 where a word is missing.

        All words in a page's name count most, then those in its title or a heading, then the text.
        """
        if not all(word.search(f"{self.heading}\n{self.text}") for word in words):
            return 0
        named = self.level == 1 and all(word.search(self.page) for word in words)
        headed = all(word.search(self.heading) for word in words)
        # The rarest word decides, and no page wins by its length alone (MOST).
        count = min(len(word.findall(self.text)) for word in words)
        weight = IN_TITLE if self.level == 1 else IN_HEADING
        return IN_NAME * named + weight * headed + min(count, MOST)

    def line(self, words: Sequence[re.Pattern[str]]) -> str:
        """The first line of its text that has one of the words, else the first one."""
        lines = [_plain(line) for line in self.text.splitlines() if line.strip()]
        matching = (line for line in lines if any(word.search(line) for word in words))
        return next(matching, lines[0] if lines else "")


@cache
def contents() -> dict[str, dict[str, str]]:
    """Titles of the pages by name, below the captions of the site's contents and in its order."""
    captions: dict[str, dict[str, str]] = {}
    caption = ""
    for line in (shipped.folder("docs") / CONTENTS).read_text("utf-8").splitlines():
        if begun := CAPTION.match(line):
            caption = begun[1]
        # Pages that are made for the site have no file in a checkout.
        elif (entry := ENTRY.match(line)) and _file(entry[1]).is_file():
            captions.setdefault(caption, {})[entry[1]] = sections(entry[1])[0].title
    return captions


def names() -> tuple[str, ...]:
    """The names of all pages, in the order of the contents."""
    return tuple(name for pages in contents().values() for name in pages)


@cache
def law_pages() -> dict[str, str]:
    """The page of each control law: the one in the folder `laws` whose title has its name."""
    titles = {name: sections(name)[0].heading for name in names() if name.startswith("laws/")}
    return {law: name for name, title in titles.items() for law in CODE.findall(title)}


def page(name: str) -> str:
    """A page as Markdown; its name may be that of a file (`docs/studies.md`) or of a law."""
    short = _full_name(name)
    there = posixpath.dirname(f"{_place(short)}.md")
    return reachable(_file(short).read_text("utf-8"), there)


def readable(name: str) -> str:
    """A page as a terminal shows it: Markdown with its equations in plain symbols."""
    return plain_blocks(page(name))


def reachable(text: str, folder: str) -> str:
    """Markdown of a file in this folder of a checkout, with links that lead on without one."""
    return CONFIG.sub(_name_shipped, LINK.sub(lambda link: _reachable(link, folder), text))


def is_page(name: str) -> bool:
    """Whether a word is the name of a page, or of a law that has one."""
    return _full_name(name) in names()


def search(text: str) -> list[tuple[Section, str]]:
    """Sections that have all words of a text, the best first, each with a line of it.

    Words count where they begin as asked, in any case. Raises UsageError where there is none.
    """
    words = [re.compile(rf"\b{re.escape(word)}", re.IGNORECASE) for word in text.split()]
    every = [part for name in names() for part in sections(name)] if words else []
    scored = [(part.score(words), part) for part in every]
    ranked = sorted((section for section in scored if section[0]), key=lambda section: -section[0])
    if not ranked:
        raise UsageError(
            f"no page is called {text!r} or has all words of it{did_you_mean(text, names())} "
            "(`podusv docs` lists all pages)"
        )
    return [(part, part.line(words)) for _, part in ranked]


@cache
def sections(name: str) -> tuple[Section, ...]:
    """The sections of a page; headings within code are none."""
    return tuple(_sections(name, plain_blocks(_file(name).read_text("utf-8"))))


def _sections(name: str, text: str) -> Iterator[Section]:
    """The sections of a page of Markdown; `#` within a block of code begins none."""
    level, heading, lines, in_code = 0, "", list[str](), False
    for line in text.splitlines():
        in_code ^= bool(FENCE.match(line))
        if (begun := HEADING.match(line)) and not in_code:
            if heading:
                yield Section(name, level, heading, "\n".join(lines))
            level, heading, lines = len(begun[1]), begun[2], []
        else:
            lines.append(line)
    yield Section(name, level, heading, "\n".join(lines))


def _name_shipped(file: re.Match[str]) -> str:
    """A scenario's file as every installation names it; the file where it is not shipped."""
    scenario = shipped.PREFIX + file[1]
    return scenario if scenario in shipped.names() else file[0]


def _reachable(link: re.Match[str], folder: str) -> str:
    """A link that leads somewhere without a checkout too; its words alone where nothing is there.

    `folder` is that of the page in a checkout. Pages become `podusv docs`, examples `podusv init`.
    """
    picture, words, target = link.groups()
    if picture:
        return f"[figure: {words}]"
    if "://" in target:
        return link[0]
    path = target.partition("#")[0]
    if not path:
        return words
    place = posixpath.normpath(posixpath.join(folder, path))
    if is_page(place):
        shown = f"`podusv docs {_short(place)}`"
        return shown if words.endswith(".md") else f"{words} ({shown})"
    scenario = shipped.PREFIX + place.removeprefix("configs/")
    example = examples.name_of(place)
    if example:
        return f"{words} (`podusv init {example}`)"
    return f"`{scenario}`" if scenario in shipped.names() else words


def _plain(line: str) -> str:
    """Text without Markdown's marks: of links, code, emphasis, and of `|` within tables."""
    words = MARKS.sub("", LINK.sub(lambda link: link[2], line)).replace(r"\|", BAR)
    return words.strip(" |>-").replace(BAR, "|")


def _short(name: str) -> str:
    """A page's name of its file's in a checkout."""
    return name.removeprefix("docs/").removesuffix(".md")


def _full_name(name: str) -> str:
    """The name of a page in the contents; a law's name stands for its page."""
    short = _short(name)
    return law_pages().get(short, short)


def _place(name: str) -> str:
    """A page's file in a checkout, without suffix."""
    return name if name.startswith("results/") else f"docs/{name}"


def _file(name: str) -> Path:
    """The Markdown file of a page, of a checkout or of an installed podusv."""
    room, _, rest = _place(name).partition("/")
    return shipped.folder(room) / f"{rest}.md"
