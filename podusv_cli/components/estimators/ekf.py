"""Extended Kalman filter: continuous between deliveries, discrete at them.

The state is (x, y, psi, u, v, r) and a load (north, east, about the vertical) that wanders as a
Wiener process. Between deliveries

    eta' = R(psi) nu,   M nu' = f(nu) + tau + R(psi)^T b,   b' = 0,   P' = F P + P F^T + Q

with the nominal vessel's Coriolis and damping force f and the derivative F of the right-hand sides
at the estimate. Q is diagonal: q_u^2 and so on for accelerations that the model does not explain,
q_b^2 for the load. Where something is delivered, one value after the other is taken in, so no
matrix has to be inverted: for value z of state i with standard deviation sigma

    s = P_ii + sigma^2,   x += P_:i (z - x_i)/s,   P -= P_:i P_i:/s

and for the heading z - x_i is brought into (-pi, pi]. A position that is delivered `delay_p` after
it was sampled is z = eta - delay_p R(psi) nu, to first order in the delay, and the same formulas
hold with its derivative h in place of the unit vector: s = h P h^T + sigma^2, x += P h^T (z -
z_est)/s.
Source: A. Gelb (ed.), "Applied Optimal
Estimation", MIT Press 1974, table 6.1-1, for the filter; sequential scalar updates are exact since
the measurements' errors are independent. P is a part of the loop's state and integrated with it, as
its upper triangle by rows.
"""

from __future__ import annotations

from typing import Any, ClassVar, Literal

import numpy as np

from podusv_cli.components import rules as by
from podusv_cli.components.estimators.base import ESTIMATE, LOADS, POSE_ALONE, Estimator
from podusv_cli.components.estimators.slopes import slopes
from podusv_cli.components.measurements.base import FRESH, VALUE
from podusv_cli.components.vessels.plant import plant
from podusv_cli.components.vessels.vessel import Vessel
from podusv_cli.core.component import Rule, Ruled, value
from podusv_cli.core.elementary import cos_sin
from podusv_cli.core.kernel import Vector, kernel, scratch, tail
from podusv_cli.core.kinematics import wrap
from podusv_cli.core.signal import Signal

N = 9  # numbers that are estimated: pose, velocities, loads
MOVING = 6  # of them, those that something known makes change
PACKED = N * (N + 1) // 2
# Their place in the packed triangle, whose rows have 9, 8, 7, ... entries
OF_V, OF_R = N + 30, N + 35  # in the filter's state, the variances of v and r
COVARIANCE = Signal(
    "P_est",
    "",
    "covariance of the estimate's errors and the loads', upper triangle by rows; each "
    "entry in the product of two units",
    "P",
    ("entry",),
)

INNOVATIONS = (
    Signal(
        "nis_sum",
        "1",
        "sum of all squared innovations so far, each over its variance; of x, y, psi, u, v, r",
        axes=("measured",),
    ),
    Signal(
        "nis_count",
        "1",
        "how many measured values were taken in so far; of x, y, psi, u, v, r",
        axes=("measured",),
    ),
)


# packed (45), row by row; writes full (9, 9). N is 9.
@kernel
def unpack_triangle(packed: Vector, full: Vector) -> None:
    """A symmetric matrix from its upper triangle."""
    at = 0
    for i in range(N):
        for j in range(i, N):
            full[N * i + j] = packed[at]
            full[N * j + i] = packed[at]
            at += 1


# f (6, 9), packed P (45), q (9) the diagonal of Q; writes rate (45), packed as P is. `moved` is F
# P, whose last three rows are 0, as loads have no rate. At the end of row i of the triangle `at` is
# one row's length beyond its diagonal, N - i numbers; so q goes to at - N + i.
@kernel
def spread(f: Vector, packed: Vector, q: Vector, rate: Vector) -> None:
    """P' = F P + P F^T + Q; F has entries in rows 0 to 5 and columns 2 to 8 alone."""
    full, moved = scratch(81), scratch(81)
    unpack_triangle(packed, full)
    for i in range(MOVING):
        for j in range(N):
            total = 0.0
            for c in range(2, N):
                total += f[N * i + c] * full[N * c + j]
            moved[N * i + j] = total
    for i in range(N * MOVING, N * N):
        moved[i] = 0.0
    at = 0
    for i in range(N):
        for j in range(i, N):
            rate[at] = moved[N * i + j] + moved[N * j + i]
            at += 1
        rate[at - N + i] += q[i]


