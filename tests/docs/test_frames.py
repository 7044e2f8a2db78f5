"""The drawing of frames and angles in docs/model.md has podusv's signs."""

from __future__ import annotations

import runpy
from types import SimpleNamespace

import numpy as np
import pytest
from command_samples import ROOT
from conftest import PAPER

from podusv_cli.components.actuators.propeller import force
from podusv_cli.components.vessels.plant import plant
from podusv_cli.core.kernel import bundle
from podusv_cli.core.kinematics import direction

DRAWN = SimpleNamespace(**runpy.run_path(str(ROOT / "examples/frames.py")))


def test_the_body_axes_are_those_along_which_the_plant_moves() -> None:
    k = bundle(PAPER.constants())
    for velocity, point in (((1.0, 0.0), (1.0, 0.0)), ((0.0, 1.0), (0.0, 1.0))):
        rate = np.zeros(6)
        x = np.array([0.0, 0.0, DRAWN.PSI, *velocity, 0.0])
        plant(x, np.zeros(3), np.zeros(3), k, rate)
        assert rate[:2] == pytest.approx(DRAWN.in_earth(point) - DRAWN.VESSEL)


def test_angles_and_thrust_have_the_signs_of_the_kernels() -> None:
    x_e, y_e = DRAWN.TARGET - DRAWN.VESSEL
    assert direction(x_e, y_e) == pytest.approx(DRAWN.PSI_D)
    assert 0.0 < DRAWN.PSI < DRAWN.PSI_D
    along, across = force(1.0, DRAWN.DELTA)
    drawn = DRAWN.ahead(DRAWN.PSI + DRAWN.DELTA)
    assert drawn == pytest.approx(DRAWN.in_earth((along, across)) - DRAWN.VESSEL)


def test_the_picture_is_drawn(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr("sys.argv", ["frames.py", str(tmp_path / "frames.png")])
    DRAWN.main()
    assert (tmp_path / "frames.png").read_bytes()[:4] == b"\x89PNG"
