"""Templates of HTML reports, pictures in them, and values as they show them."""

from __future__ import annotations

import base64
import re
from collections.abc import Iterator, Mapping
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

from podusv_cli.core import quantities
from podusv_cli.core.escaping import lines

if TYPE_CHECKING:
    from jinja2 import Environment

NO_BREAK = "\N{NO-BREAK SPACE}"


class Picture(NamedTuple):
    """A figure of a report: what it shows, its PNGs, and where one of its kind was published.

    `phone` is the PNG for windows that are too narrow for `file`; none: that is scrolled there.
    """

    name: str
    caption: str
    file: bytes
    source: str = ""
    phone: bytes = b""

    @property
    def title(self) -> str:
        """What it shows, in a few words."""
        return self.caption.partition(";")[0].partition(":")[0].partition(",")[0]


@cache  # templates are compiled once in a process
def environment(package: str) -> Environment:
    """A package's templates and the shared ones; what they show is text, escaped as such."""
    from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined  # slow to import

    loader = ChoiceLoader([PackageLoader(package), PackageLoader("podusv_cli.pages")])
    made = Environment(
        loader=loader,
        autoescape=True,
        finalize=_show_value,
        # A template that names what there is not fails.
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    made.filters |= {
        "png": _png,
        "sentence": sentence,
        "raised": raise_powers_markup,
        "number": _number,
        "label": _label,
    }
    return made


def _show_value(value: Any) -> Any:
    """What a template shows in place of a value; markup of the template itself as it is."""
    return value if hasattr(value, "__html__") else lines(value)


def sentence(text: str) -> str:
    """The text with a capital and a full stop; a symbol at the start stays as it is."""
    first = text.partition(" ")[0].rstrip(",;:")
    start = text[:1].upper() if first.replace("-", "").isalpha() and first.islower() else text[:1]
    return f"{start}{text[1:]}{'' if text.endswith('.') else '.'}"


def raise_powers_markup(unit: str) -> str:
    """The unit with its powers raised."""
    return re.sub(r"(?<=[A-Za-z])\d", lambda power: power[0].translate(quantities.RAISED), unit)


def _png(file: bytes) -> str:
    """A PNG as an address."""
    return f"data:image/png;base64,{base64.b64encode(file).decode()}"


def _number(text: object) -> str:
    """A number of a table with what stands in brackets, before which alone it may break."""
    from markupsafe import escape  # with jinja2

    whole = escape(lines(text)).replace(" ", NO_BREAK)
    return re.sub(NO_BREAK + r"(?=[\[(])", " ", whole)


def _label(text: object) -> str:
    """A name of a run, law or key, which may break after its underscores and dots."""
    from markupsafe import Markup, escape  # with jinja2

    return Markup(re.sub(r"_|\.(?=[A-Za-z])", r"\g<0><wbr>", str(escape(lines(text)))))


def flat(tree: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Dotted keys and values of a nested mapping; `prefix` stands before the keys."""
    for key, value in tree.items():
        if isinstance(value, Mapping):
            yield from flat(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value
