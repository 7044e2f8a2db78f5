"""Nonlinear model-predictive control that steers a session of podusv: python nmpc.py

Every 0.1 s IPOPT minimises the distance to the target over the next 8 s, from the measured state,
with the nominal vessel, the load that an observer estimates, and the target going on along its
circle. It is a reference for comparisons: what a causal law can reach with a good model and far too
much computing. Needs CasADi.
"""

import casadi as ca
import numpy as np

import podusv

PERIOD = 0.1  # s, between two plans
STEPS, STEP = 40, 0.2  # demands in a plan, and for how long each of them holds in it [s]
SMOOTH = 0.02  # m, distance below which the cost becomes a square
CHANGE = 0.01  # m s, cost of a demand that changes from limit to limit in a step of the plan
# Of the observer, from its bandwidth in surge, sway and yaw [rad/s]
POLE = np.exp(-PERIOD * np.array([2.5, 2.0, 1.2]))
IPOPT = {
    "ipopt.print_level": 0,
    "ipopt.sb": "yes",
    "print_time": False,
    "expand": True,
    "ipopt.max_iter": 100,
    "ipopt.tol": 1e-5,
    "ipopt.mu_init": 1e-3,
}


class Nmpc:
    """The controller of a scenario: a demand for each observation."""

    def __init__(self, scenario, steps=STEPS):
        """The observer knows no load, and the plan is no demand."""
        self.vessel, actuator = scenario.nominal, scenario.actuator
        self.ahead = ahead(self.vessel)
        self.planned = planner(self.ahead, [actuator.surge_limit, actuator.yaw_limit], steps)
        self.plan, self.load, self.expected = np.zeros((steps, 2)), np.zeros(3), None
        self.unsolved = 0

    def demand(self, seen):
        """Plan anew from the plan before, and take the first demand (tau_u [N], tau_r [N m])."""
        self.observe(seen.state)
        places = predicted(seen.target, len(self.plan))
        self.plan, solved = self.planned(seen.state, self.plan, self.load, places)
        self.unsolved += not solved
        self.expect(seen.state, self.plan[0])
        return self.plan[0]

    def observe(self, state):
        """Correct the load by what the velocities have more than was expected."""
        v = self.vessel
        self.error = np.zeros(3) if self.expected is None else state[3:] - self.expected
        inertia = np.array([[v.m11, 0.0, 0.0], [0.0, v.m22, v.m23], [0.0, v.m32, v.m33]])
        self.load = self.load + inertia @ ((1.0 - POLE) ** 2 / PERIOD * self.error)

    def expect(self, state, demand):
        """Which velocities the next state has; so both poles of the observer are at POLE."""
        after = self.ahead(state, demand, self.load, PERIOD).full().ravel()
        self.expected = after[3:] - POLE**2 * self.error


def rate(vessel, x, demand, load):
    """Rate of the state (x, y, psi, u, v, r), the plant of docs/model.md on CasADi's symbols."""
    k, (psi, u, v, r) = vessel, ca.vertsplit(x[2:])
    au, av, ar, momentum = ca.fabs(u), ca.fabs(v), ca.fabs(r), k.m22 * v + k.m23 * r
    force = (
        ca.vertcat(
            k.coriolis * momentum * r + (k.X_u + k.X_uu * au + k.X_uuu * u * u) * u,
            -k.coriolis * k.m11 * u * r
            + (k.Y_v + k.Y_vv * av + k.Y_rv * ar) * v
            + (k.Y_r + k.Y_vr * av + k.Y_rr * ar) * r,
            k.coriolis * (k.m11 * v - momentum) * u
            + (k.N_v + k.N_vv * av + k.N_rv * ar) * v
            + (k.N_r + k.N_vr * av + k.N_rr * ar) * r,
        )
        + load
        + ca.vertcat(demand[0], 0.0, demand[1])
    )
    determinant = k.m22 * k.m33 - k.m23 * k.m32
    return ca.vertcat(
        u * ca.cos(psi) - v * ca.sin(psi),
        u * ca.sin(psi) + v * ca.cos(psi),
        r,
        force[0] / k.m11,
        (k.m33 * force[1] - k.m23 * force[2]) / determinant,
        (k.m22 * force[2] - k.m32 * force[1]) / determinant,
    )


