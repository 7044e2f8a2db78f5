"""`podusv doubt` of a study: the same study with one value changed, over and over."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from podusv_cli.core.errors import PodusvError
from podusv_cli.core.phrases import as_yaml
from podusv_cli.doubt import outputs
from podusv_cli.doubt.alone import TriedChoice, TriedValue
from podusv_cli.doubt.answer import DoubtReport, Tried, answers
from podusv_cli.doubt.choices import Choice
from podusv_cli.doubt.judged import Judged
from podusv_cli.doubt.of_study import overrides, study_choices
from podusv_cli.doubt.together import Draws
from podusv_cli.process.extras import Failure
from podusv_cli.scenario import plugins
from podusv_cli.scenario.load import Loaded
from podusv_cli.storage.run_folder import RunWriter
from podusv_cli.studies.counting.verdict import StudyVerdict
from podusv_cli.workflows import sweep
from podusv_cli.workflows.request import Request
from podusv_cli.workflows.run import RESULTS

Progress = Callable[[str, float], None]
NO_LOGS = "sweep.keep=null"  # the study's own has them


@dataclass(frozen=True)
class Studies:
    """A study and its folder; the same study with other values goes beside it."""

    config: Path
    folder: Path
    request: Request

    def judge(self, name: str, new: list[str]) -> tuple[Judged, list[StudyVerdict]]:
        """The answers of the study with new values, and its verdicts; what was made before is kept.

        `name` is its folder's, `new` are values as `--set` takes them. A study that cannot be made
        is a failed one.
        """
        own = Request(
            overrides=[*self.request.overrides, NO_LOGS, *new],
            out=self.folder / "studies" / name,
            workers=self.request.workers,
            figures=False,
            argv=self.request.argv,
            plugins=self.request.plugins,
            trust=self.request.trust,
        )
        try:
            done = sweep.run(self.config, own, lambda tally: None)
        except PodusvError as error:
            return Judged({}, {}, str(error)), []
        assert done.results
        verdicts = list(done.results.verdicts)
        return Judged(
            {v.name: v.answer for v in verdicts}, {v.name: _numbers(v) for v in verdicts}
        ), verdicts


def _numbers(verdict: StudyVerdict) -> dict[str, float]:
    """The estimates of a verdict by the name of their statistic and cell."""
    return {
        f"{part.statistic} at {part.cell}" if part.cell else part.statistic: part.estimate
        for part in verdict.parts
    }


def doubt_study(
    config: Path, loaded: Loaded, request: Request, progress: Progress | None = None
) -> outputs.Doubted:
    """Move what a study does not draw, one value at a time, and judge its claims anew.

    Every study stays in the folder, so that an interrupted search goes on where it was. Raises
    ScenarioError, StorageError, PodusvError where the study as it is cannot be made, and
    KeyboardInterrupt.
    """
    scenario = loaded.scenario
    folder = request.out or RESULTS / f"{scenario.name}-doubt"
    studies, moving = Studies(config, folder, request), study_choices(scenario)
    tell = progress or (lambda what, fraction: None)
    base, verdicts = studies.judge("own", [])
    if base.failed:
        raise PodusvError(base.failed)
    alone = []
    try:
        for done, choice in enumerate(moving):
            tell("one at a time", done / len(moving))
            alone.append(TriedChoice(choice, tuple(_trials(studies, choice, loaded))))
    except KeyboardInterrupt as stop:
        again = plugins.continue_with(f"doubt {config} --out", folder)
        raise KeyboardInterrupt(
            f"interrupted; the studies that are made are kept, continue with: {again}"
        ) from stop
    # No draws of all choices at once: each would be a study.
    tried = Tried(base, alone, Draws((), np.zeros((0, 0)), ()), ())
    report = DoubtReport(scenario, answers(verdicts, tried), tried)
    with RunWriter(folder / "answer", force=True, argv=request.argv) as writer:
        writer.extras.missing += _failures_of(alone)
        outputs.write(writer, report, loaded.text, figures=False)
        missing = tuple(writer.extras.missing)
        return outputs.Doubted(writer.finish(), report.answers, writer.status, missing)


def _failures_of(alone: Sequence[TriedChoice]) -> Iterator[Failure]:
    """The values with which there is no study, and why."""
    for tried in alone:
        for trial in tried.trials:
            if trial.judged.failed:
                yield Failure(f"{tried.choice.name}: {as_yaml(trial.value)}", trial.judged.failed)


def _trials(studies: Studies, choice: Choice, loaded: Loaded) -> list[TriedValue]:
    """A study for each value of a choice, numbered from 1, and what it answers."""
    return [
        TriedValue(
            value, studies.judge(_name(choice, i), overrides(choice, value, loaded.scenario))[0]
        )
        for i, value in enumerate(choice.values, 1)
    ]


def _name(choice: Choice, place: int) -> str:
    """The folder of the study with a choice's other value."""
    return f"{re.sub(r'[^A-Za-z0-9_.]+', '-', choice.name)}-{place}"
