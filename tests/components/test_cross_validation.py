"""Beside public simulators: numbers that their own code gave, not podusv.

MSS: github.com/cybergalactic/MSS, commit 736a3d1 of 2026-07-24, run by GNU Octave 7.3.
PVS: github.com/cybergalactic/PythonVehicleSimulator, commit c717e07 of 2025-05-13, run by Python.

Accelerations and the turn are those of the Otter: `otter(x, n, 0, 0, V_c, beta_c)` of MSS, and
`otter.dynamics` of PVS, whose step of Euler's method over 1 s from nu gives nu + nu'. PVS has its
payload of 25 kg, other added mass and other yaw inertia, so it is a second hull. Three things were
switched off in both, so that the rest can be compared to the last digit: the cross-flow drag
(`crossFlowDrag` gives zeros), the height of the centre of gravity (its z is 0, so that roll and
pitch stay at rest), and in PVS the payload's trim moment (`mp` is 0 after the masses are made).
The preset `otter`, whose drag is a fit, is compared with the whole of `otter.m` further down.

All numbers are rounded to 12 digits.
"""

import math

import numpy as np
import pytest
from conftest import VESSELS, Constant, adrift, run

from podusv_cli.components.disturbances import spectra
from podusv_cli.components.disturbances.current import Current
from podusv_cli.components.disturbances.wind import blendermann
from podusv_cli.components.vessels.plant import plant
from podusv_cli.components.vessels.vessel import Vessel
from podusv_cli.components.vessels.windage import Windage
from podusv_cli.core.kernel import bundle, call

PI = math.pi


def otter(m, x_g, inertia, X_udot):
    """The Otter of a public program, from what that program is given; inertia about the centre."""
    I_z, added = inertia + m * x_g**2, 1.7 * inertia
    sway, yaw = m + 82.5, I_z + added
    return Vessel(
        length=2.0,
        beam=1.08,
        m=m,
        x_g=x_g,
        I_z=I_z,
        X_udot=X_udot,
        Y_vdot=-82.5,
        N_rdot=-added,
        X_u=-24.4 * 9.81 / (6 * 0.5144),
        Y_v=-sway,
        N_r=-yaw,
        N_rr=-10.0 * yaw,
    )


