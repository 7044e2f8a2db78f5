"""`podusv live`: what a page shows of a scenario whose values a person moves."""

from __future__ import annotations

import json
import math
import re
import shlex
import time
import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from podusv_cli.comparison.claims import ParsedClaim
from podusv_cli.comparison.parsing import parse_claims
from podusv_cli.core.errors import PodusvError, ScenarioError, StorageError, UsageError, in_a_line
from podusv_cli.core.past_run import PastRun
from podusv_cli.core.phrases import unknown_word
from podusv_cli.core.recording import Recording
from podusv_cli.core.system import relative_path
from podusv_cli.engine.running.simulate import run_together
from podusv_cli.figures.chase import chase
from podusv_cli.figures.shown import dress_runs
from podusv_cli.figures.traces import FIRST, traces
from podusv_cli.findings.finding import find_before_run, postflight, unknown_codes
from podusv_cli.metrics.table import headlines_first
from podusv_cli.process.extras import Extras
from podusv_cli.scenario.address import ValueRefused, with_values
from podusv_cli.scenario.case import Case
from podusv_cli.scenario.controls import Knob, controls
from podusv_cli.scenario.limits import limits
from podusv_cli.scenario.load import Loaded, load, load_text
from podusv_cli.scenario.model import Scenario
from podusv_cli.scenario.plugins import kinds_of, of_files
from podusv_cli.scenario.resolved import yaml_text
from podusv_cli.scenario.yaml_tree import Fault, Mark, Route, dotted_key, plain, route
from podusv_cli.workflows.compare import compare
from podusv_cli.workflows.execute import add_derived, summary, warm_up
from podusv_cli.workflows.live_verdicts import (
    claims_about,
    limits_in_words,
    margins_of,
    past_run_of,
    verdicts_on,
)
from podusv_cli.workflows.request import Request

FRAMES = 300  # places of a track on the map
WHOLE = ("simulation", "control", "log", "metrics")  # sections of which numbers are loaded, too
LINK = ("actuator", "command")  # a section that a scenario may lack is loaded, too
MOST_STEPS = 400_000  # a run of more does not follow a hand
ADDED = r"controllers\.[A-Za-z]\w*\.kind"  # the key of a law that the page adds
# What every question to the page has, beside its name.
QUESTIONS = {
    "frame": ("moved", "signals", "rest", "controls"),
    "margins": ("moved",),
    "report": ("moved",),
    "save": ("moved", "name"),
}
Moved = Mapping[str, float | str]  # values by key


@dataclass(frozen=True)
class Base:
    """A scenario that is loaded, into which numbers are put while values move.

    `has_nominal`: the file says what the laws assume of the hull. `several`: it has
    `controllers`. `unread` are sentences about claims that these laws have no signals for.
    """

    cases: dict[str, Case]
    claims: Sequence[ParsedClaim]
    unread: Sequence[str]
    has_nominal: bool
    several: bool


