"""The reference pages of the site, written from podusv's own models: nothing is typed twice.

`conf.py` calls `write` before Sphinx looks for pages. They are Markdown in docs/reference/, which
git ignores.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import typer.main

import podusv
from podusv_cli.cli import app
from podusv_cli.cli.exit_codes import MEANINGS
from podusv_cli.core.past_run import PastRun
from podusv_cli.core.signal import Signal
from podusv_cli.figures.drawing import FIGURES, draw
from podusv_cli.figures.shown import dress_runs
from podusv_cli.findings.finding import finding_kinds
from podusv_cli.metrics.table import METRICS
from podusv_cli.scenario.explain import ExplainRow, explain, signals
from podusv_cli.scenario.keys import SCENARIO, Key
from podusv_cli.scenario.presets import preset_names, preset_text, with_presets
from podusv_cli.scenario.shipped import file_of

# A figure is drawn from runs of the first of these scenarios that has its signals.
SHOWN = (
    "podusv:pod/kept.yaml",
    "podusv:sea/sensors.yaml",
    "podusv:sea/state_4.yaml",
    "podusv:laws/legs.yaml",
)
SECONDS = 60.0
# Runs to look at: scenarios that come with podusv, and which of their laws the gallery draws.
GALLERY = {
    "podusv:demo.yaml": (),
    "podusv:own_vessel.yaml": (),
    "podusv:mu_2017/corrected_compare.yaml": ("adaptive_neural", "pid"),
    "podusv:pod/kept.yaml": ("adaptive_neural", "pid"),
    "podusv:sea/state_4.yaml": ("adaptive_neural", "pid"),
    "podusv:laws/legs.yaml": ("los_pid", "velocity_vector"),
    "podusv:trials/zigzag_20.yaml": (),
}
# What podusv does in pictures: title, sentence, scenario, laws that are drawn, figure.
SHORT = (
    (
        "Laws follow a target",
        "Every law gets the same hull, target and sea. The map shows who stays near the target.",
        ("podusv:demo.yaml", (), "trajectory"),
    ),
    (
        "What a law demands",
        "The log has every signal: what the law demands, and what the actuator delivers.",
        ("podusv:mu_2017/corrected_compare.yaml", (), "controls"),
    ),
    (
        "A sea",
        "Waves, wind and a current act on the hull. The same seed gives the same sea.",
        ("podusv:sea/state_4.yaml", ("velocity_vector",), "sea"),
    ),
    (
        "What a law sees",
        "Sensors have noise, rates and delays. The law gets the estimate of a filter.",
        ("podusv:sea/sensors.yaml", ("velocity_vector",), "estimates"),
    ),
)
STUDY = "results/studies/learned/figures/ratios-iae.png"  # the last picture: of 1000 draws
EDITOR_LINE = re.compile(r"^# yaml-language-server: .*\n", re.MULTILINE)
DRAWN = "figures"  # the folder of their pictures


def write(folder: Path) -> None:
    """Write every page; one that has not changed keeps its time, so that Sphinx skips it."""
    (folder / DRAWN).mkdir(parents=True, exist_ok=True)
    pages = {name: page() for name, page in PAGES.items()}
    pages |= {f"{section}s": kinds_page(section) for section in KINDS}
    for name, text in pages.items():
        _write(folder / f"{name}.md", text.encode())
    for name, picture in (*pictures(), *gallery_pictures(), *short_pictures()):
        _write(folder / DRAWN / name, picture)


def _write(file: Path, content: bytes) -> None:
    if not file.exists() or file.read_bytes() != content:
        file.write_bytes(content)


def pictures() -> Iterable[tuple[str, bytes]]:
    """Every figure, as PNG, of two laws behind pods, or in a sea."""
    drawn: dict[str, bytes] = {}
    for shown in SHOWN:
        scenario = podusv.load(shown, {"simulation.duration": SECONDS})
        runs = [
            past_run_of(name, single)
            for name, single in scenario.singles().items()
            if name in ("adaptive_neural", "pid")
        ]
        left = [sheet for name, sheet in FIGURES.items() if f"{name}.png" not in drawn]
        drawn |= dict(draw(dress_runs(runs), left, ["png"]))
    return drawn.items()


def past_run_of(label: str, scenario: Any) -> PastRun:
    """The run of a scenario under a label."""
    return replace(podusv.simulate(scenario).past, label=label)


def gallery_pictures() -> Iterable[tuple[str, bytes]]:
    """The tracks of every scenario of the gallery, over its whole time."""
    for shown, laws in GALLERY.items():
        singles = podusv.load(shown).singles()
        runs = [
            past_run_of(label, single)
            for label, single in singles.items()
            if label in (laws or singles)
        ]
        for _, picture in draw(dress_runs(runs), [FIGURES["trajectory"]], ["png"]):
            yield f"{_picture(shown)}.png", picture


def short_pictures() -> Iterable[tuple[str, bytes]]:
    """The pictures of the page that shows what podusv does."""
    for _, _, (shown, laws, figure) in SHORT:
        singles = podusv.load(shown).singles()
        runs = [
            past_run_of(name, one) for name, one in singles.items() if name in (laws or singles)
        ]
        for _, picture in draw(dress_runs(runs), [FIGURES[figure]], ["png"]):
            yield f"short-{figure}.png", picture


def short_page() -> str:
    """What podusv does in five pictures, each with the command that draws it."""
    parts = ["# podusv in five pictures"]
    for title, sentence, (shown, laws, figure) in SHORT:
        several = len(podusv.load(shown).controllers) > 1
        made = "compare" if several and len(laws) != 1 else "run"
        chosen = f" --controller {laws[0]}" if several and made == "run" else ""
        parts += [
            f"## {title}",
            sentence,
            f"![{title}]({DRAWN}/short-{figure}.png)",
            f"    podusv {made} {shown}{chosen} --figure {figure}",
        ]
    parts += [
        "## Which law is better, over 1000 hulls, seas and starts",
        "One run cannot say. Laws meet the same draws; intervals show what the draws prove.",
        f"![Ratios of laws over draws](../../{STUDY})",
        "    podusv sweep run podusv:studies/learned.yaml",
    ]
    return page(parts)


def _picture(shown: str) -> str:
    return shown.removeprefix("podusv:").removesuffix(".yaml").replace("/", "-")


def gallery_page() -> str:
    """Runs to look at, each with the YAML that makes it."""
    parts = ["# Gallery", "Scenarios that come with podusv, and what they give."]
    for shown in GALLERY:
        loaded, name = podusv.load(shown), shown.removeprefix("podusv:").removesuffix(".yaml")
        made = "compare" if loaded.controllers else "run"
        yaml = Path(file_of(shown)).read_text("utf-8")
        parts += [
            f"## {name}",
            text(loaded.description),
            f"![tracks of {name}]({DRAWN}/{_picture(shown)}.png)",
            f"    podusv {made} {shown}\n    podusv init {name}    # a copy to edit",
            f"```yaml\n{EDITOR_LINE.sub('', yaml).strip()}\n```",
        ]
    return page(parts)


KINDS = {
    "controller": "Control laws",
    "path": "Paths",
    "disturbance": "Disturbances",
    "actuator": "Actuators",
    "measurement": "Measurements",
    "estimator": "Estimators",
}


def kinds_page(section: str) -> str:
    """All kinds of a section: what each is, its keys and its signals."""
    key = SCENARIO.keys[section]
    meaning = explain(section)[0].meaning
    parts = [f"# {KINDS[section]}", f"The section `{section}` of a scenario: {text(meaning)}."]
    for kind, inner in key.kinds.items():
        parts += [f"## `{kind}`", inspect.getdoc(inner.model) or ""]
        parts.append(keys_table(explain(f"{section}.{kind}")[1:], section))
        parts += _signals_of(inner)
    return page(parts)


def _signals_of(kind: Key) -> list[str]:
    own = getattr(kind.model, "signals", ())
    if not isinstance(own, Sequence) or not own:
        return []
    return ["Signals that it logs:", table(SIGNAL, [signal_row(signal) for signal in own])]


def scenario_page() -> str:
    """The sections of a scenario and every key that does not depend on a kind."""
    parts = [
        "# Scenario",
        "The sections of a scenario file, in YAML. A key that has a default, or that a file under "
        "`extends` gives, may be left out.",
        keys_table(explain()),
    ]
    for name, key in SCENARIO.keys.items():
        rows = explain(name)[1:]
        if rows and not key.kinds and name != "nominal":
            parts += [f"## `{name}`", keys_table(rows, name)]
    return page(parts)


def vessels_page() -> str:
    """Every preset of vessels and pods: where its numbers come from, and what they hold for."""
    parts = ["# Vessels and pods", "Presets, with the numbers of each."]
    for key, (_, presets) in with_presets().items():
        if key == "nominal":
            continue
        parts += [f"## `{key}.preset`"]
        for name in preset_names(presets):
            source, validity = (preset_text(presets, name, word) for word in ("source", "validity"))
            parts += [f"### `{name}`", text(source), f"Validity: {text(validity)}"]
    return page(parts)


SIGNAL = ("name", "unit", "axes", "meaning")


def signal_row(signal: Signal) -> tuple[str, ...]:
    """A row of a table of signals."""
    return code(signal.name), signal.unit, ", ".join(signal.dimensions), text(signal.meaning)


def signals_page() -> str:
    """Every signal."""
    rows = [signal_row(signal) for signal in signals()]
    return page(["# Signals", "What a run can log.", table(SIGNAL, rows)])


def metrics_page() -> str:
    """Every metric."""
    rows = [(code(m.name), m.unit, text(m.meaning)) for m in METRICS.values()]
    about = "The definitions are in [Metrics](../metrics.md)."
    return page(["# All metrics", about, table(("name", "unit", "meaning"), rows)])


def findings_page() -> str:
    """Every finding."""
    parts = ["# All findings", "[Findings](../findings.md) tells how they are shown and silenced."]
    for kind in finding_kinds().values():
        parts += [
            f"## `{kind.name}`",
            f"{text(kind.meaning)} ({kind.when} a run, key `{kind.about}`).",
            f"- Condition: {text(kind.condition)}\n- Remedy: {text(kind.remedy)}",
        ]
    return page(parts)


def figures_page() -> str:
    """Every figure with its picture."""
    parts = [
        "# All figures",
        f"Drawn from the first {SECONDS:g} s of two laws of one of {', '.join(map(code, SHOWN))}. "
        "[Figures](../figures.md) tells how to draw them.",
    ]
    for name, sheet in FIGURES.items():
        shown = ", ".join(map(code, sheet.signals))
        parts += [f"## `{name}`", text(sheet.caption), f"Shows {shown}."]
        parts.append(f"![{name}]({DRAWN}/{name}.png)")
    return page(parts)


def commands_page() -> str:
    """Every command with its arguments and options."""
    whole: Any = typer.main.get_command(app)
    return page(["# Commands", text(whole.help), *_commands(whole, "podusv")])


def _commands(group: Any, above: str) -> Iterable[str]:
    for name, command in group.commands.items():
        given = [_parameter(one) for one in command.params if one.name != "help"]
        yield from (f"## `{above} {name}`", text(command.help or ""))
        yield table(("argument or option", "meaning"), given) if given else ""
        yield from _commands(command, f"{above} {name}") if hasattr(command, "commands") else ()


def _parameter(one: Any) -> tuple[str, str]:
    if one.param_type_name == "argument":
        return code(one.metavar or one.name.upper()), text(one.help or "")
    names = [f"{name} {one.metavar or ''}".strip() for name in (*one.opts, *one.secondary_opts)]
    return ", ".join(map(code, names)), text(one.help or "")


def exit_codes_page() -> str:
    """Every exit code."""
    rows = [(str(number), text(meaning)) for number, meaning in MEANINGS.items()]
    return page(["# Exit codes", table(("code", "meaning"), rows)])


def python_page() -> str:
    """The Python interface by its docstrings."""
    functions = [name for name in podusv.__all__ if not isinstance(getattr(podusv, name), type)]
    classes = [name for name in podusv.__all__ if isinstance(getattr(podusv, name), type)]
    made = [f".. autofunction:: podusv.{name}" for name in functions]
    made += [
        f".. autoclass:: podusv.{n}\n   :members:\n   :special-members: __getitem__"
        for n in classes
    ]
    parts = ["# Python interface", "`import podusv`. [podusv from Python](../python.md)"]
    return page([*parts, *(f"```{{eval-rst}}\n{text}\n```" for text in made)])


PAGES: Mapping[str, Callable[[], str]] = {
    "scenario": scenario_page,
    "vessels": vessels_page,
    "signals": signals_page,
    "metrics": metrics_page,
    "findings": findings_page,
    "figures": figures_page,
    "commands": commands_page,
    "exit_codes": exit_codes_page,
    "python": python_page,
    "gallery": gallery_page,
    "five_pictures": short_page,
}


def keys_table(rows: Iterable[ExplainRow], section: str = "") -> str:
    """Keys of a section with what they may be, default and meaning."""
    made = [
        (_key(row.key, section), _value(row), _default(row.default), text(row.meaning))
        for row in rows
    ]
    return table(("key", "value", "default", "meaning"), made)


def _key(name: str, section: str) -> str:
    return code(name.removeprefix(f"{section}."))


def _value(row: ExplainRow) -> str:
    if row.type in ("keys", "kinds"):
        return f"its {row.type}"
    unit = f"[{row.unit}]" if row.unit else ""
    words = text(" ".join(filter(None, (row.type, row.range, unit))))
    return ", ".join(map(code, row.choices)) or words


def _default(words: str) -> str:
    """A default as code; in prose where it is described, as in "the vessel's"."""
    is_prose = words in ("", "required") or (" " in words and words[0].isalpha())
    return text(words) if is_prose else code(words)


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join(f"| {' | '.join(' '.join(c.split()) for c in line)} |" for line in lines)


def code(word: str) -> str:
    """A word as code in a table's cell."""
    return f"`{word}`".replace("|", "\\|")


def text(words: str) -> str:
    """Words as they are, with nothing in them taken for Markdown but code."""
    outside = words.split("`")
    for place in range(0, len(outside), 2):
        for mark in "\\*<[|":
            outside[place] = outside[place].replace(mark, f"\\{mark}")
    return "`".join(outside)


def page(parts: Iterable[str]) -> str:
    """The parts, an empty line apart."""
    return "\n\n".join(part for part in parts if part) + "\n"
