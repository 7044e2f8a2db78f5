"""The laws of ArduPilot, PX4 and MSS, against plain-Python loops and algebra."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import NONLINEAR, ask, situations

import podusv
from podusv_cli.components.actuators.saturated import Saturated
from podusv_cli.components.controllers.ardupilot import ArduPilot, by_l1
from podusv_cli.components.controllers.mss import Mss
from podusv_cli.components.controllers.px4 import Px4
from podusv_cli.components.facts import Facts
from podusv_cli.core.errors import ScenarioError
from podusv_cli.core.kernel import bundle

PERIOD, STEP, TIME = 0.13, 0.013, 59.93
M11, M22, M33 = 64.0, 110.0, 35.0
HULL = {
    "source": "invented",
    "validity": "this test",
    "length": 2.0,
    "beam": 0.8,
    "m": 60.0,
    "I_z": 20.0,
    "X_udot": -4.0,
    "Y_vdot": -50.0,
    "N_rdot": -15.0,
    "X_u": -20.0,
    "X_uu": -15.0,
    "Y_v": -80.0,
    "Y_vv": -100.0,
    "N_r": -40.0,
}
POINTS = np.array([(0.0, 0.0), (12.0, 3.0), (6.0, 14.0)])
SPEED, NEAR = 0.7, 1.5
START = {"x": -2.0, "y": 1.5, "psi": 0.4, "u": 0.2}
GAINS = {
    "surge": 80.0,
    "yaw": 40.0,
    "U": 1.2,
    "r_m": 0.6,
    "speed_FF": 0.45,
    "speed_P": 0.5,
    "speed_I": 0.3,
    "rate_FF": 0.8,
    "rate_P": 0.5,
    "rate_I": 0.4,
}


def turned(angle: float) -> complex:
    return complex(math.cos(angle), math.sin(angle))


def clip(number: float, most: float = 1.0) -> float:
    return max(-most, min(most, number))


def angle_of(number: complex) -> float:
    return math.atan2(number.imag, number.real)


def rates(s: Any, tau: Any) -> Any:
    """Of pose and velocities, for the hull of this file under a force and a moment."""
    psi, u, v, r = s[2:]
    ground = complex(u, v) * turned(psi)
    return np.array(
        [
            ground.real,
            ground.imag,
            r,
            (tau[0] + M22 * v * r - 20.0 * u - 15.0 * abs(u) * u) / M11,
            (-M11 * u * r - 80.0 * v - 100.0 * abs(v) * v) / M22,
            (tau[1] + (M11 - M22) * u * v - 40.0 * r) / M33,
        ]
    )


def rk4(f: Any, s: Any, held: Any) -> Any:
    a = f(s, held)
    b = f(s + 0.5 * STEP * a, held)
    c = f(s + 0.5 * STEP * b, held)
    return s + STEP / 6.0 * (a + 2.0 * b + 2.0 * c + f(s + STEP * c, held))


def sailed(law: Any, memory: Any, duration: float, start: dict[str, float] = START) -> Any:
    """Rows of state and memory at every sample; only the memory moves on in between."""
    s, m, leg, rows = np.array([*start.values(), 0.0, 0.0]), np.array(memory), 0, []
    for step in range(round(duration / STEP) + 1):
        at = complex(s[0], s[1])
        if leg < len(POINTS) - 1 and abs(complex(*POINTS[leg + 1]) - at) < NEAR:
            leg += 1
        start, end = (complex(*POINTS[min(leg, 1) + i]) for i in (0, 1))
        along = (end - start) / abs(end - start)
        beside = start + ((at - start) * along.conjugate()).real * along
        if step % round(PERIOD / STEP) == 0:
            held = s, beside, SPEED * along
            m = law.sample(m, held) if hasattr(law, "sample") else m
            rows.append([*s, *m])
            tau = law(m, held)[0]
        s, m = rk4(rates, s, tau), rk4(lambda m, held: law(m, held)[1], m, held)
    return np.array(rows)


def scenario(law: dict[str, Any], duration: float) -> dict[str, Any]:
    return {
        "vessel": HULL,
        "start": START,
        "disturbance": {"kind": "none"},
        "controller": law,
        "path": {"kind": "legs", "speed": SPEED, "acceptance": NEAR, "points": POINTS.tolist()},
        "actuator": {"kind": "ideal"},
        "control": {"period": PERIOD},
        "simulation": {"step": STEP, "duration": duration},
        "log": {"every": round(PERIOD / STEP)},
    }


def limited(integral: float, error: float, gain: float, full: bool) -> float:
    """ArduPilot's anti-windup: where the output is limited the integral only shrinks."""
    rate = gain * error
    if (full and error * integral >= 0.0) or (abs(integral) >= 1.0 and rate * integral > 0.0):
        return 0.0
    return rate


