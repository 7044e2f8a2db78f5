"""Estimates of time, memory and disk of a run, and limits on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice

from podusv_cli.core.earth import PLACE
from podusv_cli.core.errors import LawError
from podusv_cli.core.quantities import bytes_in_words, time_in_words
from podusv_cli.engine.loop.plan import Plan
from podusv_cli.scenario.conflicts import Conflicts
from podusv_cli.scenario.load import Check, Loaded
from podusv_cli.scenario.model import Scenario
from podusv_cli.theory import monitor

NUMBER = 8  # bytes
# 100 s of computing with a small law, see STEP.
MOST_STEPS = 10**8
MOST_CONTENT = 4 * 10**9  # bytes of log that podusv reads back
HELD = 256 * 2**20  # bytes of a log that is held in memory; a larger one is made on the disk
WORKED = 64 * 2**20  # bytes of a larger log that are in memory at a time
# Rough costs on one core (benchmarks/results.md): of a step, of a step for each number of the
# law's memory, for each cosine of the sea, how many times longer they take in plain Python, and of
# a byte of log.
STEP, MEMORY, COSINE, PLAIN, BYTE = 1e-6, 6e-9, 15e-9, 5.0e2, 13e-9  # s, s, s, times, s
START = 0.5  # s, of a run of no steps
PROCESS = 150 * 10**6  # bytes of memory without any log
COMPRESSED = 0.7  # typical size of a compressed log over that of its content
LEAST_COMPRESSED = 0.2  # the same for a log that compresses very well


@dataclass(frozen=True)
class Size:
    """The size of a run; all but `steps`, `rows` and `content` are rough estimates.

    `content` is what the log's numbers take [bytes]. `scratch` is what lies on the disk during the
    run because memory does not hold it [bytes].
    """

    steps: int
    rows: int
    content: int
    seconds: float
    scratch: int
    compressed: bool

    @property
    def disk(self) -> float:
        """Bytes of the finished log."""
        return self.content * (COMPRESSED if self.compressed else 1.0)

    @property
    def least(self) -> float:
        """Bytes of the finished log if it compresses very well."""
        return self.content * (LEAST_COMPRESSED if self.compressed else 1.0)

    @property
    def memory(self) -> float:
        """Bytes of memory of the process at its peak."""
        return PROCESS + (WORKED if self.scratch else self.content)

    @property
    def bytes_needed(self) -> float:
        """Bytes that have to be free on the disk for this run."""
        return disk_needed([self], 1)

    def __str__(self) -> str:
        """Time, memory and disk in words."""
        memory, disk = bytes_in_words(self.memory), bytes_in_words(self.disk)
        return f"about {time_in_words(self.seconds)}, {memory} of memory and {disk} of disk"


def estimate(scenario: Scenario, plan: Plan) -> Size:
    """The size of a scenario's run with this plan, counted without allocating its arrays.

    Raises LawError as `plan.about`.
    """
    grid, about = plan.grid, plan.about
    monitored = len(monitor.signals(plan)) if scenario.log.monitor else 0
    logged = sum(name in about for name in plan.names)
    # Columns made after the run: of the monitor, and places on earth.
    derived = monitored + (len(PLACE) if scenario.origin else 0)
    content = grid.rows * (logged + derived) * NUMBER
    cosines = sum(part.cosines() for part in scenario.disturbances().values())
    step = STEP + MEMORY * len(plan.states["law"]) + COSINE * cosines
    pace = 1.0 if scenario.simulation.compiled else PLAIN
    seconds = START + grid.steps * step * pace + content * BYTE
    unlogged = len(plan.names) - logged + (len(monitor.UNLOGGED) if monitored else 0)
    compress = scenario.log.compress
    # A large log is written as it grows; compressed ones stay in memory.
    scratch = content + grid.rows * unlogged * NUMBER if content > HELD and not compress else 0
    return Size(grid.steps, grid.rows, content, seconds, scratch, compress)


def disk_needed(sizes: Sequence[Size], at_once: int) -> float:
    """Bytes that have to be free on the disk for these runs, `at_once` of them made at a time."""
    scratch = sorted(size.scratch for size in sizes)[-at_once:]
    # The least of each: a run is refused only where it surely does not fit.
    return sum(size.least for size in sizes) + sum(scratch)


def largest(loaded: Loaded) -> Size:
    """The size of the run with the largest log."""
    sizes = [estimate(loaded.scenario, plan) for plan in loaded.plans.values()]
    return max(sizes, key=lambda size: size.content)


def limits(
    allow_large: bool = False, *, read_back: bool = False, insist: str = "--allow-large"
) -> Check:
    """A check, for `load`, that a scenario is not too large.

    `allow_large` drops what may be dropped; `insist` is the option that allows it, "" for none. A
    log that is to be read back (`read_back`) must not be larger than podusv reads, even with
    `allow_large`.
    """

    insist = f", or insist with {insist}" if insist else ""

    def check_size(loaded: Loaded) -> list[tuple[str, str]]:
        """Key and message of the first limit that the scenario exceeds; a list of one or none."""
        try:
            return list(islice(_too_large(loaded, allow_large, read_back, insist), 1))
        except LawError:  # `clashes` says which signals
            return []

    return check_size


def _too_large(loaded: Loaded, allow_large: bool, read_back: bool, insist: str) -> Conflicts:
    """Key and message of each limit on steps and on the log's size [bytes] that is exceeded.

    Arguments as of `limits`; `insist` is the end of a message.
    """
    if not loaded.plans:  # values contradict each other
        return
    scenario, size = loaded.scenario, largest(loaded)
    if scenario.log.every > size.steps:
        only = f"the run has {size.steps} steps, so that its first instant alone would be logged"
        yield "log.every", f"{only}; must be at most {size.steps}"
    if size.steps > MOST_STEPS and not allow_large:
        run = scenario.simulation
        text = (
            f"{run.duration:g} s in steps of {run.step:g} s are {size.steps:.3g} steps, more than"
        )
        remedy = f"simulate less or take a longer step{insist}"
        yield run.outlier, f"{text} {MOST_STEPS:.0e}: {size}; {remedy}"
    if size.content > MOST_CONTENT and (read_back or not allow_large):
        most = f"more than the {bytes_in_words(MOST_CONTENT)} that podusv reads back: {size}"
        text = f"the log would hold {bytes_in_words(size.content)} in {size.rows:.3g} rows, {most}"
        remedy = _log_less(scenario.log.every, size, MOST_CONTENT)
        yield "log.every", f"{text}; {remedy}{'' if read_back else insist}"
    if size.content > HELD and scenario.log.compress:
        most = f"more than the {bytes_in_words(HELD)} that can be compressed"
        remedy = f"leave it uncompressed or {_log_less(scenario.log.every, size, HELD)}"
        yield "log.compress", f"the log would hold {bytes_in_words(size.content)}, {most}; {remedy}"


def _log_less(every: int, size: Size, most: int) -> str:
    """How to get below `most` bytes: the interval of logged steps that suffices."""
    return f"log less often (every: {every * -(-size.content // most)})"
