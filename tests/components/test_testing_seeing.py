"""Contract tests for measurements and estimators: sound ones pass, and each planted fault fails."""

from typing import Any, Literal

import numpy as np
import pytest
from conftest import kinds

from podusv_cli.components.estimators.low_pass import LowPass
from podusv_cli.components.measurements.base import FRESH, OWN, Measurement
from podusv_cli.components.measurements.sensors import MEASURED
from podusv_cli.core.kernel import Vector, call, kernel
from podusv_cli.testing import checks, keeps_its_declaration
from podusv_cli.testing import seeing as testing_seeing

SOUND = [
    kind()
    for room in ("measurements", "estimators")
    for name, kind in kinds(room).items()
    if name != "exact"  # which has no kernel
]
CONTRACT = [(one, check) for one in SOUND for check in checks(one)]


@pytest.mark.parametrize(
    ("part", "check"), CONTRACT, ids=[f"{type(one).__name__}-{c.__name__}" for one, c in CONTRACT]
)
def test_podusv_s_own_keep_the_contract(part, check):
    check(part)


class Seen(Measurement):
    """A sound measurement: the state, at every instant."""

    kind: Literal["seen"] = "seen"

    @property
    def signals(self):
        """All six."""
        return MEASURED

    @staticmethod
    @kernel
    def sense(
        t: float, instant: float, x: Vector, b: Vector, k: Any, table: Vector, seen: Vector
    ) -> None:
        """Deliver."""
        for i in range(6):
            seen[i] = x[i]
            seen[FRESH + i] = 1.0


def test_a_measurement_of_ten_lines_keeps_the_contract():
    for check in checks(Seen()):
        check(Seen())


def sensing(change):
    """`Seen` with something done after it."""

    class Changed(Seen):
        """A faulty measurement."""

        @staticmethod
        def sense(t, instant, x, b, k, table, seen):
            """Deliver, and go wrong."""
            Seen.sense(t, instant, x, b, k, table, seen)
            change(instant, x, seen)

    return Changed()


def no_mark(instant, x, seen):
    seen[FRESH] = 0.0


def half_a_mark(instant, x, seen):
    seen[FRESH + 1] = 0.5


def other_marks(instant, x, seen):
    seen[OWN - 1] = 0.0


def beyond(instant, x, seen):
    seen[OWN] = 3.0


def moves_the_vessel(instant, x, seen):
    x[0] += 1.0


def constant(instant, x, seen):
    seen[4] = 0.01 * np.cos(7.0 * instant)


def counts(instant, x, seen, calls=[0]):  # noqa: B006
    calls[0] += 1
    seen[0] += 1e-6 * calls[0]


@pytest.mark.parametrize(
    ("change", "check", "said"),
    [
        (no_mark, "marks_what_it_delivers", "x changes at instant .* unmarked"),
        (half_a_mark, "marks_what_it_delivers", "neither 0 nor 1"),
        (other_marks, "marks_what_it_delivers", "marks of what is measured change"),
        (beyond, "marks_what_it_delivers", "behind `seen`"),
        (moves_the_vessel, "marks_what_it_delivers", "changes the true state"),
        (constant, "measures_the_vessel", "v: correlation"),
        (counts, "errs_alike_in_a_longer_run", "the same run again"),
    ],
)
def test_a_faulty_measurement_is_found(change, check, said):
    with pytest.raises(AssertionError, match=said):
        getattr(testing_seeing, check)(sensing(change))


class OfTheLength(Seen):
    """A measurement whose errors depend on the length of the run."""

    def table_for(self, step, steps):
        """One number."""
        return np.array([1e-3 * steps])

    @staticmethod
    def sense(t, instant, x, b, k, table, seen):
        """Deliver with an error."""
        Seen.sense(t, instant, x, b, k, table, seen)
        seen[0] += table[0]


def test_errors_that_depend_on_the_length_of_the_run_are_found():
    with pytest.raises(AssertionError, match="a run of twice the length"):
        testing_seeing.errs_alike_in_a_longer_run(OfTheLength())


def estimating(**kernels):
    """`LowPass` with some kernels replaced."""
    return type("Changed", (LowPass,), {k: staticmethod(v) for k, v in kernels.items()})()


def takes_all(t, seen, state, k, table):
    state[:6] = seen[:6]


def deaf(t, seen, tau, state, k, table, rate):
    rate[: len(rate) - testing_seeing.MARGIN] = 0.0


def unwrapped(t, seen, tau, state, k, table, rate):
    call(LowPass.follow, t=t, seen=seen, tau=tau, state=state, k=k, table=table, rate=rate)
    rate[2] = (seen[2] - state[2]) / k.T_psi
    rate[5] = (10.0 * rate[2] - state[5]) / k.T_nu


def forgets_a_rate(t, seen, tau, state, k, table, rate):
    call(LowPass.follow, t=t, seen=seen, tau=tau, state=state, k=k, table=table, rate=rate)
    rate[5] = np.nan


def writes_on(t, seen, tau, state, k, table, rate):
    call(LowPass.follow, t=t, seen=seen, tau=tau, state=state, k=k, table=table, rate=rate)
    rate[6] = 0.0


def moves_the_state(t, seen, tau, state, k, table, rate):
    call(LowPass.follow, t=t, seen=seen, tau=tau, state=state, k=k, table=table, rate=rate)
    state[0] += 1.0


def drifts(t, seen, tau, state, k, table, rate):
    call(LowPass.follow, t=t, seen=seen, tau=tau, state=state, k=k, table=table, rate=rate)
    rate[5] += 5.0


@pytest.mark.parametrize(
    ("kernels", "check", "said"),
    [
        ({"correct": takes_all}, "waits_for_a_delivery", "nothing was delivered"),
        ({"follow": deaf}, "comes_to_what_is_measured", "pose off by"),
        ({"follow": drifts}, "comes_to_what_is_measured", "at rest with velocities"),
        ({"follow": forgets_a_rate}, "comes_to_what_is_measured", "left unwritten"),
        ({"follow": writes_on}, "comes_to_what_is_measured", "behind the rate"),
        ({"follow": moves_the_state}, "comes_to_what_is_measured", "changes the state"),
    ],
)
def test_a_faulty_estimator_is_found(kernels, check, said):
    with pytest.raises(AssertionError, match=said):
        getattr(testing_seeing, check)(estimating(**kernels))


class Unwrapped(LowPass):
    """An estimator that takes a heading of another turn for an error, and starts elsewhere."""

    correct = staticmethod(LowPass.correct)

    @staticmethod
    def follow(t, seen, tau, state, k, table, rate):
        """Go straight for the number of the heading, slowly."""
        call(LowPass.follow, t=t, seen=seen, tau=tau, state=state, k=k, table=table, rate=rate)
        rate[2] = (seen[2] - state[2]) / 20.0

    def start(self, x, nominal):
        """One metre off."""
        return x + 1.0


@pytest.mark.parametrize(
    ("check", "said"),
    [
        ("takes_headings_by_the_nearest_turn", "heading off by"),
        ("starts_at_the_truth", "not equal"),
    ],
)
def test_a_heading_of_another_turn_and_a_wrong_start_are_found(check, said):
    with pytest.raises(AssertionError, match=said):
        getattr(testing_seeing, check)(Unwrapped())


def test_a_measurement_that_declares_too_little_is_refused():
    class Silent(Seen):
        """No signals."""

        @property
        def signals(self):
            """None."""
            return ()

    with pytest.raises(Exception, match="declares 0 signals"):
        keeps_its_declaration(Silent())
