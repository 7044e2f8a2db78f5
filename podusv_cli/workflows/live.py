"""`podusv live`: what a page shows of a scenario whose values a person moves."""

from __future__ import annotations

import json
import math
import os
import re
import shlex
import time
import traceback
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from podusv_cli.core.errors import PodusvError, ScenarioError, StorageError, UsageError, in_a_line
from podusv_cli.core.past_run import PastRun
from podusv_cli.core.phrases import unknown_word
from podusv_cli.engine.running.simulate import run
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
from podusv_cli.scenario.plugins import of_files
from podusv_cli.scenario.resolved import yaml_text
from podusv_cli.scenario.yaml_tree import Fault, Mark, Route, dotted_key, plain, route
from podusv_cli.workflows.execute import Stopwatch, monitor_case, simulate_case, summary

FRAMES = 300  # places of a track on the map
WHOLE = ("simulation", "control", "log", "metrics")  # sections of which numbers are loaded, too
MOST_STEPS = 400_000  # a run of more does not follow a hand
Moved = Mapping[str, float | str]  # values by key


@dataclass
class Live:
    """A scenario's file, what `--set` gave beside it, and the laws that are shown."""

    source: str
    given: Sequence[str] = ()
    laws: Sequence[str] = ()
    trust: bool = False  # whether plug-in files of somebody's folder may be executed
    offered: dict[str, tuple[str, ...]] = field(default_factory=dict)  # words by key; none: numbers
    _puts: dict[str, tuple[Any, Case]] = field(default_factory=dict)  # the last one of each law
    _bases: dict[str, tuple[dict[str, Case], bool]] = field(default_factory=dict)  # by words

    def load(self, moved: Moved) -> Loaded:
        """The scenario with the values moved. Raises ScenarioError."""
        moves, checks = [*self.given, *assignments_of(moved)], (unknown_codes, limits())
        return load(self.source, moves, checks, plugged=of_files(self.trust))

    def singles(self, scenario: Scenario) -> dict[str, Scenario]:
        """The scenario of each law that is shown, by label. Raises UsageError."""
        known = scenario.singles()
        for law in self.laws:
            if law not in known:
                raise UsageError(unknown_word(f"controller {law!r}", law, known))
        return {law: known[law] for law in self.laws or known}

    def controls(self, scenario: Scenario) -> list[Knob]:
        """All that may be moved."""
        several = scenario.controllers
        laws = (
            [f"controllers.{law}" for law in self.singles(scenario)] if several else ["controller"]
        )
        found = controls(scenario, laws)
        self.offered |= {control.key: control.choices for control in found}
        return found

    def answer(self, name: str, asked: Mapping[str, Any]) -> dict[str, Any]:
        """What the page asks for; what podusv refuses as `refused`, sentences by key."""
        wanted = ("moved", "name") if name == "save" else ("moved", "signals", "rest", "controls")
        if lacking := [key for key in wanted if key not in asked]:
            return {"refused": [{"key": "", "text": f"the question lacks {', '.join(lacking)}"}]}
        try:
            moved = self.check_offered(asked["moved"])
            if name == "save":
                return self.save(moved, str(asked["name"]))
            return self.frame(moved, asked["signals"], asked["rest"], asked["controls"])
        except ScenarioError as error:
            faults = [fault for fault in error.faults if isinstance(fault, Fault)]
            self.offered |= {
                f.key: () for f in faults if f.text.startswith("missing; must be a number")
            }
            return {"refused": [{"key": fault.key, "text": fault.text} for fault in faults]}
        except (PodusvError, OSError) as error:
            return {"refused": [{"key": "", "text": str(error)}]}
        except Exception as error:  # of podusv, of a law, or of a question that no page of it asks
            traceback.print_exc()
            return {"refused": [{"key": "", "text": f"{in_a_line(error)}; the terminal has more"}]}

    def check_offered(self, moved: Mapping[str, Any]) -> Moved:
        """Numbers and words at keys that the page was offered. Raises UsageError for others.

        So no page can name a plug-in or a file. Of a shared address, kinds come before their keys.
        """
        if not moved.keys() <= self.offered.keys():
            kinds = {key: kind for key, kind in moved.items() if key.endswith(".kind")}
            known = kinds if kinds.keys() <= self.offered.keys() else {}
            self.controls(self.load(known).scenario)
        for key, value in moved.items():
            words = self.offered.get(key, ("",))
            if not (value in words if words else isinstance(value, (int, float))):
                raise UsageError(f"{key}: not among the values that this page moves")
        return moved

    def frame(
        self, moved: Moved, signals: Sequence[str], rest: bool, wanted: bool
    ) -> dict[str, Any]:
        """Tracks, curves and numbers; at rest also findings, with `wanted` the controls too.

        At rest the scenario is loaded as `podusv run` does it. While values move, numbers are put
        into one that is loaded already, as draws of a study are.
        """
        began = time.thread_time()
        if rest or wanted:
            self._bases.clear()
            self._puts.clear()
            loaded = self.load(moved)
            cases = {n: loaded.case(s) for n, s in self.singles(loaded.scenario).items()}
        else:
            cases = self._moving(moved)
        scenario = next(iter(cases.values())).scenario
        steps = scenario.time_grid().steps
        if steps > MOST_STEPS:
            raise UsageError(f"{steps} steps; a page follows at most {MOST_STEPS}: simulate less")
        runs, findings, numbers = [], dict[str, list[str]](), {}
        for label, case in cases.items():
            if rest:
                recording, _ = monitor_case(case, simulate_case(case, Stopwatch()))
                for found in (*find_before_run(case), *postflight(case.scenario, recording)):
                    findings.setdefault(str(found), []).append(label)
            else:
                recording = vars(case).get("run") or run(
                    case.plan, compiled=scenario.simulation.compiled
                )
                vars(case)["run"] = recording
            if recording.status == "interrupted":
                raise KeyboardInterrupt  # which a march takes for its own end
            numbers[label] = summary(case, recording, Extras())
            runs.append(PastRun(label, case.about, recording, plugins=scenario.plugged))
        shown = dress_runs(runs)
        told: dict[str, Any] = {
            "chase": chase(shown, FRAMES),
            "curves": traces(shown, [n for n in signals or FIRST if any(r.has(n) for r in shown)]),
            "numbers": _table(scenario, numbers),
            "endings": {r.label: r.recording.message for r in runs if r.recording.message},
            "command": self.command(moved),
        }
        if rest:
            told["findings"] = [[text, labels] for text, labels in findings.items()]
        if wanted:
            known = list(
                dict.fromkeys(n for r in shown for n in r.signals if r.signal(n).ndim == 1)
            )
            told |= {
                "controls": [asdict(c) for c in self.controls(loaded.scenario)],
                "signals": known,
                "name": loaded.scenario.name,
            }
        return told | {"cpu": time.thread_time() - began}

    def _moving(self, moved: Moved) -> dict[str, Case]:
        """A case for each law, whose numbers are put into one that was loaded with the words."""
        words = {k: x for k, x in moved.items() if isinstance(x, str) or route(k)[0] in WHOLE}
        known = json.dumps(words)
        if known not in self._bases:
            loaded = self.load(words)
            cases = {n: loaded.case(s) for n, s in self.singles(loaded.scenario).items()}
            self._bases = {known: (cases, "nominal" in loaded.root.mapping)}
        cases, told = self._bases[known]
        return {label: self._put(label, case, moved, words, told) for label, case in cases.items()}

    def _put(self, label: str, case: Case, moved: Moved, words: Moved, told: bool) -> Case:
        new: dict[Route, Any] = {}
        for key, number in moved.items():
            steps = route(key)
            if steps[0] == "controllers" and steps[1] == label:
                new["controller", *steps[2:]] = number
            elif steps[0] != "controllers" and key not in words:
                new[steps] = number
                if steps[0] == "vessel" and not told:  # the law is told what the hull is
                    new["nominal", *steps[1:]] = number
        before, same = self._puts.get(label, (None, case))
        if before == (words, new):
            return same  # and its run: the values of another law move
        try:
            scenario = with_values(case.scenario, new) if new else case.scenario
        except ValueRefused as error:
            own = f"controllers.{label}" if self.laws or self._labels[1:] else "controller"
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
            "standoff": approach.standoff if approach else 0.0,
            "values": {**case.about.values, "path": path.model_dump(mode="json")},
        }
        vars(made)["about"] = case.about.model_copy(update=seen)  # all of it takes as long as a run
        self._puts[label] = (words, new), made
        return made

    def command(self, moved: Moved) -> str:
        """The command line that makes the same runs."""
        verb = "compare" if len(self.laws or self._labels) > 1 else "run"
        only = ["--controller", self.laws[0]] if len(self.laws) == 1 else []
        sets = [word for text in (*self.given, *assignments_of(moved)) for word in ("--set", text)]
        return shlex.join(["podusv", verb, self.source, *only, *sets])

    @cached_property
    def _labels(self) -> tuple[str, ...]:
        return self.load({}).scenario.labels()

    def save(self, moved: Moved, name: str) -> dict[str, Any]:
        """Write what differs into NAME.yaml in this folder. Raises StorageError where it is there.

        It loads to the very scenario that is shown, or is written whole.
        """
        if not re.fullmatch(r"\w[\w-]*", name):
            raise UsageError(f"{name!r} is no name; letters, digits, _ and -")
        file, loaded = Path(f"{name}.yaml"), self.load(moved)
        changed: dict[str, Any] = {}
        for key in [*(text.partition("=")[0] for text in self.given), *moved]:
            steps, inner, node = route(key), changed, loaded.root
            end = next((i for i, step in enumerate(steps) if isinstance(step, int)), len(steps))
            for step in steps[: end - 1]:
                inner, node = inner.setdefault(str(step), {}), node.mapping[str(step)]
            inner[str(steps[end - 1])] = plain(node.mapping[str(steps[end - 1])])
        base = self.source if self.source.startswith("podusv:") else os.path.relpath(self.source)
        text = yaml_text({"extends": base, **changed})
        own = {name: getattr(loaded.scenario, name) for name in ("name", "description")}
        new = load_text(text, str(file), plugged=of_files(self.trust)).scenario
        if new.model_copy(update=own) != loaded.scenario:
            raise StorageError(f"{file}: what differs does not load to what is shown")
        try:
            with open(file, "x", encoding="utf-8") as out:  # never over another
                out.write(text)
        except FileExistsError:
            raise StorageError(f"{file} is there already; take another name") from None
        verb = "compare" if len(self.laws or self._labels) > 1 else "run"
        return {"file": str(file.resolve()), "text": text, "command": f"podusv {verb} {file}"}


def assignments_of(moved: Moved) -> list[str]:
    """Values as `--set` takes them."""
    return [
        f"{key}={value if isinstance(value, str) else json.dumps(value)}"
        for key, value in moved.items()
    ]


def _table(scenario: Scenario, numbers: Mapping[str, Mapping[str, float]]) -> list[dict[str, Any]]:
    """The headline metrics: name, words, unit, and a number or a word for each run."""
    first = [m.about for m in headlines_first(scenario.known_metrics()) if m.about.headline]
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
