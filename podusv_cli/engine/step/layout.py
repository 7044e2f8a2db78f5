"""Where everything lies in the vectors of a closed loop."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, NamedTuple, get_type_hints

from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.core.plugins import TEXT
from podusv_cli.core.signal import DEMAND_SIZE, TARGET_SIZE

Function = Callable[..., None]


class Parts(NamedTuple):
    """The functions that the loop calls, each with its arguments.

    The time t, an instant's position, its weight in an integral [s], and whether an evaluation is
    one more at its instant or a stage within a step are numbers, all others vectors.
    """

    path: Annotated[Function, "t x place k table target shown"]
    locate: Annotated[Function, "t x s place k table"]
    disturbance: Annotated[Function, "t x k table b again stage"]
    law: Annotated[Function, "t x memory target k table tau rate signals work"]
    sample: Annotated[Function, "t x memory target k table"]
    actuator: Annotated[Function, "t x state demand k table tau rate signals"]
    after_saturation: Annotated[Function, "t x memory demand tau k table rate"]
    measurement: Annotated[Function, "t instant x b k table seen"]
    correct: Annotated[Function, "t seen state k table"]
    follow: Annotated[Function, "t seen tau state k table rate"]
    probe: Annotated[Function, "t weight s row k seen"]


NUMBERS = ("t", "instant", "weight", "again", "stage")
# The names of the arguments of every function, in the order in which the loop takes them.
SIGNATURES: dict[str, tuple[str, ...]] = {
    part: tuple(hint.__metadata__[0].split())
    for part, hint in get_type_hints(Parts, include_extras=True).items()
}


def spread(march: Any) -> Any:
    """A kernel whose first argument are the parts, as machine code takes it: part by part.

    Machine code has no named tuples of functions, so the text of an adapter is written out.
    """
    names, parts = march.__code__.co_varnames[1 : march.__code__.co_argcount], Parts._fields
    given = f"Parts({', '.join(parts)}), {', '.join(names)}"
    text = f"def {march.__name__}({', '.join((*parts, *names))}):\n    return march({given})"
    scope: dict[str, Any] = {"march": march, "Parts": Parts, "__name__": march.__module__}
    # The text is in no file, so those that look for a kernel's source look here
    scope[TEXT] = text
    exec(text, scope)  # noqa: S102
    return kernel(scope[march.__name__])


class Layout(NamedTuple):
    """Sizes, offsets and periods of a closed loop, all whole numbers."""

    states: int  # length of s
    estimate: int  # offset in s of the state that the law is given; 0: the true state
    place: int  # offset in s of where on its path the vessel is, see `paths.base`
    memory: int  # offset of the law's memory in s
    target: int  # numbers of the target that the law is given; more where it has a heading
    shown: int  # offsets in the row; of the target that the law is given, 0: the target itself
    signals: int
    demand: int
    tau: int
    b: int
    flow: int  # offset in the row of the current's speed and direction; 0: no actuator needs it
    flags: int
    sensed: int
    columns: int  # length of the row that is logged; behind it is the estimate before an instant
    steps: int
    log_every: int
    hold_every: int  # 0: the law acts continuously
    sample_every: int  # 0: the law takes no samples
    measured: int  # 1: the law is given an estimate from measurements
    update_first: int  # 1: a held law's memory takes a sample before the demand is formed
    follows: int  # 1: the path depends on where the vessel is, not on the time
    load_of_time: int  # 1: the disturbance depends on time alone
    wants_loads: int  # 1: the law is told which loads really act
    by_delay_line: int  # 1: demands reach the actuator by the delay line

    @property
    def width(self) -> int:
        """Length of a logged row: t, s, row."""
        return 1 + self.states + self.columns


STEPS = Layout._fields.index("steps")


class Vectors(NamedTuple):
    """Vectors of a closed loop: constants of every part, then what the march writes to."""

    path: Vector
    path_table: Vector
    disturbance: Vector
    disturbance_table: Vector
    law: Vector
    law_table: Vector
    actuator: Vector
    actuator_table: Vector
    measurement: Vector
    measurement_table: Vector
    estimator: Vector
    estimator_table: Vector
    vessel: Vector
    probe: Vector
    s: Vector
    row: Vector
    stages: Vector  # four rates and one intermediate state
    sensed: Vector  # what was measured, see `measurements.base`
    delay_line: Vector  # demands on their way to the actuator
    held: Vector  # t, x, target of the last sample; demand and signals that nobody reads
    work: Vector
    seen: Vector  # what the probe gathers
    under_way: Vector  # the instant that is under way; then 1 if the march has to stop
    log: Vector  # rows of t, s, row


DISTANCE = 6  # where the row has z_e (18), behind the target
BEFORE = 6  # numbers behind the logged row: the estimate before what an instant delivers
HELD_X, HELD_TARGET = 1, 7  # in `held`, behind the time of the sample
HELD_DEMAND = HELD_TARGET + TARGET_SIZE
HELD_SIGNALS = HELD_DEMAND + DEMAND_SIZE
STOP = 1  # in `under_way`


# All (count); h [s].
@kernel
def shift_state(count: int, s: Vector, h: float, ds: Vector, out: Vector) -> None:
    """out = s + h ds."""
    for i in range(count):
        out[i] = s[i] + h * ds[i]