HULLS = {
    "MSS": otter(55.0, 0.2, 13.75, -2.7 * 1025.0 * (55.0 / 1025.0) ** (5 / 3) / 4.0),
    "PVS": otter(80.0, 12.25 / 80.0, 15.102099609375, -5.5),
}
# (u, v, r, psi, V_c, beta_c), (tau_u, tau_r), (u', v', r') by MSS and by PVS.
ACCELERATIONS = [
    (
        (0, 0, 0, 0.4, 0.3, 0.8),
        (0, 0),
        (0.35549382971, 0.124686648975, -0.0982643285249),
        (0.25063986859, 0.123901395805, -0.0938638882205),
    ),
    ((1.5, 0, 0, 0, 0, 0), (79.776, 0), (-0.606415496994, 0, 0), (-0.427551444708, 0, 0)),
    (
        (1.5, 0.2, 0.1, 0, 0, 0),
        (57.616, 8.7532),
        (-0.926579946675, -0.222054617129, -0.546338026922),
        (-0.647288286813, -0.240447099949, -0.510395612928),
    ),
    (
        (1.5, 0.2, 0.1, 0, 0.5, 0),
        (57.616, 8.7532),
        (-0.283311238043, -0.266845151178, -0.337449437638),
        (-0.193753594718, -0.278574334719, -0.318911886383),
    ),
    (
        (1.5, 0.2, 0.1, 0, 0.5, PI / 2),
        (57.616, 8.7532),
        (-0.990628163854, 0.168877656523, 0.81700855242),
        (-0.69231752658, 0.166288621219, 0.726783596081),
    ),
    (
        (1.5, 0.2, 0.1, 0, 0.5, PI),
        (57.616, 8.7532),
        (-1.56984865531, -0.177264083081, -0.755226616205),
        (-1.10082297891, -0.202319865178, -0.701879339472),
    ),
    (
        (1, -0.3, -0.4, 2, 0.5, -1),
        (65.1115, 30.3014375),
        (-0.576486778923, 0.00934257193396, 3.55335102263),
        (-0.368951269286, 0.0883248546333, 3.41921028731),
    ),
    (
        (2.5, 0.1, 0.6, -2.5, 0.8, 0.7),
        (104.429, 37.748175),
        (-2.27302158715, -0.170232066377, -4.5622601966),
        (-1.57985169886, -0.368621786796, -4.51352027574),
    ),
    (
        (-0.6, 0.25, 0.2, 1.2, 0.3, 2.6),
        (-57.3605, 9.9285225),
        (-0.0684127522421, 0.125100137372, -0.407287387335),
        (-0.0328784416126, 0.136013396395, -0.42544904306),
    ),
    (
        (0, 0, 0.5, -0.7, 0.6, 2.2),
        (7.416, 11.0758),
        (-0.672803302081, 0.523171924832, -2.70048147285),
        (-0.470519591861, 0.487322734045, -2.72930620971),
    ),
    (
        (0.3, 0.4, -0.6, 3, 1, -3),
        (0, 0),
        (0.582346880319, -0.0722887055522, 4.42688502379),
        (0.345241261418, -0.0861038610501, 4.42014392826),
    ),
    ((3, 0, 0, 0.5, 0.25, 0.5), (239.2218536, 0), (0.430433144477, 0, 0), (0.303475609848, 0, 0)),
    (
        (0.8, 0.6, 0.3, -1.3, 0.4, -1.3),
        (144.04, -14.00512),
        (2.3018368604, -0.618896017803, -1.9214163703),
        (1.6768506089, -0.644008185031, -1.84560570877),
    ),
]


def accelerations(vessel, sea, motion, tau):
    u, v, r, psi = motion
    x, load, rate = np.array([0.0, 0.0, psi, u, v, r]), np.zeros(5), np.zeros(6)
    call(
        sea.evaluate,
        t=0.0,
        x=x,
        k=bundle(sea.constants_with(vessel)),
        table=sea.table_for(vessel, 1.0),
        b=load,
    )
    plant(x, np.array([tau[0], 0.0, tau[1]]), load, bundle(vessel.constants()), rate)
    return rate[3:]


@pytest.mark.parametrize("row", ACCELERATIONS)
def test_accelerations_in_a_current_are_those_of_two_public_programs(row):
    state, tau, *published = row
    sea = Current(speed=state[4], direction=state[5])
    for hull, expected in zip(HULLS.values(), published, strict=True):
        found = accelerations(hull, sea, state[:4], tau)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-11)


def test_without_the_waters_acceleration_a_turning_hull_differs_from_them_by_just_that():
    """What the form `no_acceleration` leaves out: nu_c' = (r v_c, -r u_c, 0)."""
    state, tau, published, _ = ACCELERATIONS[4]
    sea = Current(speed=0.5, direction=PI / 2, form="no_acceleration")
    apart = accelerations(HULLS["MSS"], sea, state[:4], tau) - np.array(published)
    np.testing.assert_allclose(apart, [-0.1 * 0.5, 0.0, 0.0], atol=1e-11)


# x, y, psi, u, v, r of MSS by its rk4.m with steps of 0.1 s, from rest at psi = 0.4, n = (70, 60)
# rad/s, V_c = 0.5, beta_c = 2.
TURN = {
    15.0: (
        1.01814031449,
        20.955385056185,
        2.19201336076,
        1.6945186555,
        -0.156584428967,
        0.115901118812,
    ),
    60.0: (
        -7.95834201451,
        30.8372108807,
        7.4073990332,
        1.5239071966,
        0.322862274976,
        0.115897277487,
    ),
}


