"""The closed loop of law, observer and hull on a straight line in calm water, linearised."""

from typing import Any

import numpy as np
from conftest import ask

from podusv_cli.components.vessels.plant import plant
from podusv_cli.components.vessels.vessel import Vessel
from podusv_cli.core.kernel import Vector, bundle, call


def line_rates(law: Any, s: Vector, vessel: Vessel, V: float, share: float) -> Vector:
    """Of (x, memory) in the frame of a target that goes north at V [m/s].

    `share` is the sway force that comes with a yaw moment of 1 N m [1/m].
    """
    x, memory, out = s[:6].copy(), s[6:].copy(), np.zeros(6)
    found = ask(law, x, memory, np.array([0.0, 0.0, V, 0.0, 0.0, 0.0]), vessel)
    tau = np.array([found.tau[0], share * found.tau[1], found.tau[1]])
    call(
        law.after_saturation,
        t=1.0,
        x=x,
        memory=memory,
        demand=found.tau,
        tau=tau,
        k=bundle(law.constants_with(vessel)),
        table=law.table(),
        rate=found.rate,
    )
    plant(x, tau, np.zeros(3), bundle(vessel.constants()), out)
    out[0] -= V
    return np.concatenate([out, found.rate])


def line_eigenvalues(law: Any, vessel: Vessel, V: float, share: float = 0.0) -> Vector:
    """Of the whole loop on the target, told exactly; by central differences."""
    x = np.array([0.0, 0.0, 0.0, V, 0.0, 0.0])
    s = np.concatenate([x, law.start(x, np.zeros(6), vessel)])
    assert abs(line_rates(law, s, vessel, V, share)).max() < 1e-12
    columns = [
        (line_rates(law, s + d, vessel, V, share) - line_rates(law, s - d, vessel, V, share)) / 2e-7
        for d in 1e-7 * np.eye(len(s))
    ]
    return moving_eigenvalues(law, np.transpose(columns))


def places(law: Any, name: str) -> list[int]:
    """Where a part of the memory lies in (x, memory)."""
    return [6 + i for i, (signal, _) in enumerate(law.slots()) if signal.name == name]


def moving_eigenvalues(law: Any, loop: Vector) -> Vector:
    """Without what the law learns, whose rate is of second order and so a parameter here."""
    learnt = places(law, "dP")
    assert not loop[learnt].any()
    kept = np.setdiff1d(np.arange(len(loop)), learnt)
    return np.asarray(np.linalg.eigvals(loop[np.ix_(kept, kept)]))


def furthest(found: Vector, among: Vector) -> float:
    """The largest distance of one of these roots to the nearest of the others [1/s]."""
    return float(max(abs(among - root).min() for root in found))
