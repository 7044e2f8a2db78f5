"""Operations of a law, counted: by hand for a small kernel, and by differences for the laws."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from podusv_cli.components.paths.line import Line
from podusv_cli.components.paths.sinusoid import Sinusoid
from podusv_cli.core.elementary import cos_sin
from podusv_cli.core.kernel import kernel, scratch
from podusv_cli.core.kinematics import direction
from podusv_cli.engine.loop.recent import Recent
from podusv_cli.engine.running.simulate import run
from podusv_cli.metrics.operations import OperationTally, operations
from podusv_cli.scenario.load import load

CONFIGS = Path(__file__).parents[2] / "configs"


@kernel
def slope(x, k):
    """Two operations, and a square root."""
    return float(math.sqrt(k.slope * x + 1.0))


@kernel
def sample(x, k, out):
    room = scratch(2)
    room[0] = slope(x[0], k)  # 3
    room[1] = 2.0 * slope(x[0], k) if x[1] > 0.0 else room[0]  # 4
    out[0] = abs(-room[1]) / math.pi - max(x[0], x[1])  # 2
    for i in range(int(k.slope)):
        out[0] = out[0] + x[i]  # 1 each time


def test_every_operation_is_counted_once_and_the_numbers_stay():
    tally, plain = OperationTally(), np.zeros(1)
    sample(np.array([4.0, 5.0]), SimpleNamespace(slope=2.0), plain)
    x, out = tally.vector([4.0, 5.0]), tally.vector([0.0])
    tally.kernel(sample)(x, SimpleNamespace(slope=tally.vector([2.0])[0]), out)
    assert (tally.count, float(out[0])) == (3 + 4 + 2 + 2, plain[0])


def test_cosine_and_sine_count_their_arithmetic_and_a_direction_once():
    tally = OperationTally()
    cosine, sine = tally.kernel(cos_sin)(tally.number(2.0))
    assert (float(cosine), float(sine)) == cos_sin(2.0)
    assert tally.count > 30
    tally = OperationTally()
    angle = tally.kernel(direction)(tally.number(1.0), tally.number(2.0))
    assert (tally.count, float(angle)) == (3, math.atan2(2.0, 1.0))  # two sums beside


def counts(*keys):
    scenario = load(CONFIGS / "mu_2017/corrected_compare.yaml", ["simulation.duration=1", *keys])
    found = {}
    for name, single in scenario.scenario.singles().items():
        plan = single.plan()
        found[name] = operations(plan, run(plan))["law_operations"]
    return found


def test_nodes_cost_the_same_in_every_law_that_has_them():
    few, many = (counts(f"controller.network.nodes={n}") for n in ([2, 2, 2], [5, 5, 5]))
    more = {name: many[name] - few[name] for name in few}
    assert more["pid"] == 0
    assert (
        more["adaptive_neural"] == more["dsc"] == more["full_backstepping"] > 117 * 2 * 4
    )  # f_hat, and both adaptations
    # the law without a filter differentiates its virtual controls instead
    assert (
        few["full_backstepping"] - few["adaptive_neural"]
        == many["full_backstepping"] - many["adaptive_neural"]
        > 0
    )


# --- what methods gave last is used again for the very same objects only


def test_the_very_same_object_is_not_asked_again() -> None:
    """One that is equal is, since zeros of both signs are equal."""
    recall, line = Recent(), Line(course=0.5)
    first = recall(line.constants)
    assert recall(line.constants) is first
    assert recall(Line(course=0.5).constants) is not first
    assert recall(Line(course=0.25).constants)["course"] == 0.25


def test_other_arguments_and_other_kinds_are_apart() -> None:
    """Kinds do not drive each other out."""
    recall, line, sine = Recent(), Line(course=0.5), Sinusoid(course=0.75)
    first = recall(line.constants)
    assert recall(sine.constants)["course"] == 0.75
    assert recall(line.constants) is first
    early, late = recall(line.targets, (0.0,)), recall(line.targets, (8.0,))
    assert early[0, 0] != late[0, 0]