# h (6) is the derivative, `innovation` measured less expected, sigma its deviation. Changes state:
# estimate (9), then packed P (45), then sums of squared innovations (6) and their numbers (6). A
# value that is late depends on several states, so all of h counts. ph (9) is P h.
# At the end of the triangle `at` is where the sums of innovations begin.
@kernel
def take_in(i: int, h: Vector, innovation: float, sigma: float, state: Vector) -> float:
    """Correct estimate and covariance by the measured value i, whose derivative is h.

    Returns the variance of its innovation.
    """
    full, ph = scratch(81), scratch(9)
    packed = tail(state, N)
    unpack_triangle(packed, full)
    variance = sigma * sigma
    for j in range(N):
        ph[j] = 0.0
        for c in range(MOVING):
            ph[j] += full[N * j + c] * h[c]
    for j in range(MOVING):
        variance += h[j] * ph[j]
    gain = 1.0 / variance
    for j in range(N):
        state[j] += ph[j] * gain * innovation
    at = 0
    for j in range(N):
        for c in range(j, N):
            packed[at] -= ph[j] * gain * ph[c]
            at += 1
    packed[at + i] += innovation * gain * innovation
    packed[at + MOVING + i] += 1.0
    return variance


# delay [s]; reads the estimate in state (9); writes h (6). A late position is that of now less the
# way over the delay, so it depends on heading and velocities.
@kernel
def derivative(i: int, delay: float, state: Vector, h: Vector) -> float:
    """h of the measured value i, and by how much a late position is ahead of the one measured."""
    for j in range(MOVING):
        h[j] = 1.0 if j == i else 0.0
    if i > 1:
        return 0.0
    c, s = cos_sin(state[2])
    ahead, aside = (c, -s) if i == 0 else (s, c)  # (u, v) on the axis of this value
    h[2] = -delay * (state[3] * aside - state[4] * ahead)
    h[3], h[4] = -delay * ahead, -delay * aside
    return float(delay * (state[3] * ahead + state[4] * aside))


# Writes q (9): by which variance velocities and loads wander in a second.
@kernel
def wanderings(k: Any, q: Vector) -> None:
    """The diagonal of Q."""
    q[0] = q[1] = q[2] = 0.0
    q[3], q[4], q[5] = k.q_u * k.q_u, k.q_v * k.q_v, k.q_r * k.q_r
    q[6] = q[7] = k.q_b * k.q_b
    q[8] = k.q_b_psi * k.q_b_psi


# tau (3) [N, N, N m]; state (66) as `states` declares it. Writes rate (66) and f (6, 9). The load
# is fixed to the earth, so it is turned into the body frame for the plant. Sums of innovations
# rest.
@kernel
def predict(tau: Vector, state: Vector, k: Any, f: Vector, rate: Vector) -> None:
    """Rates of estimate, load and covariance; f becomes F."""
    cosine, sine = cos_sin(state[2])
    b, q = scratch(3), scratch(9)
    b[0] = cosine * state[6] + sine * state[7]
    b[1] = cosine * state[7] - sine * state[6]
    b[2] = state[8]
    plant(state, tau, b, k, rate)
    rate[6] = rate[7] = rate[8] = 0.0
    for i in range(N + PACKED, N + PACKED + 2 * MOVING):
        rate[i] = 0.0
    slopes(state, state[OF_V], state[OF_R], b, cosine, sine, k, f)
    wanderings(k, q)
    spread(f, tail(state, N), q, tail(rate, N))