@dataclass
class Live:
    """A scenario's file, what `--set` and `--plugin` gave beside it, and the laws shown."""

    source: str
    given: Sequence[str] = ()
    laws: Sequence[str] = ()
    trust: bool = False  # whether plug-in files of somebody's folder may be executed
    files: Sequence[str] = ()  # plug-ins beside the scenario's own
    offered: dict[str, tuple[str, ...]] = field(default_factory=dict)  # words by key; none: numbers
    _puts: dict[str, tuple[Any, Case]] = field(default_factory=dict)  # the last one of each law
    _bases: dict[str, Base] = field(default_factory=dict)  # by words

    def load(self, moved: Moved) -> Loaded:
        """The scenario with the values moved. Raises ScenarioError."""
        checks = (unknown_codes, limits())
        return load(self.source, self.assignments(moved), checks, self.files, of_files(self.trust))

    def assignments(self, moved: Moved) -> list[str]:
        """The values moved after those given, as `--set` takes them.

        Where a law is added beside a `controller`, that is put among `controllers` first.
        """
        is_added = any(re.fullmatch(ADDED, key) for key in moved)
        first = self._law_of_its_own if is_added else []
        return [*self.given, *first, *assignments_of(moved)]

    @cached_property
    def _law_of_its_own(self) -> list[str]:
        """`--set` that makes the one `controller` an entry of `controllers`, if it is none yet."""
        loaded = self.load({})
        if loaded.scenario.controllers:
            return []
        (label,) = loaded.scenario.labels()
        return [f"controllers={json.dumps({label: plain(loaded.root.mapping['controller'])})}"]

    def singles(self, scenario: Scenario) -> dict[str, Scenario]:
        """The scenario of each law that is shown, by label.

        Raises UsageError for an unknown law.
        """
        known = scenario.singles()
        for law in self.laws:
            if law not in known:
                raise UsageError(unknown_word(f"controller {law!r}", law, known))
        # Laws that the page added are always shown.
        added = [label for label in known if label not in self._labels]
        return {law: known[law] for law in [*self.laws, *added] or known} if self.laws else known

    def controls(self, scenario: Scenario) -> list[Knob]:
        """All knobs of the scenario; their keys and words are noted as offered to the page."""
        several = scenario.controllers
        laws = (
            [f"controllers.{law}" for law in self.singles(scenario)] if several else ["controller"]
        )
        found = controls(scenario, laws)
        self.offered |= {control.key: control.choices for control in found}
        return found

    def answer(self, name: str, asked: Mapping[str, Any]) -> dict[str, Any]:
        """The answer to a question `name` of the page with its arguments `asked`.

        What podusv refuses is returned as `refused`: sentences by key.
        """
        answers: dict[str, Callable[..., dict[str, Any]]] = {
            "frame": self.frame,
            "margins": self.margins,
            "report": self.report,
            "save": self.save,
        }
        if name not in answers:
            return _refusal(unknown_word(f"question {name!r}", name, answers))
        if lacking := [key for key in QUESTIONS[name] if key not in asked]:
            return _refusal(f"the question lacks {', '.join(lacking)}")
        try:
            moved = self.check_offered(asked["moved"])
            return answers[name](moved, *(asked[key] for key in QUESTIONS[name][1:]))
        except ScenarioError as error:
            faults = [fault for fault in error.faults if isinstance(fault, Fault)]
            # A kind that was chosen may need numbers, which the page may then send.
            self.offered |= {
                f.key: () for f in faults if f.text.startswith("missing; must be a number")
            }
            return {"refused": [{"key": fault.key, "text": fault.text} for fault in faults]}
        except (PodusvError, OSError) as error:
            return _refusal(str(error))
        except Exception as error:  # of podusv, of a law, or of a question that no page of it asks
            traceback.print_exc()
            return _refusal(f"{in_a_line(error)}; the terminal has more")

    def check_offered(self, moved: Mapping[str, Any]) -> Moved:
        """The values moved, if they are among those that the page was offered. Raises UsageError.

        So no page can name a plug-in or a file. An empty offer stands for a number. In a shared
        address kinds come before their keys: these are loaded first, and then offer theirs.
        """
        if not moved.keys() <= self.offered.keys():
            kinds = {key: kind for key, kind in moved.items() if key.endswith(".kind")}
            self.offered |= {key: self.kinds for key in kinds if re.fullmatch(ADDED, key)}
            known = kinds if kinds.keys() <= self.offered.keys() else {}
            if all(kind in (self.offered[key] or [kind]) for key, kind in known.items()):
                self.controls(self.load(known).scenario)
        for key, value in moved.items():
            words = self.offered.get(key, ("",))
            if not (value in words if words else isinstance(value, (int, float))):
                raise UsageError(f"{key}: not among the values that this page moves")
        return moved

    def frame(
        self, moved: Moved, signals: Sequence[str], rest: bool, wanted: bool
    ) -> dict[str, Any]:
        """Tracks, curves and numbers for the page.

        At rest (`rest`) the scenario is loaded as `podusv run` does it, and findings are added;
        with `wanted`, the knobs too. While values move, numbers are put into a scenario that is
        loaded already, as draws of a study are. `signals` are those of the curves.
        """
        began = time.thread_time()
        if rest or wanted:
            # The file may have been edited: nothing that was made of its earlier state may stay.
            self._bases.clear()
            self._puts.clear()
            loaded = self.load(moved)
            base = self._base_of(loaded)
            cases = base.cases
        else:
            base, cases = self._moving(moved)
        scenario = next(iter(cases.values())).scenario
        steps = scenario.time_grid().steps
        if steps > MOST_STEPS:
            raise UsageError(f"{steps} steps; a page follows at most {MOST_STEPS}: simulate less")
        runs, findings, numbers = list[PastRun](), dict[str, list[str]](), {}
        for label, recording in self._recordings(cases, rest).items():
            case = cases[label]
            if rest:
                recording, _ = add_derived(case, recording)
                for found in (*find_before_run(case), *postflight(case.scenario, recording)):
                    findings.setdefault(str(found), []).append(label)
            numbers[label] = summary(case, recording, Extras())
            runs.append(past_run_of(label, case, recording, numbers[label], base.claims))
        shown = dress_runs(runs)
        told: dict[str, Any] = {
            "chase": chase(shown, FRAMES),
            "curves": traces(shown, [n for n in signals or FIRST if any(r.has(n) for r in shown)]),
            "numbers": _table(scenario, numbers),
            "endings": {r.label: r.recording.message for r in runs if r.recording.message},
            "limits": {label: limits_in_words(numbers[label]) for label in numbers},
            "verdicts": verdicts_on(base.claims, runs, cases, at_rest=rest),
            "command": self.command(moved, [*cases]),
        }
        if rest:
            findings |= {sentence: [*cases] for sentence in base.unread}
            told["findings"] = [[text, labels] for text, labels in findings.items()]
        if wanted:
            known = list(
                dict.fromkeys(n for r in shown for n in r.signals if r.signal(n).ndim == 1)
            )
            told |= {
                "controls": [asdict(c) for c in self.controls(loaded.scenario)],
                "signals": known,
                "name": loaded.scenario.name,
                "kinds": self.kinds,
                "several": base.several,
                "alone": self._labels[0] if len(self._labels) == 1 else "",
                "added": [x for x in cases if x not in self._labels],
            }
        return told | {"cpu": time.thread_time() - began}

    def _recordings(self, cases: Mapping[str, Case], rest: bool) -> dict[str, Recording]:
        """A run of each law by label, several at once.

        A law whose own values did not move keeps its run.
        """
        compiled = next(iter(cases.values())).scenario.simulation.compiled
        if rest:
            for case in cases.values():
                warm_up(case)
        # A frozen case holds its run in its own dictionary, as `cached_property` does.
        missing = [case for case in cases.values() if rest or "run" not in vars(case)]
        for case, recording in zip(
            missing, run_together([case.plan for case in missing], compiled=compiled), strict=True
        ):
            if recording.status == "interrupted":
                raise KeyboardInterrupt  # which a march takes for its own end
            vars(case)["run"] = recording
        return {label: vars(case)["run"] for label, case in cases.items()}

    def margins(self, moved: Moved) -> dict[str, Any]:
        """The margins of every law's loops, about the steady motion at the end of the run."""
        loaded = self.load(moved)
        cases = self._base_of(loaded).cases
        return {"margins": {label: margins_of(case) for label, case in cases.items()}}

    def report(self, moved: Moved) -> dict[str, Any]:
        """The report of what is shown, made as `podusv compare` does it: its file and its HTML."""
        request = Request(
            self.assignments(moved),
            plugins=self.files,
            trust=self.trust,
            force=True,
            argv=shlex.split(self.command(moved, self._labels)),
        )
        done = compare([Path(self.source)], request)
        if done.status == "interrupted":
            raise KeyboardInterrupt
        page = done.folder / "report.html"
        return {"file": str(page.resolve()), "page": page.read_text("utf-8")}

    def _base_of(self, loaded: Loaded) -> Base:
        """What is reused as long as no word changes: cases, and claims on these laws."""
        cases = {n: loaded.case(s) for n, s in self.singles(loaded.scenario).items()}
        claims, unread = list[ParsedClaim](), tuple[str, ...]()
        try:
            claims = claims_about(parse_claims(loaded), [*cases])
        except ScenarioError as error:  # a law of another kind may lack what a claim is about
            unread = tuple(map(str, error.faults))
        several = bool(loaded.scenario.controllers)
        return Base(cases, claims, unread, "nominal" in loaded.root.mapping, several)

    def _moving(self, moved: Moved) -> tuple[Base, dict[str, Case]]:
        """The base of the moved words, and a case for each law, by label.

        The moved numbers are put into the cases.
        """
        words = {k: x for k, x in moved.items() if isinstance(x, str) or _is_loaded(route(k))}
        known = json.dumps(words)
        # Only the last base is kept: words change seldom.
        if known not in self._bases:
            self._bases = {known: self._base_of(self.load(words))}
        base = self._bases[known]
        return base, {
            label: self._put(label, case, moved, words, base) for label, case in base.cases.items()
        }

    def _put(self, label: str, case: Case, moved: Moved, words: Moved, base: Base) -> Case:
        """The case of the law `label` with the moved numbers put in. Raises ScenarioError.

        `words` are moved values that are no numbers; `base` was loaded with them already.
        """
        new: dict[Route, Any] = {}
        for key, number in moved.items():
            steps = route(key)
            if steps[0] == "controllers" and steps[1] == label:
                new["controller", *steps[2:]] = number
            elif steps[0] != "controllers" and key not in words:
                new[steps] = number
                if (
                    steps[0] == "vessel" and not base.has_nominal
                ):  # the law is told what the hull is
                    new["nominal", *steps[1:]] = number
        before, same = self._puts.get(label, (None, case))
        if before == (words, new):
            return same  # and its run: the values of another law move
        try:
            scenario = with_values(case.scenario, new) if new else case.scenario
        except ValueRefused as error:
            own = f"controllers.{label}" if base.several else "controller"
            place, _, said = str(error).partition(": ")  # where no single value is to blame
            key = dotted_key(error.steps).replace("controller", own, 1) or place
            text = str(error) if error.steps else said
            raise ScenarioError([Fault(Mark(self.source), key, text)]) from error
        made, path, approach = (Case.of(scenario), scenario.path, scenario.controller.approach())
        seen = {
            "length": scenario.vessel.length,
            "beam": scenario.vessel.beam,
            "waypoints": tuple(map(tuple, path.waypoints())),
            "circles": tuple(map(tuple, path.circles())),
            "path_end": scenario.passed_by(1.0),
            "path_steady": scenario.passed_by(1.0 - scenario.metrics.steady_fraction),
            "standoff": approach.standoff if approach else 0.0,
            "values": {**case.about.values, "path": path.model_dump(mode="json")},
        }
        vars(made)["about"] = case.about.model_copy(update=seen)  # all of it takes as long as a run
        self._puts[label] = (words, new), made
        return made

    def command(self, moved: Moved, labels: Sequence[str]) -> str:
        """The command line that makes the same runs, of the laws with these labels."""
        verb = "compare" if len(labels) > 1 else "run"
        only = ["--controller", labels[0]] if self.laws and len(labels) == 1 else []
        sets = [word for text in self.assignments(moved) for word in ("--set", text)]
        plugins = [word for file in self.files for word in ("--plugin", file)]
        trust = ["--trust"] if self.trust else []
        return shlex.join(["podusv", verb, self.source, *only, *sets, *plugins, *trust])

    @cached_property
    def kinds(self) -> tuple[str, ...]:
        """The kinds of laws that may be added."""
        return tuple(kinds_of(type(self.load({}).scenario), "controller"))

    @cached_property
    def _labels(self) -> tuple[str, ...]:
        return self.load({}).scenario.labels()

    def save(self, moved: Moved, name: Any) -> dict[str, Any]:
        """Write what differs into NAME.yaml in this folder; return file, text and a command for it.

        It is written only if it loads to the very scenario that is shown. Raises UsageError for a
        bad name, StorageError where the file is there or would load to something else.
        """
        if not re.fullmatch(r"\w[\w-]*", str(name)):
            raise UsageError(f"{name!r} is no name; letters, digits, _ and -")
        file, loaded = Path(f"{name}.yaml"), self.load(moved)
        changed: dict[str, Any] = {}
        for key in [text.partition("=")[0] for text in self.assignments(moved)]:
            steps, inner, node = route(key), changed, loaded.root
            # A list is written whole, as no file can change one item of another's.
            end = next((i for i, step in enumerate(steps) if isinstance(step, int)), len(steps))
            for step in steps[: end - 1]:
                inner, node = inner.setdefault(str(step), {}), node.mapping[str(step)]
            inner[str(steps[end - 1])] = plain(node.mapping[str(steps[end - 1])])
        base = self.source if self.source.startswith("podusv:") else relative_path(self.source)
        text = yaml_text({"extends": base, **changed})
        own = {name: getattr(loaded.scenario, name) for name in ("name", "description")}
        new = load_text(text, str(file), (), (), self.files, of_files(self.trust)).scenario
        if new.model_copy(update=own) != loaded.scenario:
            raise StorageError(f"{file}: what differs does not load to what is shown")
        try:
            with open(file, "x", encoding="utf-8") as out:  # never over another
                out.write(text)
        except FileExistsError:
            raise StorageError(f"{file} is there already; take another name") from None
        verb = "compare" if len(self.singles(loaded.scenario)) > 1 else "run"
        plugins = "".join(f" --plugin {shlex.quote(name)}" for name in self.files)
        command = f"podusv {verb} {file}{plugins}"
        return {"file": str(file.resolve()), "text": text, "command": command}


