"""A run step by step: a demand in, an observation out."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from podusv_cli.components.controllers.schedule import Schedule
from podusv_cli.core.errors import UsageError
from podusv_cli.core.kernel import Vector
from podusv_cli.core.phrases import unknown_word
from podusv_cli.engine.loop.plan import Plan
from podusv_cli.engine.running.simulate import Marcher, marcher, ready
from podusv_cli.engine.running.stepped import MarchMark, SteppedRun
from podusv_cli.interface.border import with_short_traceback
from podusv_cli.interface.functions import open_run, request
from podusv_cli.interface.results import Run
from podusv_cli.interface.scenarios import Changes, Source, load_scenario
from podusv_cli.scenario.address import ValueRefused, with_values
from podusv_cli.scenario.load import Loaded
from podusv_cli.scenario.model import Scenario
from podusv_cli.workflows import run as running

Status = Literal["running", "finished", "diverged"]
MOST = 15_000  # demands of a session: a scenario with more is too long to be read back
FIRST = 2  # where a schedule of two rows has the demand of the first, which holds up to the second
COUNTS = {2: "two", 3: "three"}
DEMANDED = ("tau_u [N]", "tau_r [N m]", "tau_v [N]")


class Observation(NamedTuple):
    """What a controller is given at an instant.

    `state` is (x, y, psi, u, v, r) in m, rad, m/s and rad/s: the vessel's own, or the estimate
    where the scenario has sensors; it has not seen what they measure at this very instant. `target`
    is position, velocity and acceleration, north and east, in m, m/s and m/s2. `status` is
    "running" until the duration is over or a number is not finite. `loads` are (tau_u, tau_v,
    tau_r) in N and N m, which the actuator made of the demand as the period before ended; zeros at
    the begin. A law against windup asks for them. `heading` is what the path asks for, with its
    rates, in rad, rad/s and rad/s2; zeros of a path without one.
    """

    time: float
    state: Vector
    target: Vector
    status: Status
    loads: Vector
    heading: Vector


@dataclass(frozen=True, eq=False)
class Bookmark:
    """A place in a session, to come back to."""

    session: Session
    mark: MarchMark
    demands: tuple[tuple[float, ...], ...]
    status: Status


def open_session(
    source: Source, changes: Changes | None = None, *, period: float | None = None
) -> Session:
    """A scenario that waits for demands, in place of the controller that it names.

    A demand holds for `period` seconds, by default `control.period`: a whole number of steps.
    Raises ScenarioError, LawError, and UsageError for a period that is
    missing, that the scenario does not take, or that would come too often.

    >>> import podusv
    >>> session = podusv.open_session("podusv:own_vessel.yaml", period=0.1)
    >>> seen = session.observe()
    >>> while seen.time < 20.0:
    ...     seen = session.step((300.0 * (1.5 - seen.state[3]), 0.0))
    >>> session.close("straight_on", figures=False)
    <podusv run schedule: finished at 20 s, straight_on>
    """
    scenario, period = waiting(load_scenario(source, changes).scenario, period)
    plan, compiled = scenario.plan(), scenario.simulation.compiled
    ready(plan, compiled)
    return Session(scenario, period, plan, marcher(plan, compiled))


def waiting(scenario: Scenario, period: float | None) -> tuple[Scenario, float]:
    """One run of a scenario, with demands in place of its controller, and how long they hold [s].

    Raises UsageError where neither `period` nor the scenario says how long, or it does not fit.
    """
    single = next(iter(scenario.singles().values())) if scenario.open_choice else scenario.alone()
    period = single.control.period if period is None else period
    if not period:
        raise UsageError(
            "for how long does a demand hold? give period=0.1 [s], or the scenario a control.period"
        )
    if not math.isfinite(period):
        raise UsageError(f"period is {period}; give a finite time [s], as in period=0.1")
    still = ", 0" * len(single.actuator.limits())
    # A schedule of two rows, of which the first is written anew for each demand; the second comes
    # after the end of the run.
    ends = f"0.0{still}\n{2.0 * single.simulation.duration!r}{still}"
    held = single.model_copy(update={"controller": Schedule(between="hold", rows=ends)})
    try:
        return with_values(held, {("control", "period"): period}), period
    except ValueRefused as error:
        raise UsageError(str(error)) from error


class Session:
    """A run that goes on as far as there are demands; made by `open_session`.

    Its numbers have the same bits as those of a run of the same demands in one go, and that is what
    `close` writes.
    """

    def __init__(self, scenario: Scenario, period: float, plan: Plan, march: Marcher) -> None:
        """The run is at its begin; `plan` is the scenario's, and `march` that of one like it."""
        self.scenario, self.period = scenario, period
        grid = plan.grid
        self._status: Status = "running"
        self._every, self._demands = grid.hold_every, list[tuple[float, ...]]()
        if grid.steps > MOST * self._every:
            longest = MOST * period
            raise UsageError(
                f"open_session: simulation.duration {scenario.simulation.duration:g} s takes more "
                f"than {MOST:,} demands of {period:g} s; ask for at most {longest:g} s, or for a "
                "longer period"
            )
        self._metrics = scenario.metrics_of(plan)
        self._march = SteppedRun(plan, march, compiled=scenario.simulation.compiled)
        self._named = DEMANDED[: len(scenario.actuator.limits())]
        # A view: what is written there is what the march reads.
        self._demand = self._march.vectors.law_table[FIRST : FIRST + len(self._named)]

    @property
    def status(self) -> Status:
        """As in an `Observation`."""
        return self._status

    def metric(self, name: str) -> float:
        """A metric of the run so far, its last instant included; NaN where undefined.

        The part that counts as settled is that of the whole duration. Raises UsageError for a name
        that is no metric.
        """
        known, word = self._metrics.known, str(name)
        if word not in known:
            raise UsageError(
                f"session: {unknown_word(f'metric {name!r}', word, known, 'podusv list')}"
            )
        return float(self._metrics.one(word, self._march.gathered_so_far()[:, np.newaxis])[0])

    def observe(self) -> Observation:
        """The instant at which the next demand begins to act."""
        march = self._march
        target, heading = march.target(), march.heading()
        return Observation(march.time, march.state(), target, self._status, march.loads(), heading)

    @with_short_traceback
    def step(self, demand: Sequence[float] | Vector) -> Observation:
        """Hold a demand (tau_u [N], tau_r [N m]) for a period; the instant after it.

        Of an actuator that takes a sway force the demand is (tau_u, tau_r, tau_v [N]). Raises
        UsageError for a demand that is not so many finite numbers and for a session that is over;
        the session stays where it is.
        """
        given = self._check_demand(demand)
        grid, march = self._march.grid, self._march
        self._demand[:] = given
        self._demands.append(given)
        reach = len(self._demands) * self._every
        last = reach >= grid.steps
        with np.errstate(all="ignore"):
            # Past the last step, so that the end is logged as in a run in one go.
            fine = march.to(grid.steps + 1 if last else reach)
        self._status = ("finished" if last else "running") if fine else "diverged"
        return self.observe()

    def _check_demand(self, demand: Sequence[float] | Vector) -> tuple[float, ...]:
        """The demand as numbers: surge force [N], yaw moment [N m] and, if taken, sway force [N].

        Raises UsageError unless it is so many finite numbers, and after the end of the run.
        """
        if self._status != "running":
            raise UsageError(
                f"session: the run has {self._status} at t = {self._march.time:g} s and takes no "
                "more demands; close it, or go back with restore"
            )
        try:
            given = tuple(float(number) for number in demand)
        except (TypeError, ValueError):
            given = ()
        if len(given) != len(self._named) or not all(map(math.isfinite, given)):
            raise UsageError(
                f"session, t = {self._march.time:g} s: the demand is {demand!r}; give "
                f"{wanted_numbers(self._named)}"
            )
        return given

    def state(self) -> Bookmark:
        """The place in the run, for `restore`."""
        return Bookmark(self, self._march.mark(), tuple(self._demands), self._status)

    @with_short_traceback
    def restore(self, place: Bookmark) -> Observation:
        """Go on from a place in this run; what came after it is forgotten.

        Raises UsageError for a place in another session, and for what is none.
        """
        if not isinstance(place, Bookmark):
            raise UsageError(f"session: restore goes back to what state() gave, found {place!r}")
        if place.session is not self:
            raise UsageError(
                "session: restore goes back to a place in the same session; this place is in "
                "another one, so restore it there"
            )
        self._march.back(place.mark)
        self._demands, self._status = [*place.demands], place.status
        return self.observe()

    @property
    def log(self) -> dict[str, Vector]:
        """Every signal that is logged so far, by name; a copy, which `restore` does not change."""
        return {name: signal.copy() for name, signal in self._march.recording().signals.items()}

    @with_short_traceback
    def close(
        self,
        out: str | os.PathLike[str] | None = None,
        *,
        force: bool = False,
        figures: bool = True,
    ) -> Run:
        """Write the run as far as it went into a folder, as `podusv run` does it.

        The scenario in it has the demands as a law `schedule`, so `podusv rerun` repeats it. Raises
        UsageError where no demand was given, and StorageError; then the session is still there.
        """
        if not self._demands:
            raise UsageError("session: nothing has been simulated yet; give it a demand with step")
        given = schedule_demands(self.scenario, self.period, self._demands)
        return open_run(running.run_loaded(given, request(out, force, figures)).folder)


