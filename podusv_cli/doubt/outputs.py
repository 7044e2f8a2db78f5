"""Tables, figures and page of what the verdicts of a scenario hang on."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from podusv_cli.core.escaping import visible
from podusv_cli.core.phrases import as_yaml, value_text
from podusv_cli.core.recording import Status
from podusv_cli.doubt.alone import ends
from podusv_cli.doubt.answer import DoubtAnswer, DoubtReport, as_json, place
from podusv_cli.doubt.choices import Choice
from podusv_cli.pages.page import Picture, environment, flat
from podusv_cli.process.extras import Extras, Failure
from podusv_cli.scenario.words import in_words as rows_in_words
from podusv_cli.storage import csv_files
from podusv_cli.storage.run_folder import RunWriter

HEAD = ("claim", "verdict", "in draws", "turns at", "hangs on")


@dataclass(frozen=True)
class Doubted:
    """What the verdicts of a scenario hang on, and where the tables, figures and page are."""

    folder: Path
    answers: Sequence[DoubtAnswer]
    status: Status
    missing: tuple[Failure, ...] = ()

    def as_json(self) -> dict[str, Any]:
        """What `--json` prints."""
        return {
            "format": 1,
            "status": self.status,
            "folder": str(self.folder),
            "claims": [as_json(answer) for answer in self.answers],
            "missing": [str(part) for part in self.missing],
        }


def in_words(answer: DoubtAnswer) -> str:
    """What the verdict depends on: its word, how near the nearest turn is, and other tasks."""
    nearest = answer.turns[0].share if answer.turns else math.inf
    far = f", {_share(nearest)}" if math.isfinite(nearest) and answer.word == "fragile" else ""
    idle = "" if answer.acted or not answer.word else ": nothing that was moved acts on it"
    other = answer.word_for_neighbours
    beside = f"; {other} if the task may change" if other != answer.word else ""
    return f"{answer.word}{far}{idle}{beside}"


def _share(share: float) -> str:
    return f"{100.0 * share:.2g} %"


def row(answer: DoubtAnswer) -> list[str]:
    """A claim's row of the table: name, verdict, draws that keep it, where it turns, in words."""
    open_ = f", {answer.unknown} cannot tell" if answer.unknown and answer.word else ""
    kept = f"{answer.kept} of {answer.draws}{open_}" if answer.draws else "-"
    others = f" and {len(answer.turns) - 1} more" if len(answer.turns) > 1 else ""
    turns = f"{place(answer.turns[0])}{others}" if answer.turns else "-"
    return [answer.verdict.name, answer.verdict.in_words, kept, turns, in_words(answer)]


def write(writer: RunWriter, report: DoubtReport, text: str, *, figures: bool) -> None:
    """All files of the folder but the manifest; `text` is the scenario's file."""
    writer.add("scenario.yaml", text.encode())
    for name, source in report.scenario.plugin_files().items():
        writer.add(name, source.encode())
    writer.add_json("doubt.json", {"claims": [as_json(answer) for answer in report.answers]})
    for name, rows in {
        "doubt.csv": table(report.answers),
        "turns.csv": _turns(report),
        "draws.csv": _draws(report),
    }.items():
        writer.add(name, csv_files.lines(rows).encode())
    pictures = _pictures(report, writer.extras) if figures else []
    for picture in pictures:
        writer.add(f"figures/{picture.name}.png", picture.file)
    origin = writer.add_origin(report.scenario.plugged)
    writer.add("report.html", page(report, pictures, origin).encode())


def table(answers: Sequence[DoubtAnswer]) -> Iterator[Sequence[Any]]:
    """Head and rows of the table of claims; cells are empty where no value turns the claim."""
    yield (
        "claim",
        "verdict",
        "word",
        "word_for_neighbours",
        "kept",
        "turned",
        "unknown",
        "failed",
        "moved",
        "acted",
        "silent",
        "nearest",
        "turns_at",
        "nearest_share",
    )
    for answer in answers:
        first = answer.turns[0] if answer.turns else None
        nearest = (first.choice.name, first.value, first.share) if first else ("", "", "")
        yield (
            answer.verdict.name,
            answer.verdict.verdict,
            answer.word,
            answer.word_for_neighbours,
            answer.kept,
            answer.turned,
            answer.unknown,
            answer.failed,
            answer.tried,
            answer.acted,
            answer.silent,
            *nearest,
        )


def _turns(report: DoubtReport) -> Iterator[Sequence[Any]]:
    """Head and rows of turns.csv: a row for each value at which a claim's verdict turns."""
    yield "claim", "key", "own", "turns_at", "held", "unit", "distance", "share", "task"
    for answer in report.answers:
        for turn in (*answer.turns, *answer.neighbours):
            yield (
                answer.verdict.name,
                turn.choice.name,
                turn.choice.own,
                turn.value,
                turn.held,
                turn.choice.unit,
                turn.distance,
                turn.share,
                turn.choice.task,
            )


def _draws(report: DoubtReport) -> Iterator[Sequence[Any]]:
    """Head and rows of draws.csv: values, answers and numbers of each draw."""
    names = [(claim, text) for claim, own in report.tried.base.numbers.items() for text in own]
    yield (
        "draw",
        *(choice.name for choice in report.tried.draws.choices),
        *report.tried.base.answers,
        *(f"{claim}: {text}" for claim, text in names),
        "failed",
    )
    for i, world in enumerate(report.tried.worlds):
        answers = (world.answers.get(claim) for claim in report.tried.base.answers)
        numbers = (world.numbers.get(claim, {}).get(text, math.nan) for claim, text in names)
        yield i, *report.tried.draws.values[i], *answers, *numbers, visible(world.failed)


def _pictures(report: DoubtReport, extras: Extras) -> list[Picture]:
    """The report's figures; `extras` notes those that fail."""
    from podusv_cli.doubt.figures import sketches  # matplotlib is slow to import
    from podusv_cli.figures.sketch import render_sketches

    return render_sketches(sketches(report), extras)[1]


def page(report: DoubtReport, pictures: Sequence[Picture], origin: Mapping[str, Any]) -> str:
    """The report as HTML; `origin` is the provenance of the folder."""
    by_claim = {
        answer.verdict.name: [
            (i, p) for i, p in enumerate(pictures, 1) if p.name.endswith(f"-{answer.verdict.name}")
        ]
        for answer in report.answers
    }
    return (
        environment("podusv_cli.doubt")
        .get_template("doubt.html.j2")
        .render(
            title=f"What the verdicts of {report.scenario.name} depend on",
            scenario=report.scenario,
            answers=report.answers,
            head=HEAD,
            rows={answer.verdict.name: row(answer) for answer in report.answers},
            place=place,
            in_words=in_words,
            pictures=by_claim,
            draws=len(report.tried.worlds),
            moved=[
                (c.name, value_text(c.own), _moves(c), c.task)
                for c in (alone.choice for alone in report.tried.alone)
            ],
            provenance=[(key, value_text(value)) for key, value in flat(origin)],
        )
    )


def _moves(choice: Choice) -> str:
    """The values that a choice had, in words."""
    if choice.range:
        return " to ".join(f"{end:.4g}" for end in ends(choice))
    return rows_in_words(choice.rows) if choice.rows else ", ".join(map(as_yaml, choice.values))