def ardupilot(guidance: str) -> Any:
    """The law by complex numbers; positions are x + iy, from north to east."""

    def wanted(s: Any, target: complex, moves: complex, m: Any) -> tuple[float, float, float]:
        bow, over_ground = turned(s[2]), complex(s[3], s[4]) * turned(s[2])
        if guidance == "position":
            wish = moves + 0.2 * (target - complex(s[0], s[1]))
            wish *= min(1.0, abs(moves) / abs(wish))
            force = 1.0 * (wish - over_ground) * bow.conjugate()
            u_d = max((wish * bow.conjugate()).real, 0.0)
            return u_d, force.imag / max(u_d, 1.0), 0.0
        along = moves / abs(moves)
        across = ((complex(s[0], s[1]) - target) * along.conjugate()).imag
        if abs(over_ground) < 0.1 or s[3] <= 0.0:
            over_ground = 0.1 * bow
        V = abs(over_ground)
        ahead = max(0.75 * 8.0 * V / math.pi, 1.2)
        eta_1 = math.asin(clip(-across / ahead, math.sin(math.pi / 4)))
        eta = clip(eta_1 + m[2] + angle_of(along / over_ground), math.pi / 2)
        learns = 0.02 * eta_1 if abs(eta_1) < math.radians(5.0) else 0.0
        learns = 0.0 if abs(m[2]) >= 0.1 and learns * m[2] > 0.0 else learns
        force = 4.0 * 0.75**2 * V**2 / ahead * math.sin(eta)
        return SPEED, force / math.copysign(max(abs(s[3]), 1.0), s[3]), learns

    def law(m: Any, seen: Any) -> tuple[Any, Any]:
        s = seen[0]
        u_d, turn, learns = wanted(*seen, m)
        r_d = clip(turn, 0.6)
        u_e, r_e = u_d - s[3], r_d - s[5]
        throttle, steering = 0.45 * u_d + 0.5 * u_e + m[0], 0.8 * r_d + 0.5 * r_e + m[1]
        t, q = clip(throttle), clip(steering)
        over = max(1.0, abs(t) + abs(q))
        both = over > 1.0
        return [80.0 * t / over, 40.0 * q / over], np.array(
            [
                limited(m[0], u_e, 0.3, both or abs(throttle) > 1.0),
                limited(m[1], r_e, 0.4, both or abs(steering) > 1.0),
                learns,
            ]
        )

    return law


@pytest.mark.parametrize("guidance", ["position", "l1"])
def test_ardupilot_sails_as_in_a_plain_loop_at_an_awkward_period(guidance: str) -> None:
    law = {"kind": "ardupilot", "guidance": guidance, "l1_least": 1.2} | GAINS
    out = podusv.simulate(scenario(law, TIME))
    states = ("x", "y", "psi", "u", "v", "r", "throttle_i", "steering_i", "cross_i")
    own = sailed(ardupilot(guidance), np.zeros(3), TIME)[: len(out["time"])]
    ran = np.array([out[name] for name in states]).T[: len(own)]
    np.testing.assert_allclose(ran, own, atol=1e-9)
    assert out["leg"].max() >= 1
    total = np.abs(out["throttle"]) + np.abs(out["steering"])
    assert total.max() == pytest.approx(1.0), "the mixer has been at work"


@pytest.mark.parametrize("across", [-4.3, 4.3])
def test_l1_turns_the_way_that_its_source_turns_where_a_boat_faces_away(across: float) -> None:
    """The angle to the path alone is wrapped: beside it and facing away, the sum goes beyond pi.

    Wrapped as a whole it turned the other way round.
    """
    start = {"x": 3.0, "y": across, "psi": math.copysign(2.8, across), "u": 0.6}
    law = {"kind": "ardupilot", "guidance": "l1", "l1_least": 1.2} | GAINS
    out = podusv.simulate(scenario(law, 26.0) | {"start": start})
    own = sailed(ardupilot("l1"), np.zeros(3), 26.0, start)[: len(out["time"])]
    ran = np.array([out[name] for name in ("x", "y", "psi", "u", "v", "r")]).T[: len(own)]
    np.testing.assert_allclose(ran, own[:, :6], atol=1e-9)
    assert out["steering"][0] * across < 0.0
    course, sight = math.atan2(3.0, 12.0), -math.copysign(math.pi / 4, across)
    facing = (course - start["psi"] + math.pi) % (2.0 * math.pi) - math.pi
    assert abs(sight + facing) > math.pi