def wanted_numbers(named: Sequence[str]) -> str:
    """What a demand is to be: `two finite numbers, tau_u [N] and tau_r [N m]`."""
    *first, last = named
    return f"{COUNTS[len(named)]} finite numbers, {', '.join(first)} and {last}"


def schedule_demands(
    scenario: Scenario, period: float, demands: Sequence[tuple[float, ...]]
) -> Loaded:
    """The scenario with a law that holds each of `demands` for `period` [s], and then ends."""
    run, every = scenario.simulation, scenario.time_grid().hold_every
    steps = min(len(demands) * every, scenario.time_grid().steps)
    # The last demand has rows at the end and after it, so that the end is no end of the schedule.
    held = [*demands, demands[-1], demands[-1]]
    times = [k * every * run.step for k in range(len(held))]
    rows = [", ".join(map(repr, (t, *demand))) for t, demand in zip(times, held, strict=True)]
    changes = {
        "control.period": period,
        "simulation.duration": min(len(demands) * every * run.step, run.duration),
        # A session that ends early may have fewer steps than that, which loading refuses.
        "log.every": min(scenario.log.every, steps),
        "controller": {"kind": "schedule", "between": "hold", "rows": "\n".join(rows)},
    }
    return load_scenario(scenario, changes, silent=True)  # another law is the purpose
