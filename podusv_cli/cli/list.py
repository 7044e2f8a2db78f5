"""`podusv list`: the kinds, presets, metrics, figures and findings."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from podusv_cli.cli.completion import complete_from_cache
from podusv_cli.cli.options import Plugins
from podusv_cli.cli.terminal import echo, echo_entry

if TYPE_CHECKING:
    from podusv_cli.core.component import Presets
    from podusv_cli.core.plugins import Plugins as Known

Entries = Iterable[tuple[str, str, str]]  # name, what it is, facts


class ListPart(NamedTuple):
    """A part of the list; `words` are what it can be called on the command line."""

    words: tuple[str, ...]
    heading: str
    entries: Entries
    then: str = ""  # what one does with them


LAWS = "controller"  # the section that most people look for comes first
THEN = {
    LAWS: "podusv compare, sweep and bench hold laws beside each other, podusv tune finds "
    "their gains, and podusv export takes one of them to a boat's computer",
    "actuator": "podusv capability finds the current, wind or force that one of them holds at rest",
}  # by section


@complete_from_cache
def words_of_list(plugins: Known) -> Mapping[str, str]:
    """Words for a part of the list."""
    return dict.fromkeys((word for part in parts(plugins) for word in part.words), "")


def list(
    part: Annotated[
        str,
        typer.Argument(
            help="One part only: vessels, paths, laws, metrics, figures, findings, ...",
            autocompletion=words_of_list,
        ),
    ] = "",
    plugin: Plugins = None,
) -> None:
    """List the kinds of components, the presets, the metrics, the figures and the findings.

    `podusv explain NAME` tells more about each.
    """
    from podusv_cli.core.errors import UsageError
    from podusv_cli.core.phrases import unknown_word
    from podusv_cli.scenario.plugins import on_hand

    every = [*parts(on_hand(plugin or ()))]
    chosen = [group for group in every if not part or {part, f"{part}s"} & {*group.words}]
    if not chosen:
        known = dict.fromkeys(word for group in every for word in group.words)
        raise UsageError(unknown_word(f"part {part!r}", part, known))
    if not part:
        echo("to begin with: podusv list laws; also paths, vessels, metrics, findings, ...")
    for group in chosen:
        echo(f"{group.heading}:")
        for name, text, facts in group.entries:
            echo_entry(f"  {name}", text, facts=facts)
        if group.then:
            echo(group.then, err=True)


def parts(plugins: Known) -> Iterator[ListPart]:
    """All parts, in the order of the list.

    `plugins` are plug-ins whose kinds, presets, metrics, figures and findings are in it, too.
    """
    # Here and not above: the models are slow to import, and most commands do not list them.
    from podusv_cli.metrics.table import metrics_with
    from podusv_cli.scenario.explain import first_sentence, kinds
    from podusv_cli.scenario.model import BASES
    from podusv_cli.scenario.presets import preset_about, preset_names, preset_text, with_presets

    by_section = kinds(plugins)
    # LAWS first, then the sections in the model's order.
    for section in dict.fromkeys((LAWS, *by_section)):
        summaries = by_section[section]
        words = (f"{section}s", f"{BASES[section].noun}s")
        entries = ((kind, text, "") for kind, text in summaries.items())
        yield ListPart(words, section, entries, THEN.get(section, ""))
    for key, (_, presets) in with_presets().items():
        texts = [
            (
                name,
                # A preset without a comment at its top has at least a source.
                preset_about(presets, name, plugins)
                or first_sentence(preset_text(presets, name, "source", plugins)),
                _size(presets, name, plugins),
            )
            for name in preset_names(presets, plugins)
        ]
        words = (f"{key.partition('.')[0]}s", "presets")
        yield ListPart(words, f"{key} (preset, a {presets.noun})", texts)
    metrics = ((name, m.meaning, f"[{m.unit}]") for name, m in metrics_with(plugins).items())
    yield ListPart(("metrics",), "metrics", metrics)
    yield ListPart(("figures",), "figures", _figures(plugins))
    yield ListPart(("findings",), "findings (silence)", _findings(plugins))


SIZES = {"length": "m", "beam": "m", "m": "kg"}  # what tells vessels apart at once


def _size(presets: Presets, name: str, plugins: Known) -> str:
    """Length, beam and mass of a vessel with units; "" for presets of other sections."""
    from podusv_cli.scenario.presets import preset_text

    sizes = {key: preset_text(presets, name, key, plugins) for key in SIZES}
    return ", ".join(
        f"{key if key != 'm' else 'mass'} {number} {SIZES[key]}"
        for key, number in sizes.items()
        if number != "None"
    )


def _figures(plugins: Known) -> Entries:
    """Name, caption and an empty note of every figure."""
    from podusv_cli.figures.drawing import figures_with  # matplotlib is slow to import

    yield from ((name, sheet.caption, "") for name, sheet in figures_with(plugins).items())


def _findings(plugins: Known) -> Entries:
    """Name, meaning and a note on when it is looked for of every finding."""
    from podusv_cli.findings.finding import finding_kinds  # imports half of podusv

    for name, finding in finding_kinds(plugins).items():
        yield name, finding.meaning, f"{finding.when} a run, {finding.about}"
