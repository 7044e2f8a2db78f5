"""The adaptive backstepping law of the paper, (23)-(28) and (32)-(37), for any differentiator.

Laws of this family differ only in how the virtual control is differentiated: by the shunting
model, by a first-order filter (DSC), or in full.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar, Literal, Self

import numpy as np

from podusv_cli.components.controllers.base import Slots, each
from podusv_cli.components.controllers.crab import observe_sway, take_aim
from podusv_cli.components.controllers.network import (
    CENTER,
    WIDTH,
    Network,
    activate,
    activation,
    adapt,
    weigh,
)
from podusv_cli.components.controllers.tracking import HELD, TRACKED, TrackingController, track
from podusv_cli.components.controllers.velocity_loop import AdaptedBound, Axis, Loop
from podusv_cli.core.component import value
from podusv_cli.core.derived import difference
from podusv_cli.core.kernel import Vector, absent, kernel, scratch, tail
from podusv_cli.core.signal import Signal

B_HAT_U, B_HAT_R, WEIGHTS = 2, 3, 4
F_HAT = (
    Signal("f_hat_u", "m/s2", "network's estimate of f_u (25)", r"\hat f_u"),
    Signal("f_hat_r", "rad/s2", "network's estimate of f_r (34)", r"\hat f_r"),
)
BOUNDS = (
    Signal("b_hat_u", "N", "estimated bound of b_u (28)", r"\hat b_u"),
    Signal("b_hat_r", "N m", "estimated bound of b_r (37)", r"\hat b_r"),
)
W_HAT = (
    Signal("W_hat_u", "m/s2", "surge network weights (27)", r"\hat W_u", ("node",)),
    Signal("W_hat_r", "rad/s2", "yaw network weights (36)", r"\hat W_r", ("node",)),
)
FILTERED = (
    Signal("beta_u", "m/s", "filtered virtual surge velocity (22)", r"\beta_u"),
    Signal("beta_r", "rad/s", "filtered virtual yaw rate (31)", r"\beta_r"),
)
Y_U = Signal("y_u", "m/s", "error of the surge filter, beta_u - alpha_u")
Y_R = Signal("y_r", "rad/s", "error of the yaw filter, beta_r - alpha_r")
filter_error_u, filter_error_r = (
    difference(Y_U, "beta_u", "alpha_u"),
    difference(Y_R, "beta_r", "alpha_r"),
)
SHORTFALL = (
    Signal("xi_u", "m/s", "shortfall of surge force as a velocity (anti-windup)", r"\xi_u"),
    Signal("xi_r", "rad/s", "shortfall of yaw moment as a yaw rate (anti-windup)", r"\xi_r"),
)


# Stand for a law's differentiators, put in with `specialise`: surge(e, x, target, beta, rate, k) is
# (beta_u, beta_u'), yaw(..., tau_u), which knows tau_u, is (beta_r, beta_r'). `beta` and `rate` are
# the filter's part of the memory (beta_u, beta_r) and of its rate.
surge: Callable[..., Any] = absent("surge")
yaw: Callable[..., Any] = absent("yaw")


@kernel
def lemma(error: float, k: Any) -> float:
    """phi(xi) = xi/(4 partial) of Lemma 1 and Remark 1."""
    return float(error / (4.0 * k.partial))


# Reads memory and writes rate, two numbers at k.auxiliary.
@kernel
def compensation(memory: Vector, k: Any, rate: Vector) -> tuple[float, float]:
    """(xi_u, xi_r), what the loads fell short as a velocity; 0 without anti-windup.

    m11 xi_u' = -k_ue xi_u + (tau_u on the hull - tau_u asked for); `after_saturation` adds the last
    term.
    """
    at = int(k.auxiliary)
    if at <= 0:
        return 0.0, 0.0
    rate[at] = -k.k_ue / k.m11 * memory[at]
    rate[at + 1] = -k.k_re / k.m33 * memory[at + 1]
    return memory[at], memory[at + 1]


# x (6), memory and rate as `slots`, target (6), work as `workspace`; writes tau (2) [N, N m], rate
# and signals (8). Surge comes before yaw, whose differentiator may need tau_u. The direction that
# is held changes at samples alone, so its rates are 0.
@kernel
def polar_backstepping(
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
    """Demand (26), (35) and memory rates (27), (28), (36), (37), see `controllers.base`.

    The sign s of the coupling is -1 as printed, +1 where the cross terms are to cancel in V'.
    With anti-windup bounds and networks learn from the errors u_c = u_e - xi_u, r_c = r_e - xi_r,
    which obey the same equations as u_e and r_e would without limits (Farrell et al. 2009).
    """
    count = int(k.network_count)
    W_hat_u, W_hat_r = tail(memory, WEIGHTS), tail(memory, WEIGHTS + count)
    filtered = WEIGHTS + 2 * count
    phi = work
    activate(x, k, table, phi, tail(work, count))
    f_hat_u, f_hat_r = weigh(count, W_hat_u, W_hat_r, phi)
    aim = take_aim(x, memory, target, k, scratch(6))
    e = track(x, memory, aim, k)
    s = 2.0 * k.coupling - 1.0

    beta_u, beta_u_dot = surge(e, x, aim, tail(memory, filtered), tail(rate, filtered), k)
    xi_u, xi_r = compensation(memory, k, rate)
    u_e = x[3] - beta_u
    u_c = u_e - xi_u
    tau[0] = (
        -k.k_ue * u_e
        - k.m11 * f_hat_u
        - memory[B_HAT_U] * lemma(u_c, k)
        + k.m11 * beta_u_dot
        + s * e.z_e * e.cos_e
    )
    beta_r, beta_r_dot = yaw(e, x, aim, tail(memory, filtered), tail(rate, filtered), k, tau[0])
    r_e = x[5] - beta_r
    r_c = r_e - xi_r
    tau[1] = (
        -k.k_re * r_e
        - k.m33 * f_hat_r
        - memory[B_HAT_R] * lemma(r_c, k)
        + k.m33 * beta_r_dot
        + s * e.psi_e
    )

    observe_sway(x, memory, target, k, rate)
    rate[0] = rate[1] = 0.0
    rate[B_HAT_U] = k.gamma_u * (u_c * lemma(u_c, k) - k.sigma_bu * (memory[B_HAT_U] - k.b_hat_u0))
    rate[B_HAT_R] = k.gamma_r * (r_c * lemma(r_c, k) - k.sigma_br * (memory[B_HAT_R] - k.b_hat_r0))
    W_0 = k.network_initial_weight
    adapt(count, W_hat_u, phi, u_c * k.m11, k.Gamma_u, k.sigma_u, W_0, tail(rate, WEIGHTS))
    adapt(count, W_hat_r, phi, r_c * k.m33, k.Gamma_r, k.sigma_r, W_0, tail(rate, WEIGHTS + count))

    signals[0], signals[1] = e.psi_d, e.psi_e
    signals[2], signals[3] = e.alpha_u, e.alpha_r
    signals[4], signals[5] = u_e, r_e
    signals[6], signals[7] = f_hat_u, f_hat_r


class PolarBackstepping(TrackingController):
    """Gains and options of the adaptive backstepping laws; gains are the paper's section 6."""

    signals: ClassVar[tuple[Signal, ...]] = (*TRACKED, *F_HAT)
    k_ue: float = value(4.0, "kg/s", "gain of the surge velocity error in (26)", ge=0)
    k_re: float = value(40.0, "kg m2/s", "gain of the yaw rate error in (35)", ge=0)
    Gamma_u: float = value(100.0, "1/(kg s2)", "adaptation gain of the surge network (27)", ge=0)
    Gamma_r: float = value(100.0, "1/(kg m2 s2)", "adaptation gain of the yaw network (36)", ge=0)
    sigma_u: float = value(0.1, "kg s", "leakage of the surge network (27)", ge=0)
    sigma_r: float = value(0.1, "kg m2 s", "leakage of the yaw network (36)", ge=0)
    gamma_u: float = value(1000.0, "kg/s2", "adaptation gain of the surge bound (28)", ge=0)
    gamma_r: float = value(1000.0, "kg m2/s2", "adaptation gain of the yaw bound (37)", ge=0)
    sigma_bu: float = value(0.01, "s/kg", "leakage of the surge bound (28)", ge=0)
    sigma_br: float = value(0.01, "s/(kg m2)", "leakage of the yaw bound (37)", ge=0)
    b_hat_u0: float = value(
        0.0, "N", "surge bound at the start, and what leakage pulls it to", ge=0
    )
    b_hat_r0: float = value(
        0.0, "N m", "yaw bound at the start, and what leakage pulls it to", ge=0
    )
    partial: float = value(0.1, "m/s, rad/s", "Lemma 1's constant; phi(xi) = xi/(4 partial)", gt=0)
    coupling: Literal["printed", "corrected"] = value(
        "corrected", "", "sign of z_e cos psi_e and psi_e in (26), (35): -1 printed, +1 corrected"
    )
    network: Network = value(Network(), "", "nodes and widths of the two networks")

    def slots(self) -> Slots:
        """The memory: held direction, bounds, weights, filters, and what anti-windup needs."""
        count = self.network.count
        learnt = each(BOUNDS) + each(W_HAT, count)
        shortfall = each(SHORTFALL) if self.wants_loads() else ()
        return HELD + learnt + self.filter_slots() + self.swaying() + shortfall

    def filter_slots(self) -> Slots:
        """The part of the memory with the filters' output; none without a filter."""
        return ()

    def constants(self) -> dict[str, float]:
        """The fields' numbers, and where xi_u and xi_r are in the memory (0 for nowhere)."""
        # They are the last two numbers of the memory
        at = sum(size for _, size in self.slots()) - 2 if self.wants_loads() else 0
        return super().constants() | {"auxiliary": float(at)}

    # demand (2) [N, N m], tau (3) [N, N, N m]; changes the rates of xi_u and xi_r at k.auxiliary.
    @staticmethod
    @kernel
    def after_saturation(demand: Vector, tau: Vector, k: Any, rate: Vector) -> None:
        """Add what the loads fall short of the demand."""
        at = int(k.auxiliary)
        rate[at] += (tau[0] - demand[0]) / k.m11
        rate[at + 1] += (tau[2] - demand[1]) / k.m33

    def filter_decay(self, alpha_u: Any, alpha_r: Any) -> tuple[Any, Any]:
        """Rates A_u, A_r [1/s] of (41), (45) at which the filters forget; infinite without any.

        Numbers or arrays, like the virtual controls. Never below their values at 0.
        """
        # In the shape of what is given
        return alpha_u * 0.0 + np.inf, alpha_r * 0.0 + np.inf

    def velocity_loops(self, axes: tuple[Axis, Axis], nu: Vector) -> list[Loop]:
        """The loops of surge and yaw, (26), (27) with a = W . Phi at Phi frozen at `nu` (3,).

        With e the velocity error, M the true and m the nominal inertia of an axis:
        M e' = -(k + b) e - m a, beside the hull's damping, and a' = Gamma (m |Phi|^2 e - sigma a).
        Here b = `b.initial`/(4 partial) is the gain of the adapted bound at its start.
        """
        power = float((activation(self.network, nu[None]) ** 2).sum())
        learnt = (
            ("u_e", "gamma_u", self.gamma_u, self.sigma_bu, self.b_hat_u0),
            ("r_e", "gamma_r", self.gamma_r, self.sigma_br, self.b_hat_r0),
        )
        bounds = [
            AdaptedBound(*bound, self.partial, axis.inertia)
            for bound, axis in zip(learnt, axes, strict=True)
        ]
        gains = (
            ("Gamma_u", self.k_ue, self.Gamma_u, self.sigma_u),
            ("Gamma_r", self.k_re, self.Gamma_r, self.sigma_r),
        )
        return [
            Loop(
                axis.name,
                key,
                axis.damping,
                np.array([-k - b.initial / (4.0 * self.partial), -axis.told]) / axis.inertia,
                np.array([[Gamma * axis.told * power, -Gamma * sigma]]),
                cause="adaptation",
                name="adaptation",
                bound=b,
            )
            for axis, b, (key, k, Gamma, sigma) in zip(axes, bounds, gains, strict=True)
        ]

    def lyapunov(self) -> Self | None:
        """This law: the paper's proof is about the whole family, with the standoff as it is."""
        return None if self.swaying() else self

    def workspace(self) -> int:
        """How many numbers of scratch the law needs: the nodes' outputs and their factors."""
        return self.network.count + self.network.bells

    def table(self) -> Vector:
        """The network's centres and exponents, see `Network.table`."""
        return self.network.table()

    def fixed_signals(self) -> dict[Signal, Vector]:
        """Centres, shape (node, 3), and widths, shape (3,), of the networks."""
        return {CENTER: self.network.center_array(), WIDTH: self.network.width_array()}

    def begin(self, x: Vector, target: Vector, k: Any) -> Vector:
        """The memory (slots,), with bounds and weights at what leakage pulls them to.

        `x` (6,) and `target` (6,) are those at t = 0, `k` has the law's constants.
        """
        memory = super().begin(x, target, k)
        memory[B_HAT_U], memory[B_HAT_R] = self.b_hat_u0, self.b_hat_r0
        memory[WEIGHTS : WEIGHTS + 2 * self.network.count] = self.network.initial_weight
        return memory


class FilteredBackstepping(PolarBackstepping):
    """A law whose virtual control goes through a filter with memory (beta_u, beta_r)."""

    filter_start: Literal["zero", "alpha"] = value(
        "alpha", "", "filter output at the start: 0, or the virtual control"
    )

    def filter_slots(self) -> Slots:
        """The part of the memory with the filters' output: beta_u and beta_r."""
        return each(FILTERED)

    def begin(self, x: Vector, target: Vector, k: Any) -> Vector:
        """The memory (slots,) with the filter at zero, or settled on the virtual control.

        `x` (6,) and `target` (6,) are those at t = 0, `k` has the law's constants.
        """
        memory = super().begin(x, target, k)
        if self.filter_start == "alpha":
            e = self.first_errors(x, memory, target, k)
            at = WEIGHTS + 2 * self.network.count
            memory[at : at + 2] = e.alpha_u, e.alpha_r
        return memory
