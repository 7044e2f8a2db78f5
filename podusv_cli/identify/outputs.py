"""Files and page of a hull that was identified."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import groupby
from pathlib import Path
from typing import Any

from podusv_cli.components.actuators.base import Actuator
from podusv_cli.components.estimators.ekf import ExtendedKalmanFilter
from podusv_cli.core.component import unit_of
from podusv_cli.core.escaping import visible
from podusv_cli.core.phrases import value_text
from podusv_cli.core.recording import Status
from podusv_cli.identify.answer import AXES, Force, Identification
from podusv_cli.identify.fit.beside import DEVIATION, LASTING, RATE, SWINGS
from podusv_cli.identify.fit.estimate import OPEN, SILENT
from podusv_cli.identify.fit.march import COMPASS, CURRENT, CURVE, DELAY, THRUST
from podusv_cli.identify.fit.problem import FIRST_LOADS, MEAN_LOADS
from podusv_cli.identify.judge import WHO, Score
from podusv_cli.identify.phrases import open_words, summary
from podusv_cli.pages.page import Picture, environment, flat
from podusv_cli.process.extras import Extras, Failure
from podusv_cli.scenario.resolved import yaml_text
from podusv_cli.scenario.sweep import POSTERIOR
from podusv_cli.storage import csv_files
from podusv_cli.storage.run_folder import RunWriter

# Names of the hull, its draws and an actuator whose thrust was looked for; under the second ones no
# scenario takes them by itself.
WRITTEN = ("identified.yaml", POSTERIOR, "actuator.yaml")
REFUSED = ("refused.yaml", f"refused_{POSTERIOR}", "refused_actuator.yaml")
HEADING = "# A hull that podusv identify found from logs; {} has what these leave open.\n"
DIGITS = "%.9g"
UNSETTLED = "not settled"  # in place of whether the logs determine it
AXIS = {axis.name: axis for axis in AXES}
# Units of numbers that neither vessel nor filter has as a key.
OTHERS = {
    "m11": "kg",
    "m22": "kg",
    "m33": "kg m2",
    **dict.fromkeys((THRUST, *CURVE), "1"),
    DELAY: "s",
    DEVIATION: "m",
    LASTING: "s",
    COMPASS: "rad",
    **dict.fromkeys(CURRENT, "m/s"),
    "first u": "m/s",
    "first v": "m/s",
    RATE: "rad/s",
    SWINGS: "1",
    **dict(zip((*FIRST_LOADS, *MEAN_LOADS), ("N", "N", "N m") * 2, strict=True)),
}


@dataclass(frozen=True)
class Identified:
    """A hull from logs, and where its files are."""

    folder: Path
    answer: Identification
    status: Status
    refusal: str = ""  # why the hull was not written as one to use
    warnings: tuple[str, ...] = ()
    missing: tuple[Failure, ...] = ()

    @property
    def hull(self) -> Path:
        """The file that has the hull."""
        return self.folder / (REFUSED if self.refusal else WRITTEN)[0]

    def as_json(self) -> dict[str, Any]:
        """What `--json` prints."""
        return {
            "format": 1,
            "status": self.status,
            "folder": str(self.folder),
            "settled": self.answer.estimate.settled,
            "gusts": self.answer.problem.gusts,
            "refused": self.refusal,
            "known": self.answer.determined_count,
            "of": len(self.answer.problem.hull),
            "parameters": [asdict(p) for p in self.answer.parameters],
            "forces": [asdict(f) for f in self.answer.forces],
            "scores": [asdict(s) for s in self.answer.scores],
            "open": open_words(self.answer),
            "warnings": list(self.warnings),
            "missing": [str(part) for part in self.missing],
        }


def write(
    writer: RunWriter,
    answer: Identification,
    text: str,
    *,
    refusal: str,
    warnings: Sequence[str],
    figures: bool,
) -> None:
    """All files of the folder but the manifest; `text` is the scenario's file.

    A hull with a `refusal` is written under names that no scenario takes by itself.
    """
    hull, draws, actuator = REFUSED if refusal else WRITTEN
    said = [refusal] if refusal else []
    heading = "".join(f"# {visible(line)}\n" for line in said) + HEADING.format(draws)
    writer.add("scenario.yaml", text.encode())
    writer.add(hull, (heading + yaml_text(vessel_keys(answer))).encode())
    if answer.actuator:
        writer.add(actuator, yaml_text(actuator_keys(answer.actuator)).encode())
    for name, rows in {
        "parameters.csv": [
            {"name": p.name, "unit": unit(answer, p.name), **asdict(p)} for p in answer.parameters
        ],
        "forces.csv": [force_record(f) for f in answer.forces],
        "fits.csv": [asdict(w) for w in answer.whiteness],
        "judged.csv": [score_record(s) for s in answer.scores],
        draws: rows_of_draws(answer),
    }.items():
        writer.add(name, csv_files.records(rows, DIGITS).encode())
    pictures = _pictures(answer, writer.extras) if figures else []
    for picture in pictures:
        writer.add(f"figures/{picture.name}.png", picture.file)
    origin = writer.add_origin(answer.problem.scenario.plugged)
    writer.add("report.html", page(answer, pictures, origin, [*said, *warnings]).encode())


def vessel_keys(answer: Identification) -> dict[str, Any]:
    """The hull as a vessel file has it: without what is 0 or absent anyway."""
    fields = type(answer.vessel).model_fields
    return {
        name: content
        for name, content in answer.vessel.model_dump().items()
        if name != "preset" and (fields[name].is_required() or content != fields[name].default)
    }


def actuator_keys(actuator: Actuator) -> dict[str, Any]:
    """The actuator as a preset's file has it."""
    own = {"kind", "preset", "command", "failure"}  # of the scenario that takes it
    return actuator.model_dump(exclude=own, exclude_defaults=True)


