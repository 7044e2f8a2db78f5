"""A small task of two poses for laws of fully actuated vessels."""

import numpy as np

from podusv_cli.engine.running.simulate import to_end
from podusv_cli.scenario.load import load_text

BOAT = """
vessel: {preset: cybership2}
actuator: {kind: ideal_full}
disturbance: {kind: none}
start: {x: 0.0, y: 0.0, psi: 0.2}
simulation: {step: 0.02, duration: 12.0}
"""
POSES = "path: {kind: poses, poses: [[0, 0, 0.2], [2, 1, 1.0]], travel: 9.0, dwell: 1.0}\n"
HELD = "controller: {kind: pose_backstepping, k_p: 0.2, k_psi: 0.3, k_d: 0.6}\n"


def loaded_pose(text, *changes):
    """The scenario with its one law."""
    return load_text(text, "s.yaml", changes).scenario.alone()


def marched(text, *changes):
    """The recording of a scenario."""
    single = loaded_pose(text, *changes)
    single.ready()
    return to_end(single.plan())


def quintic(t, begin, end):
    """Place and its two rates between two poses that are left at 1 s and reached at 10 s."""
    s = min(max((t - 1.0) / 9.0, 0.0), 1.0)
    way = np.array(end) - np.array(begin)
    return (
        np.array(begin) + way * (10 * s**3 - 15 * s**4 + 6 * s**5),
        way * (30 * s**2 - 60 * s**3 + 30 * s**4) / 9.0,
        way * (60 * s - 180 * s**2 + 120 * s**3) / 81.0,
    )