def ahead(vessel):
    """A function from state, demand, load and time [s] to the state then, by Runge and Kutta."""
    x, demand, load, h = (ca.SX.sym(*one) for one in (("x", 6), ("demand", 2), ("load", 3), ("h",)))
    k1 = rate(vessel, x, demand, load)
    k2 = rate(vessel, x + h / 2.0 * k1, demand, load)
    k3 = rate(vessel, x + h / 2.0 * k2, demand, load)
    k4 = rate(vessel, x + h * k3, demand, load)
    after = x + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
    return ca.Function("ahead", [x, demand, load, h], [after])


def predicted(target, steps):
    """Where the target is after each step of a plan if it keeps its speed and yaw rate, a row each.

    `target` is position, velocity and acceleration, north and east.
    """
    times = STEP * np.arange(1, steps + 1)
    position, velocity, acceleration = target[0::2] + 1j * target[1::2]
    squared = abs(velocity) ** 2
    turning = (velocity.conjugate() * acceleration).imag / squared if squared > 0.0 else 0.0
    half = 0.5 * turning * times
    places = position + times * np.sinc(half / np.pi) * np.exp(1j * half) * velocity
    return np.column_stack([places.real, places.imag])


def planner(ahead, limits, n):
    """A function from state, last plan, load and places to a new plan, and whether it is solved.

    The cost is the integral of sqrt(e^2 + SMOOTH^2) and a little for changes of the demand.
    """
    w, p = ca.MX.sym("w", 8, n), ca.MX.sym("p", 11 + 2 * n)
    demands, states = w[:2, :], w[2:, :]  # demand of a step, and the state after it
    begin, load, last, places = p[:6], p[6:9], p[9:11], ca.reshape(p[11:], 2, n)
    before = ca.horzcat(begin, states[:, :-1])
    away = ca.sum1((states[:2, :] - places) ** 2)
    changes = (demands - ca.horzcat(last, demands[:, :-1])) / (2.0 * ca.DM(limits))
    cost = STEP * ca.sum2(ca.sqrt(away + SMOOTH**2)) + CHANGE * ca.sumsqr(changes)
    gaps = states - ahead.map(n)(before, demands, ca.repmat(load, 1, n), STEP)
    program = {"x": ca.vec(w), "p": p, "f": cost, "g": ca.vec(gaps)}
    solver = ca.nlpsol("nmpc", "ipopt", program, IPOPT)
    high = np.tile([*limits, *[np.inf] * 6], n)

    def plan(state, last, load, places):
        guess, x = np.empty((n, 8)), state
        for row, demand in zip(guess, last, strict=True):
            x = ahead(x, demand, load, STEP).full().ravel()
            row[:] = *demand, *x
        given = np.concatenate([state, load, last[0], places.ravel()])
        found = solver(x0=guess.ravel(), p=given, lbx=-high, ubx=high, lbg=0.0, ubg=0.0)
        demands = found["x"].full().reshape(n, 8)[:, :2].clip(-np.array(limits), limits)
        return demands, solver.stats()["success"]

    return plan


def steer(session):
    """Steer a session to its end; the controller, with what it has counted."""
    controller, seen = Nmpc(session.scenario), session.observe()
    while seen.status == "running":
        seen = session.step(controller.demand(seen))
    return controller


if __name__ == "__main__":
    session = podusv.open_session("podusv:laws/rivals.yaml", {"log.every": 10}, period=PERIOD)
    print(f"{steer(session).unsolved} problems not solved; {session.close('nmpc', force=True)}")
