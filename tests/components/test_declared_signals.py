"""Signals: a law declares its own, whatever they are called; nobody else has a table of them."""

from typing import Any, ClassVar, Literal

import numpy as np
import pytest
from conftest import Constant, corrected, run

from podusv_cli.components.controllers.base import Slots
from podusv_cli.components.controllers.pid import Pid
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.core.signal import Signal
from podusv_cli.engine.loop.plan import Plan
from podusv_cli.engine.running.check import check_law
from podusv_cli.engine.step.grid import TimeGrid

E_CT = Signal("e_ct", "m", "cross-track error")
MODES = Signal("modes", "m", "amplitudes of the modes", axes=("mode",))


class CrossTrack(Constant):
    """A law with an error of its own and neither psi_e nor z_e."""

    kind: Literal["cross_track"] = "cross_track"  # type: ignore[assignment]
    signals: ClassVar[tuple[Signal, ...]] = (E_CT,)

    def slots(self) -> Slots:
        return ((MODES, 3),)

    def start(self, x: Vector, target: Vector, nominal: Any) -> Vector:
        return np.zeros(3)

    @staticmethod
    @kernel
    def law(
        t: float,
        x: Vector,
        memory: Vector,
        target: Vector,
        k: Any,
        table: Vector,
        tau: Vector,
        rate: Vector,
        signals: Vector,
        work: Vector,
    ) -> None:
        tau[0], tau[1] = 1.0, 0.0
        for i in range(3):
            rate[i] = 1.0 + i
        signals[0] = target[1] - x[1]


def test_a_signal_has_a_symbol_of_its_name_and_needs_a_name_that_a_claim_can_use():
    assert [Signal(name, "m", "").symbol for name in ("e", "e_c", "e_ct", "e_c_t")] == [
        "e",
        "e_c",
        "e_{ct}",
        "e_{c,t}",
    ]
    with pytest.raises(
        ValueError, match="letters, digits and '_', starting with a letter, found 'e ct'"
    ):
        Signal("e ct", "m", "")


@pytest.mark.parametrize("compiled", [True, False])
def test_a_law_without_psi_e_runs_and_its_recording_says_what_it_logged(compiled):
    loop = corrected(controller=CrossTrack())
    check_law(Plan(loop, TimeGrid(0.01, 1)))
    out = run(loop, 0.3, compiled=compiled)
    assert "psi_e" not in out
    assert out.about["e_ct"] is E_CT
    assert {*out.signals, *out.fixed} == set(out.about)
    np.testing.assert_array_equal(out["e_ct"], out["y_d"] - out["y"])
    np.testing.assert_allclose(out["modes"], np.outer(out["time"], [1.0, 2.0, 3.0]), atol=1e-12)


def test_z_e_is_the_distance_to_the_target_whatever_the_law():
    for law in (CrossTrack(), Pid(standoff=2.0)):
        out = run(corrected(controller=law), 0.5, hold_every=5)
        x_e, y_e = out["x_d"] - out["x"], out["y_d"] - out["y"]
        np.testing.assert_array_equal(out["z_e"], np.sqrt(x_e * x_e + y_e * y_e))
