"""Parse YAML text into nodes with line and column, without constructors, aliases or tags.

PyYAML's loaders turn `no` into False and `017` into 15, accept NaN and duplicate keys, and keep no
positions. `yaml.compose` returns nothing if there is a syntax error, so that the errors before it
would not be reported. So the parser's events are read here. Plain scalars follow YAML 1.2: true,
false, null and decimal numbers; everything else is text.
"""

from __future__ import annotations

import math
import os
import re
import stat
import unicodedata
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from difflib import get_close_matches
from itertools import islice
from typing import Any

import yaml

from podusv_cli.core.phrases import describe_found, quote
from podusv_cli.core.system import open_flags
from podusv_cli.core.units import NUMBER
from podusv_cli.scenario.shipped import PREFIX, file_of, names
from podusv_cli.scenario.yaml_tree import Fault, Mark, Node, Route, dotted_key

MAX_BYTES = 1_000_000
# Reading goes down by recursion, and must not come to the end of Python's stack.
MAX_DEPTH = 32
MAX_NODES = 20_000
ENDINGS = (".yaml", ".yml")
FAST = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # PyYAML can lack libyaml
READ_ELSE = re.compile("[?!\t\ufeff\x85\u2028\u2029]")  # libyaml takes texts that PyYAML refuses

WORDS = {
    word: meaning
    for meaning, spellings in (
        (None, ("", "~", "null", "Null", "NULL")),
        (True, ("true", "True", "TRUE")),
        (False, ("false", "False", "FALSE")),
    )
    for word in spellings
}
INTEGER = re.compile(r"[-+]?(0|[1-9][0-9]{0,299})")
NOT_FINITE = re.compile(r"[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)")

# Parts of PyYAML's messages, and the messages for users.
SYNTAX = {
    r"'\t' that cannot start": "a tab; use spaces",
    "that cannot start any token": "{problem}; put the value in quotes",
    "unknown escape character": "{problem}; in a path write / for \\, or put it in single quotes",
    "mapping values are not allowed": "a colon where no key can be; check the indentation, the "
    "space after every colon, and quote text with a colon in it",
    "unexpected end of stream": "the text in quotes that starts here never ends",
    "but got '<stream end>'": "the bracket opened here is never closed",
    "but found '<stream end>'": "the file ends in the middle of a list or mapping",
    "but found ':'": "a colon without a key before it",
    "<block end>, but found": "does not line up with the lines above; check the indentation",
    "expected '<document start>'": "text after the end of the document",
}
# A value in brackets, after which a line goes on.
CLOSED = re.compile(r"(^|[:-] )\s*(\{[^}]*\}|\[[^]]*\])\s*$")
IN_QUOTES = (
    "text after the closing bracket; put a text that begins with a bracket or a brace in quotes"
)
OPENING = ("unexpected end of stream", "but got '<stream end>'")


def read_bytes(path: str, mark: Mark, key: str, faults: list[Fault]) -> bytes | None:
    """What a file holds, or None and a fault at `mark`, under the key that names the file.

    `path` is a file or a `podusv:` name. The message names it unless `mark` does.
    """
    named = "" if mark == Mark(path) else f"{quote(path)} "
    try:
        with open(file_of(path), "rb", opener=_nonblocking_opener) as file:
            if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
                raise ValueError("a pipe or device; save it as a file first")
            # One byte more, which shows that it is too large.
            data = file.read(MAX_BYTES + 1)
    except (OSError, ValueError) as error:
        reason = str((isinstance(error, OSError) and error.strerror) or error)
        reason = reason[:1].lower() + reason[1:]
        if isinstance(error, FileNotFoundError):
            reason += _guess_path(path) or _hint_at_backslash(path)
            if named:
                reason += f"; looked in {os.path.dirname(os.path.abspath(path))}"
        faults.append(Fault(mark, key, f"{named}cannot be read: {reason}"))
        return None
    if len(data) > MAX_BYTES:
        faults.append(Fault(mark, key, f"{named}is larger than {MAX_BYTES:,} bytes"))
        return None
    return data