def px4() -> Any:
    """The law by complex numbers; `sample` first, as the firmware's state machine."""

    def sight(s: Any, target: complex, moves: complex) -> float:
        along = moves / abs(moves)
        across = ((complex(s[0], s[1]) - target) * along.conjugate()).imag
        reach = min(max(1.5 * SPEED, 1.0), 10.0)
        ahead = math.sqrt(max(reach**2 - across**2, 0.0))
        return angle_of(along * complex(ahead, -across) / turned(s[2]))

    def turn(off: float) -> float:
        r_d = clip(1.1 * off, 0.6)
        return r_d if abs(r_d) > 0.05 else 0.0

    def law(m: Any, seen: Any) -> tuple[Any, Any]:
        s, r_d = seen[0], turn(sight(*seen))
        r_e = r_d - (s[5] if abs(s[5]) > 0.05 else 0.0)
        steering = clip(0.8 * r_d + clip(0.5 * r_e + m[1])) if r_d else 0.0
        u_d = min((1.0 - m[2]) * SPEED, (1.0 - abs(steering)) / 0.45)
        V = math.hypot(s[3], s[4])
        u_e = u_d - (math.copysign(V, s[3]) if V > 0.1 else 0.0)
        throttle = clip(0.45 * u_d + clip(0.5 * u_e + m[0])) if u_d > 0.0 else 0.0
        room = 1.0 - abs(steering)
        learns = np.array([0.3 * u_e if u_d > 0.0 else 0.0, 0.4 * r_e if r_d else 0.0, 0.0])
        learns[(np.abs(m) >= 1.0) & (learns * m > 0.0)] = 0.0
        return [80.0 * clip(throttle, room), 40.0 * steering], learns

    def sample(m: Any, seen: Any) -> Any:
        off = sight(*seen)
        turns = float(abs(off) > (0.1 if m[2] else 0.3))
        return np.array([m[0] * (1.0 - turns), m[1] if turn(off) else 0.0, turns])

    law.sample = sample  # type: ignore[attr-defined]
    return law


def test_px4_sails_as_in_a_plain_loop_at_an_awkward_period() -> None:
    gains = GAINS | {"lookahead": 1.5, "yaw_P": 1.1, "stops_at": 0.3, "drives_at": 0.1}
    law = {"kind": "px4", "r_least": 0.05} | gains
    out = podusv.simulate(scenario(law, TIME))
    states = ("x", "y", "psi", "u", "v", "r", "throttle_i", "steering_i", "turns")
    own = sailed(px4(), np.zeros(3), TIME)[: len(out["time"])]
    ran = np.array([out[name] for name in states]).T[: len(own)]
    np.testing.assert_allclose(ran, own, atol=1e-9)
    assert out["leg"].max() >= 1
    assert 0.05 < out["turns"].mean() < 0.95, "it has turned on the spot, and driven on"


def mss(learns: str) -> Any:
    """MSS's functions in continuous time: ALOSpsi or ILOSpsi, LOSobserver, SIMotter's PID."""
    D, gain, K_f, wn, zeta, T, w_u = 4.0, 0.05, 0.4, 1.2, 0.9, 1.5, 0.8
    T_f, m11, m33 = 1.0 / (K_f + 2.0 * math.sqrt(K_f) + 1.0), 64.0, 35.0
    K_p, K_d, T_i = m33 * wn**2, m33 * (2.0 * zeta * wn - 1.0 / T), 10.0 / wn

    def law(m: Any, seen: Any) -> tuple[Any, Any]:
        s, target, moves = seen
        beta, y_i, force, z, psi_d, xi = m
        along = moves / abs(moves)
        y = ((complex(s[0], s[1]) - target) * along.conjugate()).imag
        pi_h = angle_of(along)
        if learns == "published":
            psi_ref = pi_h - beta - math.atan(y / D)
            learnt = [gain * D * y / math.sqrt(D**2 + y**2), 0.0]
        else:  # its y_int times kappa
            psi_ref = pi_h - math.atan((y + y_i) / D)
            learnt = [0.0, gain * D * y / (D**2 + (y + y_i) ** 2)]
        r_d = psi_d - xi
        off = angle_of(turned(s[2] - psi_d))
        yaw = m33 / T * r_d - (K_p * (off + z / T_i) + K_d * (s[5] - r_d))
        chi_off = s[2] - pi_h
        aimed = (SPEED + s[4] * math.sin(chi_off)) / max(math.cos(chi_off), 0.2)
        u_d = min(max(aimed, 0.1, 0.25 * (abs(y) - D)), 1.2)
        surge = 2.0 * m11 * w_u * (u_d - s[3]) + force
        return [surge, yaw], np.array(
            [
                *learnt,
                m11 * w_u**2 * (u_d - s[3]),
                off,
                r_d + K_f * angle_of(turned(psi_ref - psi_d)),
                r_d / T_f,
            ]
        )

    return law