def turned(vessel, step):
    sea, law = Current(speed=0.5, direction=2.0), Constant(surge=94.18, yaw=5.68958)
    start = (0.0, 0.0, 0.4, 0.0, 0.0, 0.0)
    log = run(adrift(vessel=vessel, disturbance=sea, controller=law, start=start), 60.0, step)
    return np.column_stack([log[name] for name in ("x", "y", "psi", "u", "v", "r")])


def test_a_minutes_turn_in_a_current_is_that_of_mss_by_the_same_method():
    found = turned(HULLS["MSS"], 0.1)
    for time, expected in TURN.items():
        np.testing.assert_allclose(found[round(time / 0.1)], expected, rtol=0, atol=1e-10)


# Left and right propeller [rad/s]: yaw rate [rad/s], radius [m], and x, y, psi of the whole of
# `otter.m`, nothing switched off, after 60 s from rest in calm water.
WHOLE = {
    (100, 95): (0.26592, 9.884, (8.5218, 19.7514, 15.3873)),
    (100, 80): (0.27260, 8.30, (-0.4552, 16.8069, 16.0513)),
    (100, 60): (0.28516, 6.57, (-5.4073, 9.6820, 16.9202)),
    (60, -60): (0.19854, 1.0868, (-0.7940, 0.2976, 11.8660)),
}


@pytest.mark.parametrize("turns", WHOLE)
def test_the_otter_with_its_drag_turns_as_the_whole_program_does(turns):
    """Without the four terms of cross-flow drag the first three end 5 to 13 m off."""
    left, right = ((0.01108 if n > 0 else -0.006445) * n**2 for n in turns)
    law = Constant(surge=left + right, yaw=0.395 * (left - right))
    log = run(adrift(vessel=VESSELS["otter"], controller=law, start=(0.0,) * 6), 60.0, 0.02)
    rate, radius, (x, y, psi) = WHOLE[turns]
    end = {name: log[name][-1] for name in ("x", "y", "psi", "u", "v", "r")}
    assert end["r"] == pytest.approx(rate, rel=0.007)
    assert math.hypot(end["u"], end["v"]) / end["r"] == pytest.approx(radius, rel=0.009)
    assert math.hypot(end["x"] - x, end["y"] - y) < 0.75
    assert end["psi"] == pytest.approx(psi, abs=0.083)


# The same in a current of 0.3 m/s to 0.7 rad: left and right propeller [rad/s], then x, y, psi.
IN_A_CURRENT = {
    (90, 85): (4.31929, 24.63173, 10.95537),
    (80, 60): (9.74380, 27.11613, 10.00879),
    (70, -30): (11.13045, 12.53453, 11.76562),
    (100, 90): (16.39593, 30.64153, 15.72138),
    (60, 55): (11.21956, 45.28777, 3.30648),
    (50, -50): (13.57002, 13.30069, 9.49394),
    (95, 70): (21.50226, 22.46004, 14.60957),
    (85, 40): (17.19970, 12.80700, 13.36011),
    (75, 74): (-4.05899, 47.60088, 4.11225),
    (65, 20): (13.02469, 19.49232, 9.62067),
}


@pytest.mark.parametrize("turns", IN_A_CURRENT)
def test_in_a_current_it_stays_with_the_whole_program_too(turns):
    """Within 0.62 m after 60 s; without cross-flow drag up to 26 m apart."""
    left, right = ((0.01108 if n > 0 else -0.006445) * n**2 for n in turns)
    law = Constant(surge=left + right, yaw=0.395 * (left - right))
    sea = Current(speed=0.3, direction=0.7)
    log = run(
        adrift(vessel=VESSELS["otter"], controller=law, start=(0.0,) * 6, disturbance=sea),
        60.0,
        0.02,
    )
    x, y, psi = IN_A_CURRENT[turns]
    assert math.hypot(log["x"][-1] - x, log["y"][-1] - y) < 0.63
    assert log["psi"][-1] == pytest.approx(psi, abs=0.071)