def _refusal(sentence: str) -> dict[str, Any]:
    """An answer that says why there is none."""
    return {"refused": [{"key": "", "text": sentence}]}


def _is_loaded(steps: Route) -> bool:
    """Whether a number cannot be put into a scenario that is loaded already."""
    return steps[0] in WHOLE or steps[: len(LINK)] == LINK


def assignments_of(moved: Moved) -> list[str]:
    """Moved values as `--set` takes them, KEY=VALUE; words stand without quotes."""
    return [
        f"{key}={value if isinstance(value, str) else json.dumps(value)}"
        for key, value in moved.items()
    ]


def _table(scenario: Scenario, numbers: Mapping[str, Mapping[str, float]]) -> list[dict[str, Any]]:
    """The headline metrics: name, words, unit, and a number or a word for each run.

    `numbers` are the metrics by label.
    """
    first = [m.about for m in headlines_first(scenario.known_metrics()) if m.headline]
    return [
        {
            "name": a.name,
            "row": a.row,
            "unit": "" if a.unit == "1" else a.unit,
            "values": [
                own[a.name] if math.isfinite(own.get(a.name, math.nan)) else a.undefined_word
                for own in numbers.values()
            ],
        }
        for a in first
        if any(a.name in own for own in numbers.values())
    ]
