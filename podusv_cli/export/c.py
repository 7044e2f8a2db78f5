"""An exported law as C: a header, and the file that has its numbers and calls its object code."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from typing import TYPE_CHECKING, Any

from podusv_cli import __version__
from podusv_cli.core.kernel import Vector
from podusv_cli.core.signal import DEMAND_SIZE
from podusv_cli.export.law import (
    LOAD_NUMBERS,
    PARTS,
    STATE_NUMBERS,
    STEP,
    ExportedLaw,
    ExportedNumber,
)

if TYPE_CHECKING:
    from jinja2 import Environment

IN_A_LINE = 4
# Vectors of the loop that a law by itself has, as the C file calls them
VECTORS = {
    "law": "(double *)constants",
    "law_table": "(double *)table",
    "s": "law->state",
    "row": "row",
    "stages": "law->stages",
    "held": "law->held",
    "work": "law->work",
}
ASSUMED = {
    2: "the demand before, cut at {0} N and {1} N m, acts",
    3: "the demand before, cut at {0} N, {1} N m and {2} N, acts",
}


def sources(law: ExportedLaw) -> dict[str, str]:
    """The text of law.h and law.c."""
    about = template_values(law)
    return {name: render_file(name, about) for name in ("law.h", "law.c")}


def render_file(name: str, about: Mapping[str, Any]) -> str:
    """A file of this name from its template."""
    return _environment().get_template(f"{name}.j2").render(about)


@cache  # templates are compiled once in a process
def _environment() -> Environment:
    """jinja2 for the templates of this folder; a name that is missing is an error."""
    from jinja2 import Environment, PackageLoader, StrictUndefined  # slow to import

    return Environment(
        loader=PackageLoader("podusv_cli.export"),
        undefined=StrictUndefined,
        autoescape=lambda template: template is not None and ".xml" in template,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )


def template_values(law: ExportedLaw) -> dict[str, Any]:
    """What templates show of a law: texts, sizes, and numbers as C has them, by name.

    Vectors of the loop that the law alone does not have point at an `unused` number.
    """
    vectors, layout = law.vectors, law.layout
    of_path = ("path", "path_table") if layout.shown else ()  # which shows the law another target
    shown = {name: f"(double *){name}" for name in of_path}
    return {
        "label": law.loop.controller.label,
        "name": _comment(law.scenario.name),
        "version": __version__,
        "period": f"{law.period:.15g}",
        "signals": law.signals,
        "memory": law.memory,
        "layout": layout,
        "texts": _texts(law),
        "parts": list(PARTS.values()),
        "step": STEP,
        "h": literal(law.grid.step),
        "every": layout.hold_every,
        "tau": layout.tau,
        "demand": layout.demand,
        "first_signal": layout.signals,
        "targets": len(law.targets),
        "demands": len(law.demands),
        "assumed": _assumed_loads(law),
        "sizes": {name: len(getattr(vectors, name)) for name in ("stages", "held", "work")},
        "vectors": [VECTORS.get(name, shown.get(name, "&unused")) for name in vectors._fields],
        "arrays": {
            "constants": _lines(vectors.law),
            "table": _lines(vectors.law_table),
            "start": _lines(vectors.s),
            **{name: _lines(getattr(vectors, name)) for name in shown},
        },
    }


def literal(number: float) -> str:
    """The number in C, to its last bit."""
    if math.isfinite(number):
        return float(number).hex()
    return "NAN" if math.isnan(number) else ("INFINITY" if number > 0 else "-INFINITY")


def _lines(numbers: Vector) -> list[list[str]]:
    """Numbers (n,) as lines of C, in hexadecimal: every bit stays."""
    words = [literal(number) for number in numbers.tolist()]
    return [words[i : i + IN_A_LINE] for i in range(0, len(words), IN_A_LINE)]


def _assumed_loads(law: ExportedLaw) -> list[str]:
    """C for the loads that act where nobody knows them: the demand, cut where the actuator cuts it.

    Surge force, yaw moment, sway force, which is 0 where the law asks for none.
    """
    demands = [f"row[{law.layout.demand + i}]" for i in range(len(law.demands))]
    cut = [
        demand
        if math.isinf(limit)
        else f"fmin(fmax({demand}, -{literal(limit)}), {literal(limit)})"
        for demand, limit in zip(demands, law.limits, strict=True)
    ]
    return [*cut, "0.0"][:DEMAND_SIZE]


def _texts(law: ExportedLaw) -> Mapping[str, str]:
    """What the header says of each vector of the step, by its name in the template."""
    cut = any(map(math.isfinite, law.limits))
    assumed = ASSUMED[len(law.demands)] if cut else "the demand before acts"
    return {
        "state": _list(STATE_NUMBERS),
        "target": _list(law.targets),
        "loads": _list(LOAD_NUMBERS),
        "demand": _list(law.demands),
        "signals": f"What the law says beside: {_list(law.signals) or 'nothing'}",
        "memory": f"What it remembers: {_list(law.memory) or 'nothing'}",
        "assumed": assumed.format(*(f"{x:g}" for x in law.limits)),
    }


def _list(numbers: Sequence[ExportedNumber]) -> str:
    """Names, units and meanings of numbers, a line each, for a comment in C."""
    return ",\n           ".join(
        _comment(f"{number.name} [{number.unit}] {number.meaning}") for number in _few(numbers)
    )


def _few(numbers: Sequence[ExportedNumber], most: int = 40) -> Iterable[ExportedNumber]:
    """The numbers, or the first `most` of them and a last one that says so."""
    return (
        numbers
        if len(numbers) <= most
        else [*numbers[:most], ExportedNumber("...", "", "and so on")]
    )


def _comment(text: str) -> str:
    """Text that ends no comment."""
    return text.replace("*/", "* /")