def _guess_path(path: str) -> str:
    """`; did you mean 'base.yaml'?` for a file that is not there, "" where nothing is like it."""
    folder, name = os.path.split(path)
    near: list[str] = []
    with suppress(OSError):
        near = [file for file in sorted(os.listdir(folder or ".")) if file.endswith(ENDINGS)]
    whole = [os.path.join(folder, name + end) for end in ENDINGS if name + end in near]
    shipped = [name for name in names() if name in (PREFIX + path, f"{PREFIX}{path}.yaml")]
    # A name without its ending, or of a shipped scenario without its prefix, is not a guess.
    if exact := [*whole, *shipped]:
        return f"; did you mean {quote(exact[0])}?"
    stems = {os.path.splitext(file)[0]: file for file in near}
    close = get_close_matches(os.path.splitext(name)[0], stems, n=1)
    return f"; did you mean {quote(os.path.join(folder, stems[close[0]]))}?" if close else ""


def _hint_at_backslash(path: str) -> str:
    """What helps where a path of Windows was meant, which is no file here; "" for other paths."""
    if not path.isprintable():
        return "; in double quotes \\t, \\n and the like are single letters; write / in a path"
    return "; write / between folders" if "\\" in path and os.sep == "/" else ""


def read_text(path: str, mark: Mark, key: str, faults: list[Fault]) -> str | None:
    """The file's text, or None and a fault at `mark` or at the byte that is no UTF-8."""
    data = read_bytes(path, mark, key, faults)
    if data is None:
        return None
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as error:
        place = _place(path, data[: error.start].decode("utf-8"))
        text = f"byte 0x{data[error.start]:02x} is no UTF-8; save the file as UTF-8"
        faults.append(Fault(place, "", text))
        return None


def _nonblocking_opener(path: str, flags: int) -> int:
    """Open a file without waiting for the writer of a pipe."""
    return os.open(path, flags | open_flags("O_NONBLOCK", "O_CLOEXEC"))


def _place(source: str, before: str) -> Mark:
    """The place that comes after the text `before`."""
    last_line = before.rpartition("\n")[2]
    return Mark(source, before.count("\n") + 1, len(last_line) + 1)


def resolve(text: str) -> bool | int | float | str | None:
    """The value of a plain scalar: a word of YAML, a number, or else the text itself.

    A number that is too large becomes infinite.
    """
    if text in WORDS:
        return WORDS[text]
    if INTEGER.fullmatch(text):
        return int(text)
    return float(text) if NUMBER.fullmatch(text) else text


def plain_node(text: str, mark: Mark, key: str, faults: list[Fault]) -> Node:
    """The node of a plain scalar; numbers that are not finite are faults."""
    content = resolve(text)
    if NOT_FINITE.fullmatch(text):
        faults.append(Fault(mark, key, f"{text} is not a finite number"))
    elif isinstance(content, float) and not math.isfinite(content):
        faults.append(Fault(mark, key, f"{text:.40} is too large; numbers must be finite"))
    else:
        return text_node(content, mark, key, faults, text=text)
    return Node(None, mark, faulty=True)


def text_node(content: Any, mark: Mark, key: str, faults: list[Fault], *, text: str = "") -> Node:
    """The node of a scalar; control characters are a fault, as a terminal may obey them.

    `content` is the value, `text` the scalar as written, and `key` where it stands.
    """
    unfit = [c for c in str(content) if unicodedata.category(c) in ("Cc", "Cs") and c not in "\t\n"]
    if unfit:
        faults.append(Fault(mark, key, f"character U+{ord(unfit[0]):04X} cannot stand in text"))
    return Node(None if unfit else content, mark, text=text, faulty=bool(unfit))


def read(
    text: str,
    source: str,
    faults: list[Fault],
    *,
    placed: bool = True,
    most: int = MAX_NODES,
    above: tuple[str, ...] = (),
) -> Node | None:
    """The tree of a single YAML document of at most `most` values; None if that is not possible.

    `text` is that of the file `source`. Every fault is appended to `faults`. Marks have lines only
    where `placed`, and then the files `above` that extend this one.
    """
    reader = _Reader(text, source, faults, placed, most, above)
    try:
        return reader.document()
    except _CannotContinue as stop:
        faults.append(stop.fault)
        return None