@pytest.mark.parametrize("learns", ["published", "integral"])
def test_mss_sails_as_in_a_plain_loop_at_an_awkward_period(learns: str) -> None:
    law = {
        "kind": "mss",
        "learns": learns,
        "lookahead": 4.0,
        "gamma": 0.05,
        "sigma": 0.05,
        "K_f": 0.4,
        "wn": 1.2,
        "zeta": 0.9,
        "T": 1.5,
        "omega_u": 0.8,
        "k_s": 0.25,
        "U": 1.2,
        "U_min": 0.1,
        "V_m": 0.02,
        "chi_m": 0.3,
    }
    out = podusv.simulate(scenario(law, TIME))
    memory = ("crab", "offset", "force_i", "heading_i", "psi_f", "xi")
    begins = [0.0] * 4 + [START["psi"]] * 2
    own = sailed(mss(learns), begins, TIME)[: len(out["time"])]
    ran = np.array([out[name] for name in ("x", "y", "psi", "u", "v", "r", *memory)]).T
    np.testing.assert_allclose(ran[: len(own)], own, atol=1e-9)
    assert out["leg"].max() >= 1


# --- what follows from the equations


def test_mss_places_its_poles() -> None:
    """The observer's at K_f + sqrt(K_f), twice; without T_i the heading's by wn and zeta.

    The source says so of Nomoto's model r' = (K tau - r)/T with K = T/m33.
    """
    law, h = Mss(wn=1.1, zeta=0.8, T=1.6, K_f=0.35), 1e-6
    x, memory = np.zeros(6), np.zeros(6)

    def slope(place: int, of: Any) -> Any:
        ends = []
        for side in (h, -h):
            state, own = x.copy(), memory.copy()
            (state if place < 6 else own)[place % 6] = side
            ends.append(of(ask(law, state, own, np.array([0, 0, 1.0, 0, 0, 0]), NONLINEAR)))
        return (ends[0] - ends[1]) / (2 * h)

    filtered = np.array([slope(6 + i, lambda a: a.rate[4:]) for i in (4, 5)]).T
    w = 0.35 + math.sqrt(0.35)
    np.testing.assert_allclose(np.poly(filtered), [1.0, 2 * w, w * w], rtol=1e-6)
    by_psi, by_r = (slope(i, lambda a: a.tau[1] / NONLINEAR.m33) for i in (2, 5))
    poles = np.poly([[by_r - 1.0 / 1.6, by_psi], [1.0, 0.0]])
    np.testing.assert_allclose(poles, [1.0, 2 * 0.8 * 1.1, 1.1**2], rtol=1e-6)


@pytest.mark.parametrize("law", [ArduPilot(), ArduPilot(guidance="l1"), Px4()], ids=str)
def test_port_and_starboard_are_alike(law: Any) -> None:
    mirror, flip = np.array([1, -1, -1, 1, -1, -1.0]), np.array([1, -1, 1, -1, 1, -1.0])
    own = np.array([-1.0 if s.name in ("steering_i", "cross_i") else 1.0 for s, _ in law.slots()])
    for x, memory, target in situations(law, 30):
        answer = ask(law, x, memory, target, NONLINEAR)
        other = ask(law, x * mirror, memory * own, target * flip, NONLINEAR)
        np.testing.assert_allclose(other.tau, answer.tau * [1, -1], atol=1e-9)
        np.testing.assert_allclose(other.rate, answer.rate * own, atol=1e-9)


