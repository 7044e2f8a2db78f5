"""How large a run will be, and what cannot be meant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from podusv_cli.core.quantities import bytes_in_words, time_in_words
from podusv_cli.engine.simulate import names
from podusv_cli.paths.base import TARGET
from podusv_cli.scenario.load import resolved_yaml, values
from podusv_cli.scenario.messages import Check
from podusv_cli.scenario.model import Scenario, Simulation
from podusv_cli.scenario.yaml_text import MAX_CHARACTERS, MAX_NODES
from podusv_cli.theory import monitor

NUMBER = 8  # bytes
MOST_STEPS = 10**8
MOST_CONTENT = 4 * 10**9  # bytes; what podusv reads back
MOST_RUNS = 1000  # of a comparison; the manifest of 1 300 with long names would be refused
ESCAPED, LINE = 10, 60  # characters that one may become in resolved.yaml; of a key, at the most
HELD = 256 * 2**20  # bytes of a log that is held in memory; a larger one is made on the disk
WORKED = 64 * 2**20  # bytes of a larger one that are worked on at a time
# Rough costs on one core, see benchmarks/results.md: a step, a step's part for each number of the
# law's memory, both with machine code and in plain Python; and what a byte of log takes to be
# watched and written.
STEP, MEMORY, PLAIN, BYTE = 1e-6, 6e-9, 5.0e2, 13e-9  # s, s, times, s
START = 0.5  # s, of a run of no steps
PROCESS = 150 * 10**6  # bytes of memory without any log
COMPRESSED = 0.7  # of its content is what a compressed log takes on the disk
LEAST_COMPRESSED = 0.2  # what even a dull one takes


@dataclass(frozen=True)
class Size:
    """What a run of a scenario amounts to; but for `steps`, `rows` and `content` rough guesses.

    `content` is what the log's numbers take, `disk` its file [bytes]; `scratch` is what lies on the
    disk until the run is made, where memory does not hold it.
    """

    steps: int
    rows: int
    content: int
    seconds: float
    scratch: int
    compressed: bool

    @property
    def disk(self) -> float:
        """Of the finished log."""
        return self.content * (COMPRESSED if self.compressed else 1.0)

    @property
    def least(self) -> float:
        """Of the finished log at the very least."""
        return self.content * (LEAST_COMPRESSED if self.compressed else 1.0)

    @property
    def memory(self) -> float:
        """Of the process at its peak."""
        return PROCESS + (WORKED if self.scratch else self.content)

    @property
    def needed(self) -> float:
        """For this run alone."""
        return needed([self], 1)

    def __str__(self) -> str:
        """Time, memory and disk in words."""
        memory, disk = bytes_in_words(self.memory), bytes_in_words(self.disk)
        return f"about {time_in_words(self.seconds)}, {memory} of memory and {disk} of disk"


def estimate(scenario: Scenario) -> Size:
    """The size of one run, with `controller`; nothing is allocated that grows with it."""
    grid, law = scenario.time_grid(), scenario.controller
    loop, sampled = scenario.closed_loop(), scenario.control.period > 0
    monitored = len(monitor.signals(loop, sampled=sampled)) if scenario.log.monitor else 0
    columns = len(names(loop)) - len(TARGET[2:]) + monitored
    content = grid.rows * columns * NUMBER
    step = STEP + MEMORY * sum(size for _, size in law.slots())
    pace = 1.0 if scenario.simulation.compiled else PLAIN
    seconds = START + grid.steps * step * pace + content * BYTE
    beside = len(TARGET[2:]) + (len(monitor.UNLOGGED) if monitored else 0)
    compress = scenario.log.compress
    scratch = content + grid.rows * beside * NUMBER if content > HELD and not compress else 0
    return Size(grid.steps, grid.rows, content, seconds, scratch, compress)


def needed(sizes: Sequence[Size], at_once: int) -> float:
    """Bytes that have to be free on the disk for some runs, so many of them made at once."""
    scratch = sorted(size.scratch for size in sizes)[-at_once:]
    return sum(size.least for size in sizes) + sum(scratch)


def largest(scenario: Scenario) -> Size:
    """Of the runs of a comparison the one with the largest log."""
    return max(map(estimate, scenario.singles().values()), key=lambda size: size.content)


def limits(
    allow_large: bool = False, *, read_back: bool = False, insist: str = "--allow-large"
) -> Check:
    """A check, for `load`, that a scenario is not too large; `insist` is how to run it even so.

    A log that is to be read back must not be larger than that allows, whatever is allowed, nor
    may one hold no more than the first instant.
    """

    def look(scenario: Scenario) -> list[tuple[str, str]]:
        if scenario.misfits():
            return []
        if read_back and len(scenario.controllers) > MOST_RUNS:
            return [("controllers", _too_many(len(scenario.controllers)))]
        if unreadable := _unreadable(scenario):
            return [unreadable]
        size = largest(scenario)
        if scenario.log.every > size.steps:
            return [("log.every", _too_thin(size.steps))]
        if size.steps > MOST_STEPS and not allow_large:
            return [_too_long(scenario.simulation, size, insist)]
        if size.content > MOST_CONTENT and (read_back or not allow_large):
            return [_too_full(scenario.log.every, size, "" if read_back else insist)]
        if size.content > HELD and scenario.log.compress:
            return [("log.compress", _too_large_to_compress(scenario.log.every, size))]
        return []

    return look


def _unreadable(scenario: Scenario) -> tuple[str, str] | None:
    """The largest value of a scenario whose resolved.yaml podusv would refuse to read."""
    laws = {f"controllers.{label}": law for label, law in scenario.controllers.items()}
    for place, law in ({"controller": scenario.controller} | laws).items():
        single = scenario.alone().model_copy(update={"controller": law})
        if found := _too_much(single):
            key, text = found
            return key.replace("controller", place, 1), text
    return None


def _too_much(scenario: Scenario) -> tuple[str, str] | None:
    leaves, nodes = values(scenario), _nodes(scenario.model_dump())
    letters = sum(len(str(leaf)) for leaf in leaves.values())
    if nodes > MAX_NODES:
        key = max(leaves, key=lambda key: _nodes(leaves[key]))
        return key, _beyond(f"{nodes:,} values", MAX_NODES, "give fewer here")
    if ESCAPED * letters + LINE * nodes < MAX_CHARACTERS:
        return None  # surely; to write it out takes as long as to load it
    if (length := len(resolved_yaml(scenario))) > MAX_CHARACTERS:
        key = max(leaves, key=lambda key: len(str(leaves[key])))
        return key, _beyond(f"{length:,} characters", MAX_CHARACTERS, "shorten this")
    return None


def _nodes(content: Any) -> int:
    """How many keys and values the reader of resolved.yaml counts."""
    if isinstance(content, dict):
        return 1 + sum(1 + _nodes(inner) for inner in content.values())
    return 1 + sum(map(_nodes, content)) if isinstance(content, tuple) else 1


def _beyond(amount: str, most: int, remedy: str) -> str:
    text = f"with every default written out the scenario has {amount}, more than the {most:,} that "
    return f"{text}podusv reads back; {remedy}"


def _too_many(runs: int) -> str:
    text = (
        f"has {runs:,} runs, more than the {MOST_RUNS:,} that podusv reads back as one comparison"
    )
    return f"{text}; make several scenarios of it"


def _too_thin(steps: int) -> str:
    text = f"the run has {steps} steps, so that its first instant alone would be logged"
    return f"{text}; must be at most {steps}"


def _too_long(run: Simulation, size: Size, insist: str) -> tuple[str, str]:
    text = f"{run.duration:g} s in steps of {run.step:g} s are {size.steps:.3g} steps, more than "
    remedy = f"simulate less or take a longer step{_or_insist(insist)}"
    return run.outlier, f"{text}{MOST_STEPS:.0e}: {size}; {remedy}"


def _too_full(every: int, size: Size, insist: str) -> tuple[str, str]:
    content, most = bytes_in_words(size.content), bytes_in_words(MOST_CONTENT)
    text = f"the log would hold {content} in {size.rows:.3g} rows, more than the {most} that "
    fitting = every * -(-size.content // MOST_CONTENT)
    remedy = f"log less often (every: {fitting}){_or_insist(insist)}"
    return "log.every", f"{text}podusv reads back: {size}; {remedy}"


def _too_large_to_compress(every: int, size: Size) -> str:
    content, most = bytes_in_words(size.content), bytes_in_words(HELD)
    remedy = f"leave it uncompressed or log less often (every: {every * -(-size.content // HELD)})"
    return f"the log would hold {content}, more than the {most} that can be compressed; {remedy}"


def _or_insist(insist: str) -> str:
    return f", or insist with {insist}" if insist else ""