def _events(text: str) -> Iterator[Any]:
    """The parser's events, by libyaml where it reads the text as PyYAML's own parser does.

    libyaml is twenty times faster. Where it stops with an error, PyYAML goes on behind the events
    that are out already, since its messages say more.
    """
    given = 0
    if not READ_ELSE.search(text):
        with suppress(yaml.YAMLError, UnicodeError):
            for event in yaml.parse(text, Loader=FAST):
                given += 1
                yield event
            return
    yield from islice(yaml.parse(text, Loader=yaml.SafeLoader), given, None)


class _CannotContinue(Exception):
    """Parsing cannot continue after this fault."""

    def __init__(self, mark: Mark, text: str) -> None:
        self.fault = Fault(mark, "", text)


class _Reader:
    """Reads one document from the parser's events."""

    def __init__(
        self,
        text: str,
        source: str,
        faults: list[Fault],
        placed: bool,
        most: int,
        above: tuple[str, ...],
    ) -> None:
        """The arguments of `read`; the reader goes through the events of `text` once."""
        self._text, self._source, self._placed, self._most = text, source, placed, most
        self._above = above
        self._events = _events(text)
        self._faults = faults
        self._nodes = 0
        self._last = Mark(source)

    def document(self) -> Node:
        """The tree of the one document in the text. Raises _CannotContinue."""
        if self._text.startswith("\ufeff"):
            raise _CannotContinue(
                self._mark(0, 0), "starts with a byte order mark; save as UTF-8 without BOM"
            )
        # The events: start of the stream, start of the document, its value, and the two ends.
        self._next()
        if isinstance(self._next(), yaml.StreamEndEvent):
            raise _CannotContinue(Mark(self._source), "is empty")
        node = self._node(self._next(), ())
        self._next()
        after = self._next()
        if not isinstance(after, yaml.StreamEndEvent):
            raise _CannotContinue(
                self._start(after), "a second document starts here; write one a file"
            )
        return node

    def _next(self) -> Any:
        """The next event of PyYAML. Raises _CannotContinue, with a place, for its errors."""
        try:
            event: Any = next(self._events)
        except yaml.MarkedYAMLError as error:
            raise self._syntax_error(error) from None
        except yaml.reader.ReaderError as error:
            place = _place(self._source, self._text[: error.position])
            code = ord(self._text[error.position])
            place = place if self._placed else Mark(self._source)
            raise _CannotContinue(place, f"character U+{code:04X} cannot stand in YAML") from None
        except (ValueError, IndexError, AttributeError, OverflowError, TypeError):
            # PyYAML raises these for impossible escapes, versions and code points.
            raise _CannotContinue(self._last, "what follows is not valid YAML") from None
        self._last = self._mark(event.end_mark.line, event.end_mark.column)
        return event

    def _syntax_error(self, error: yaml.MarkedYAMLError) -> _CannotContinue:
        """PyYAML's error in words that a user of scenarios understands."""
        problem = error.problem or "unreadable"
        known = [text for part, text in SYNTAX.items() if part in problem]
        opened = any(part in problem for part in OPENING)
        # Where something opened that never ends, its start says more than the end of the file.
        mark = error.context_mark if opened else error.problem_mark
        text = known[0] if known else "not valid YAML: {problem}"
        line = self._text.splitlines()[mark.line : mark.line + 1] if mark else []
        if mark and line and CLOSED.search(line[0][: mark.column]):
            text = IN_QUOTES
        place = self._mark(mark.line, mark.column) if mark else self._last
        return _CannotContinue(place, text.format(problem=problem))

    def _mark(self, line: int, column: int) -> Mark:
        """The place of a line and column that count from 0; only the file where text is secret."""
        if not self._placed:
            return Mark(self._source)
        return Mark(self._source, line + 1, column + 1, self._above)

    def _start(self, event: Any) -> Mark:
        return self._mark(event.start_mark.line, event.start_mark.column)

    def _fault(self, event: Any, route: Route, text: str) -> None:
        self._faults.append(Fault(self._start(event), dotted_key(route), text))

    def _node(self, event: Any, route: Route) -> Node:
        """The tree that begins with `event`, at `route`; aliases, anchors and tags are faults.

        Raises _CannotContinue where there are too many values or levels.
        """
        self._nodes += 1
        if self._nodes > self._most:
            raise _CannotContinue(self._start(event), f"more than {self._most:,} values")
        if len(route) > MAX_DEPTH:
            raise _CannotContinue(self._start(event), f"nested deeper than {MAX_DEPTH} levels")
        if isinstance(event, yaml.AliasEvent):
            self._fault(event, route, f"alias *{event.anchor}; write the value out, or use extends")
            return Node(None, self._start(event), faulty=True)
        if event.anchor:
            self._fault(event, route, f"anchor &{event.anchor}; scenarios have no anchors")
        if event.tag:
            self._fault(event, route, f"tag {quote(event.tag)}; scenarios have no tags")
        if isinstance(event, yaml.ScalarEvent):
            return self._scalar(event, route)
        is_list = isinstance(event, yaml.SequenceStartEvent)
        return self._list(event, route) if is_list else self._mapping(event, route)

    def _scalar(self, event: Any, route: Route) -> Node:
        """A single value; what stands in quotes stays text."""
        mark = self._start(event)
        take = text_node if event.style else plain_node
        node = take(event.value, mark, dotted_key(route), self._faults)
        return replace(node, faulty=node.faulty or bool(event.tag))

    def _list(self, event: Any, route: Route) -> Node:
        """The node of a list that begins with `event`, at `route`.

        It has no items where one of them is faulty, so that its length is not judged.
        """
        items: list[Node] = []
        while not isinstance(item := self._next(), yaml.SequenceEndEvent):
            items.append(self._node(item, (*route, len(items))))
        faulty = any(item.faulty for item in items)
        return Node(() if faulty else tuple(items), self._start(event), faulty=faulty)

    def _mapping(self, event: Any, route: Route) -> Node:
        """The node of a mapping that begins with `event`, at `route`.

        A key that is given twice is a fault, with the line of the first.
        """
        entries: dict[str, Node] = {}
        while not isinstance(head := self._next(), yaml.MappingEndEvent):
            key = self._key(head, route, _decimal_comma(head, entries))
            # Read before its key is judged, as its events have to be gone in any case.
            entry = self._node(self._next(), (*route, key or "?"))
            if key in entries:
                first = entries[key].key_mark
                there = f"; first on line {first.line}" if first and first.line else ""
                self._fault(head, (*route, key), f"given twice{there}")
            elif key is not None:
                entries[key] = replace(entry, key_mark=self._start(head))
        return Node(entries, self._start(event))

    def _key(self, event: Any, route: Route, advice: str) -> str | None:
        """The key that begins with `event`, in the mapping at `route`, or None after a fault.

        `advice` is the end of a message where the key shows what was meant, else "".
        """
        is_word = isinstance(event, yaml.ScalarEvent)
        node = self._node(event, route if is_word else (*route, "?"))
        if is_word and isinstance(node.content, str) and not advice:
            return node.content
        if not node.faulty:
            what = describe_found(node.content, node.text)
            self._fault(event, route, f"keys are words, found {what}{advice}")
        return None


def _decimal_comma(event: Any, before: dict[str, Node]) -> str:
    """`; write a decimal point: 1.5`, for the 5 in `{x: 1,5}` or in `{x:1,5}`; else "".

    `event` is a key and `before` are the entries ahead of it: a comma starts a new entry.
    """
    name, last = next(reversed(before.items()), ("", None))
    number = (last.text if last else "") or name.rpartition(":")[2]
    fraction = isinstance(event, yaml.ScalarEvent) and event.value.isdigit() and not event.style
    whole = INTEGER.fullmatch(number)
    return f"; write a decimal point: {number}.{event.value}" if fraction and whole else ""