def test_l1_comes_to_a_line_with_its_period_and_its_damping() -> None:
    """y'' = lateral acceleration, linearised on the line at 1.7 m/s, above the least speed."""
    law, V, h = ArduPilot(guidance="l1", l1_period=11.0, l1_damping=0.65), 1.7, 1e-5
    k, target = bundle(law.constants()), np.array([0.0, 0, 1.5, 0, 0, 0])

    def sideways(across: float, course: float) -> float:
        x = np.array([0.0, across, course, V, 0.0, 0.0])
        return V * by_l1(x, target, 0.0, k)[1]

    by_place = (sideways(h, 0.0) - sideways(-h, 0.0)) / (2 * h)
    by_rate = (sideways(0.0, h) - sideways(0.0, -h)) / (2 * h * V)
    w = 2 * math.pi / 11.0
    assert (-by_place, -by_rate) == pytest.approx((w * w, 2 * 0.65 * w), rel=1e-6)


def drifting(**law: Any) -> Any:
    """The last row of a long run along a line at 1.2 m/s, in a constant load across and ahead.

    The hull is damped enough to be stable on a straight course, which these laws need.
    """
    means = {"b_u": 5.0, "b_v": 15.0, "b_r": 4.0}
    still = {name: {"mean": mean, "sin": 0.0, "cos": 0.0} for name, mean in means.items()}
    out = podusv.simulate(
        {
            "vessel": HULL | {"Y_v": -150.0, "N_r": -150.0},
            "start": START,
            "path": {"kind": "line", "speed": 1.2},
            "disturbance": {"kind": "harmonic", **still},
            "controller": law,
            "actuator": {"kind": "saturated", "surge_limit": 160.0, "yaw_limit": 80.0},
            "simulation": {"step": 0.02, "duration": 300.0},
            "log": {"every": 50},
        }
    )
    last = {name: out[name][-1] for name in ("psi", "u", "v")}
    return last | {"e": out["y"][-1] - out["y_d"][-1], "along": out["x_d"][-1] - out["x"][-1]}


@pytest.mark.parametrize("guidance", ["position", "l1"])
def test_ardupilot_comes_to_a_line_in_a_constant_load(guidance: str) -> None:
    """A steady state has r_d = 0: the velocity over ground is the wanted one, so e = 0."""
    at = drifting(kind="ardupilot", guidance=guidance)
    assert abs(at["e"]) < 1e-4
    assert abs(at["v"]) > 0.08, "it drifts"


def test_a_velocity_that_is_fed_forward_leaves_an_offset() -> None:
    """vel_P (w - v) + vel_FF w = 0 for the wanted velocity w across the bow, v the drift."""
    at = drifting(kind="ardupilot", vel_FF=0.5)
    wanted = complex(1.2 + 0.2 * at["along"], -0.2 * at["e"])
    wanted *= min(1.0, (1.2 + 0.2 * max(at["along"], 0.0)) / abs(wanted))
    assert (wanted / turned(at["psi"])).imag == pytest.approx(at["v"] / 1.5, rel=1e-3)
    assert abs(at["e"]) > 0.04


def test_px4_stays_beside_a_line_by_the_sine_of_the_crab_angle() -> None:
    """The bow points at the path a lookahead away, within the yaw rate that counts as none."""
    gains = {"rate_FF": 2.0, "rate_P": 1.0, "rate_I": 1.0, "stops_at": 1.0, "drives_at": 0.5}
    at = drifting(kind="px4", lookahead_min=3.0, r_least=0.002, **gains)
    crab = math.atan2(at["v"], at["u"])
    assert at["e"] == pytest.approx(3.0 * math.sin(crab), abs=3.0 * 2 * 0.002)
    assert abs(at["e"]) > 0.2


@pytest.mark.parametrize(
    "law", [{"kind": "ardupilot"}, {"kind": "ardupilot", "guidance": "l1"}, {"kind": "px4"}]
)
def test_they_stay_at_a_target_that_comes_to_rest(law: dict[str, Any]) -> None:
    """The sources aim at a waypoint itself where the line to it has no length."""
    out = podusv.simulate(
        {
            "vessel": {"preset": "otter"},
            "actuator": {"kind": "pod", "preset": "otter"},
            "path": {
                "kind": "waypoints",
                "legs": "straight",
                "after": "stop",
                "speed": 1.0,
                "points": [[0.0, 0.0], [30.0, 20.0]],
            },
            "disturbance": {"kind": "none"},
            "controller": law,
            "log": {"every": 50},
            "simulation": {"step": 0.02, "duration": 200.0},
            "start": {"x": -5.0, "y": 3.0},
        }
    )
    beside = np.hypot(out["x"] - out["x_d"], out["y"] - out["y_d"])
    assert beside[out["time"] > 50.0].max() < 7.5