def test_a_minutes_turn_of_pvs_goes_to_podusvs_as_its_steps_get_smaller():
    """PVS has Euler's method, of first order; twice the finer result less the coarser is better."""
    coarse = np.array([-7.83235885496, 30.7278587529, 7.36381855517])  # steps of 0.01 s
    fine = np.array([-7.855653254, 30.7135515284, 7.36380149283])  # of 0.005 s
    found = turned(HULLS["PVS"], 0.1)[-1, :3]
    np.testing.assert_allclose(np.abs(fine - found) / np.abs(coarse - found), 0.5, atol=0.25)
    np.testing.assert_allclose(2.0 * fine - coarse, found, atol=1e-3)


# gamma [deg], then the load by MSS's blendermann94 for V_r = 8, A_F = 1.7, A_L = 4.2, lengths 0.35
# and 3.9, in air of 1.224 kg/m3; its ships number 11 (offshore supply vessel) and 14 (speed boat).
WIND = {
    (0.9, 0.55, 0.8, 0.55): [
        (10, -36.9605895982, 26.3474051968, 35.0467099764),
        (35, -36.7080203272, 103.912533715, 106.393094669),
        (60, -21.6758501747, 151.780841672, 108.912823112),
        (91, 0.929862557836, 148.064240576, 50.008369833),
        (120, 30.6861514687, 147.725661452, -2.59499926523),
        (150, 53.1499734326, 85.2894504058, -32.8477546907),
        (-20, -37.6316897962, -55.3732198017, -94.0095100599),
        (-140, 49.2083128255, -114.763793823, -363.572686979),
    ],
    (0.9, 0.55, 0.6, 0.6): [
        (10, -37.0441494963, 26.4069709807, 35.1259430067),
        (35, -37.4698135087, 106.069006849, 108.601046319),
        (60, -22.0441040487, 154.359466386, 110.763157411),
        (91, 0.697433443846, 148.071995294, 50.0109889715),
        (120, 23.9025230769, 153.424953947, -2.69511497762),
        (150, 41.4003843983, 88.5799384615, -34.1150291772),
        (-20, -37.9543548887, -55.848005951, -94.8155750393),
        (-140, 38.8600429807, -120.839365127, -382.820149181),
    ],
}


@pytest.mark.parametrize("coefficients", WIND)
def test_wind_loads_are_those_of_mss_but_for_the_moment_of_wind_from_starboard(coefficients):
    """There MSS counts the lever arm with gamma: too much by 0.36 |gamma| L of the sway force."""
    CD_t, bow, stern, delta = coefficients
    hull = Windage(
        A_F=1.7, A_L=4.2, s_L=0.35, CD_t=CD_t, CD_l_bow=bow, CD_l_stern=stern, delta=delta
    )
    k, load = bundle(hull.constants() | {"density": 1.224, "length": 3.9}), np.zeros(3)
    for degrees, X, Y, N in WIND[coefficients]:
        gamma = math.radians(degrees)
        blendermann(8.0 * math.cos(gamma), -8.0 * math.sin(gamma), k, load)
        N_mirrored = N - 0.36 * max(-gamma, 0.0) * 3.9 * Y
        np.testing.assert_allclose(load, [X, Y, N_mirrored], rtol=1e-10)


def test_the_jonswap_spectrum_is_that_of_mss():
    """`waveSpectrum(7, [2 1.1 3.3], ...)`, and [0.3 2 5]."""
    rates = np.array([0.8, 1.0, 1.2, 1.7, 2.5, 4.0])
    for sea, published in {
        (2.0, 1.1, 3.3): (
            0.0421331519572067,
            0.322528489149437,
            0.409622945414907,
            0.0680558945190943,
            0.0117551009216444,
            0.00116645752021312,
        ),
        (0.3, 2.0, 5.0): (
            4.60079958474611e-22,
            4.9908999224042e-10,
            6.30035817516837e-06,
            0.00182904199911386,
            0.00153732148977544,
            0.000218695217827425,
        ),
    }.items():
        np.testing.assert_allclose(spectra.jonswap(rates, *sea), published, rtol=1e-12)