class ExtendedKalmanFilter(Estimator):
    """The estimate with the least mean square error, as far as the model is right.

    The standard deviations of measured values are by default those of the sensors themselves.
    """

    kind: Literal["ekf"] = "ekf"
    rules: ClassVar[dict[str, Rule]] = {
        "q_b": by.FORCE,
        "q_b_psi": by.MOMENT,
        "sigma_b": by.FORCE,
        "sigma_b_psi": by.MOMENT,
        "sigma_p": by.noise(0),
        "sigma_psi": by.noise(2),
        "sigma_u": by.noise(3),
        "sigma_v": by.noise(4),
        "sigma_r": by.noise(5),
    }
    bias: bool = value(True, "", "whether it estimates a load, too")
    q_u: float = value(0.02, "m/s2/sqrt(Hz)", "unexplained surge acceleration", ge=0)
    q_v: float = value(0.02, "m/s2/sqrt(Hz)", "unexplained sway acceleration", ge=0)
    q_r: float = value(0.02, "rad/s2/sqrt(Hz)", "unexplained yaw acceleration", ge=0)
    q_b: Ruled = value(0.1, "N/sqrt(s)", "how fast the load's force wanders", ge=0)
    q_b_psi: Ruled = value(0.05, "N m/sqrt(s)", "how fast the load's moment wanders", ge=0)
    sigma_b: Ruled = value(1.0, "N", "standard deviation of the force at the start", ge=0)
    sigma_b_psi: Ruled = value(0.5, "N m", "standard deviation of the moment at the start", ge=0)
    delay_p: float = value(0.0, "s", "age of a measured position when it is delivered", ge=0)
    sigma_p: Ruled = value(0.02, "m", "standard deviation of a measured position, each axis", gt=0)
    sigma_psi: Ruled = value(0.005, "rad", "standard deviation of a measured heading", gt=0)
    sigma_u: Ruled = value(0.02, "m/s", "standard deviation of a measured surge velocity", gt=0)
    sigma_v: Ruled = value(0.02, "m/s", "standard deviation of a measured sway velocity", gt=0)
    sigma_r: Ruled = value(0.002, "rad/s", "standard deviation of a measured yaw rate", gt=0)

    @property
    def states(self) -> tuple[Signal, ...]:
        """The estimate, the load, the covariance, the innovations."""
        sums, counts = INNOVATIONS
        return (*ESTIMATE, *LOADS, *[COVARIANCE] * PACKED, *[sums] * MOVING, *[counts] * MOVING)

    @property
    def load_at(self) -> int:
        """Where the loads begin in the state: behind the estimate; 0 without `bias`."""
        return len(ESTIMATE) if self.bias else 0

    @property
    def covariance(self) -> tuple[int, int]:
        """Where in the state the covariance begins, behind the loads, and its order."""
        return N, N

    def assumed_noise(self) -> tuple[tuple[str, float], ...]:
        """The standard deviations that measurements are taken to have."""
        names = ("sigma_p", "sigma_p", "sigma_psi", "sigma_u", "sigma_v", "sigma_r")
        return tuple((name, getattr(self, name)) for name in names)

    def assumed_delay(self) -> tuple[str, float]:
        """The key and value [s] of the age that positions are taken to have."""
        return "delay_p", self.delay_p

    def constants(self) -> dict[str, float]:
        """The fields' numbers; without `bias` the load does not wander, so it stays 0."""
        without = {} if self.bias else dict.fromkeys(("q_b", "q_b_psi"), 0.0)
        return super().constants() | without

    # seen as the sensors write it (VALUE, FRESH); changes state (66). `sigma` are the deviations of
    # what is measured; the heading's innovation is taken by the nearest turn.
    @staticmethod
    @kernel
    def correct(seen: Vector, state: Vector, k: Any) -> None:
        """Take in what was delivered, one value after the other."""
        sigma, h = scratch(6), scratch(6)
        sigma[0], sigma[1], sigma[2] = k.sigma_p, k.sigma_p, k.sigma_psi
        sigma[3], sigma[4], sigma[5] = k.sigma_u, k.sigma_v, k.sigma_r
        for i in range(MOVING):
            if seen[FRESH + i] != 0.0:
                late = derivative(i, k.delay_p, state, h)
                innovation = seen[VALUE + i] - (state[i] - late)
                take_in(i, h, wrap(innovation) if i == 2 else innovation, sigma[i], state)

    # tau (3) [N, N, N m], state (66); writes rate (66). `f` is room for F (6, 9).
    @staticmethod
    @kernel
    def follow(tau: Vector, state: Vector, k: Any, rate: Vector) -> None:
        """The nominal vessel, and how far the estimate may be off it."""
        f = scratch(54)
        predict(tau, state, k, f, rate)

    def start(self, x: Vector, nominal: Vessel) -> Vector:
        """The state (66,) at t = 0: the truth; of the load only how large it may be is known."""
        force, moment = (self.sigma_b, self.sigma_b_psi) if self.bias else (0.0, 0.0)
        unsure = np.diag(np.square([0.0] * MOVING + [force, force, moment]))
        return np.concatenate([x, np.zeros(3), unsure[np.triu_indices(N)], np.zeros(12)])

    def needs(self) -> tuple[bool, ...]:
        """What has to be measured: the pose. Velocities are taken in where they are."""
        return POSE_ALONE