def circled(law: dict[str, Any], radius: float) -> tuple[float, float]:
    """Steering over yaw rate and throttle over speed of the Otter in a circle at half its speed."""
    out = podusv.simulate(
        {
            "vessel": {"preset": "otter"},
            "actuator": {"kind": "pod", "preset": "otter"},
            "path": {"kind": "circle", "radius": radius, "speed": 1.543},
            "disturbance": {"kind": "none"},
            "controller": law,
            "log": {"every": 50},
            "simulation": {"step": 0.02, "duration": 200.0},
        }
    )
    speed = math.hypot(out["u"][-1], out["v"][-1])
    return abs(out["steering"][-1] / out["r"][-1]), out["throttle"][-1] / speed


def test_gains_are_those_that_quicktune_and_px4_s_guide_measure_on_the_water() -> None:
    """In a circle with 10 deg/s: 0.9 of what is seen, half of it for P and I; throttle as seen.

    PX4: the same circle, and full throttle; P and I as parts of it on the R1 rover.
    """
    turn, throttle = circled({"kind": "ardupilot"}, 1.543 / math.radians(10.0))
    base = {"vessel": {"preset": "otter"}, "actuator": {"kind": "pod", "preset": "otter"}}
    base |= {"path": {"kind": "line"}, "disturbance": {"kind": "none"}}
    ap, px = (
        podusv.load(base | {"controller": {"kind": kind}}).controller
        for kind in ("ardupilot", "px4")
    )
    seen = [0.9 * turn, 0.45 * turn, 0.45 * turn, throttle, throttle, throttle]
    own = [ap.rate_FF, ap.rate_P, ap.rate_I, ap.speed_FF, ap.speed_P, ap.speed_I]
    assert own == pytest.approx(seen, rel=0.02)
    r1_rate, r1_speed = 0.3 * 2.7 / (2 * 1.9), 1.0 / 1.9  # RD_WHEEL_TRACK, RO_YAW_RATE_CORR, ...
    top = 3.086  # m/s, the Otter's
    told = [turn, turn * 0.1 / r1_rate, turn * 0.1 / r1_rate]
    told += [1.0 / top, 0.1 / r1_speed / top, 0.01 / r1_speed / top]
    own = [px.rate_FF, px.rate_P, px.rate_I, px.speed_FF, px.speed_P, px.speed_I]
    assert own == pytest.approx(told, rel=0.02)
    assert (ap.surge, ap.yaw) == pytest.approx((239.3, 73.6), rel=1e-2)


def test_where_ten_degrees_a_second_take_more_than_all_there_is_the_circle_is_wider() -> None:
    heavy = NONLINEAR.model_copy(update={"N_r": -60.0})
    facts = Facts(heavy, Saturated())
    assert facts.steering > 1.0 / math.radians(10.0)


def test_on_a_hull_without_a_stable_course_they_swing_as_the_page_says() -> None:
    page, found = (Path(__file__).parents[3] / "docs" / "laws" / "ardupilot.md").read_text(), []
    for law in ({"kind": "ardupilot"}, {"kind": "ardupilot", "guidance": "l1"}, {"kind": "px4"}):
        out = podusv.simulate(
            {
                "vessel": {"preset": "paper_nonlinear"},
                "start": {"x": -1.0, "y": 0.5, "u": 0.5},
                "path": {"kind": "legs", "speed": 0.5, "points": [[0, 0], [300, 0]]},
                "disturbance": {"kind": "none"},
                "controller": law | {"mixing": "separate"},
                "actuator": {"kind": "saturated"},
                "log": {"every": 10},
                "simulation": {"step": 0.01, "duration": 400.0},
            }
        )
        found.append(np.abs(out["e_ct"][out["time"] > 300]).max())
    said = "by {:.1f} m with `position`, {:.0f} m with `l1` and {:.1f} m with `px4`"
    assert said.format(*found) in page


def test_a_hull_that_needs_no_steering_to_turn_has_no_such_gains() -> None:
    text = {"vessel": {"preset": "cybership1"}, "path": {"kind": "line"}}
    text |= {"disturbance": {"kind": "none"}, "actuator": {"kind": "saturated"}}
    with pytest.raises(ScenarioError, match="rate_FF of law ardupilot does not follow"):
        podusv.load(text | {"controller": {"kind": "ardupilot"}})