def rows_of_draws(answer: Identification) -> list[dict[str, float]]:
    """A row a hull, with those of its numbers that differ between hulls."""
    rows = [hull.constants() for hull in answer.onward]
    own = {name for name in rows[0] if name in type(answer.onward[0]).model_fields}
    moving = [n for n in rows[0] if n in own and len({row[n] for row in rows}) > 1]
    return [{name: row[name] for name in moving} for row in rows]


def _pictures(answer: Identification, extras: Extras) -> list[Picture]:
    """The figures; what cannot be drawn is left to `extras`."""
    from podusv_cli.figures.sketch import render_sketches
    from podusv_cli.identify.figures import sketches  # matplotlib is slow to import

    return render_sketches(sketches(answer), extras)[1]


def unit(answer: Identification, number: str) -> str:
    """Of a number that was looked for: the hull's, the filter's, or a log's current."""
    name = number.partition(",")[0]
    fields = {**ExtendedKalmanFilter.model_fields, **type(answer.vessel).model_fields}
    return unit_of(fields[name]) if name in fields else OTHERS[name]


def force_record(force: Force) -> dict[str, Any]:
    """A force as forces.csv has it: with the units of it and of the speed at which it is."""
    axis = AXIS[force.force]
    return {
        "force": force.force,
        "unit": axis.unit,
        "at": force.at,
        "unit of at": axis.speed_unit,
        **asdict(force),
        "width": force.width,
    }


def score_record(score: Score) -> dict[str, Any]:
    """Errors as judged.csv has them, the heading's in degrees as on the page."""
    return {
        "log": score.log,
        "role": score.role,
        "horizon [s]": score.horizon,
        "who": score.who,
        "runs": score.runs,
        "position [m]": score.position,
        "heading [deg]": math.degrees(score.heading),
    }


def parameter_rows(answer: Identification) -> Iterator[list[str]]:
    """Of every number: name, unit, prior, estimate, interval, and whether the logs determine it."""
    for p in answer.parameters:
        determined = "yes" if p.width <= OPEN else "little" if p.width < SILENT else "no"
        yield [
            p.name,
            unit(answer, p.name),
            f"{p.prior:.4g}",
            f"{p.value:.4g}",
            f"{p.low:.4g} to {p.high:.4g}",
            f"{p.width:.2g}",
            determined if answer.estimate.settled else UNSETTLED,
        ]


def force_rows(answer: Identification) -> Iterator[list[str]]:
    """Of every force: where, its value, the interval, and the interval over the prior's."""
    for f in answer.forces:
        axis = AXIS[f.force]
        yield [
            f.force,
            f"{f.at:.3g} {axis.speed_unit}",
            f"{f.value:.4g} {axis.unit}",
            f"{f.low:.4g} to {f.high:.4g}",
            f"{f.width:.2g}",
            UNSETTLED if not answer.estimate.settled else "yes" if f.width <= OPEN else "no",
        ]


def score_rows(scores: Sequence[Score]) -> Iterator[list[str]]:
    """Of every log and horizon: the errors of every way to predict it."""
    for (log, horizon), of in groupby(scores, lambda s: (s.log, s.horizon)):
        ways = list(of)
        after = "whole log" if math.isinf(horizon) else f"{horizon:g} s"
        errors = [f"{s.position:.3g} m, {math.degrees(s.heading):.3g} deg" for s in ways]
        yield [log, ways[0].role, after, str(ways[0].runs), *errors]


PARAMETERS = (
    "number",
    "unit",
    "prior",
    "estimate",
    "95 % interval",
    "width over the prior's",
    "determined",
)
FORCES = ("force", "at", "estimate", "95 % interval", "width over the prior's", "determined")
SCORES = ("log", "role", "after", "runs", *WHO)


def page(
    answer: Identification,
    pictures: Sequence[Picture],
    origin: Mapping[str, Any],
    warnings: Sequence[str],
) -> str:
    """The page."""
    scenario = answer.problem.scenario
    return (
        environment("podusv_cli.identify")
        .get_template("identify.html.j2")
        .render(
            title=f"The hull of {scenario.name} from its logs",
            scenario=scenario,
            summary=summary(answer),
            open=open_words(answer),
            warnings=warnings,
            parameters=(PARAMETERS, [*parameter_rows(answer)]),
            forces=(FORCES, [*force_rows(answer)]),
            scores=(SCORES, [*score_rows(answer.scores)]),
            whiteness=answer.whiteness,
            widths=[f"{width:.2g}" for width in answer.directions.widths],
            known=answer.determined_count,
            least=OPEN,
            little=SILENT,
            pictures=list(enumerate(pictures, 1)),
            provenance=[(key, value_text(value)) for key, value in flat(origin) if value != []],
        )
    )
