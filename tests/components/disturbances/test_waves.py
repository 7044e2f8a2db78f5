"""Waves: what the kernels add up, the encounter, first-order motion, drift, and what is refused."""

import math

import numpy as np
import pytest
from conftest import NONLINEAR, Constant, adrift, run
from scenario_samples import SOUND, told
from scipy.integrate import cumulative_trapezoid

from podusv_cli.components.disturbances import spectra
from podusv_cli.components.disturbances.base import WAVE_MOTION
from podusv_cli.components.disturbances.reflection import BOW_AND_STERN, SIDES, interpolate_shares
from podusv_cli.components.disturbances.spectra import GRAVITY, WATER
from podusv_cli.components.disturbances.total import Total
from podusv_cli.components.disturbances.wave_kernels import short_crested
from podusv_cli.components.disturbances.waves import Waves
from podusv_cli.components.disturbances.wind import Wind
from podusv_cli.core.kernel import bundle
from podusv_cli.scenario.load import load_text
from podusv_cli.scenario.resolved import resolved_yaml

SHORT = NONLINEAR.model_copy(update={"length": 1e-3, "beam": 1e-3})
MOTION = tuple(signal.name for signal in WAVE_MOTION)
VELOCITY, ZETA = (6, 7, 8), 9  # of what a kernel writes
SOUTHWARD = math.pi  # waves that come from the south go north


def asked(sea, vessel=NONLINEAR, kernel=None):
    """A function of t and x that evaluates the kernel."""
    k, table = bundle(sea.constants_with(vessel)), sea.table_for(vessel, 300.0)
    kernel = kernel or sea.kernel_with(vessel)

    def at(t, x):
        b = np.full(10, np.nan)
        kernel(t, np.array(x, float), k, table, b)
        return b

    return at


def one(**given):
    """A regular wave, or nearly so: one component in a narrow band about the peak."""
    chosen = {"components": 1, "lowest": 0.98, "highest": 1.02, "gamma": 7.0}
    return Waves(**{"height": 3.0, "period": 2.0} | chosen | given)


def rows(sea, vessel=NONLINEAR):
    """Rates and phases in turns, wave numbers, amplitudes, directions, reflected shares."""
    return sea.table_for(vessel, 300.0).reshape(8, -1)


def component(sea):
    """Rate [rad/s], wave number [1/m] and amplitude [m] of the first one."""
    turns, _, number, a, *_ = rows(sea)[:, 0]
    return 2.0 * math.pi * turns, number, a


def by_hand(sea, vessel, t, x):
    """Elevation and first-order motion by the formulas of the docstring, in complex numbers."""
    turns, phase, number, a, c, s, *shares = rows(sea, vessel)
    beta, psi = np.arctan2(s, c), x[2]
    way = x[0] * np.cos(beta) + x[1] * np.sin(beta)
    z = a * np.exp(1j * (2 * math.pi * (turns * t + phase) - number * way))
    along, across = np.cos(beta - psi), np.sin(beta - psi)
    q = ((vessel.length * along) ** 2 + (vessel.beam * across) ** 2) * number**2 / 24.0
    felt = z / (1.0 + q / 2.0) ** 2
    motion = [np.sum(felt.imag * np.cos(beta)), np.sum(felt.imag * np.sin(beta))]
    turned = -np.sum(felt.real * number * along * across)
    squares = [
        abs(np.sum(z * R * np.maximum(w, 0.0))) ** 2 - abs(np.sum(z * R * np.maximum(-w, 0.0))) ** 2
        for w, R in zip((along, across), shares, strict=True)
    ]
    push = 0.5 * WATER * GRAVITY * np.array([vessel.beam, vessel.length])
    return np.array([*(push * squares), 0.0, *motion, turned, np.sum(z.real)])


@pytest.mark.parametrize("spreading", [0, 2])
def test_the_kernels_add_up_what_the_docstring_says(spreading):
    sea = Waves(height=0.3, period=1.8, direction=0.8, components=21, spreading=spreading)
    at, random = asked(sea), np.random.default_rng(3)
    for _ in range(5):
        t, x = random.uniform(0, 300), random.normal(0, 3, 6)
        found = np.delete(at(t, x), VELOCITY)
        np.testing.assert_allclose(found, by_hand(sea, NONLINEAR, t, x), rtol=1e-6, atol=1e-7)


def test_both_kernels_agree_on_waves_of_one_direction():
    sea = Waves(height=0.3, period=1.8, direction=0.8, components=10)
    long, short = asked(sea), asked(sea, kernel=short_crested)
    for t in (0.0, 17.3):
        x = (3.0, -4.0, 0.4, 0.5, 0.1, 0.2)
        np.testing.assert_allclose(long(t, x), short(t, x), rtol=1e-9, atol=1e-12)


def test_the_table_has_the_waves_of_the_spectrum():
    sea = Waves(
        height=0.8,
        period=4.0,
        period_is="zero_crossing",
        spectrum="ittc",
        amplitudes="deterministic",
    )
    turns, _, number, a, c, s = rows(sea)[:6, :100]
    rate = 2.0 * math.pi * turns
    assert 4.0 * math.sqrt(np.sum(a**2) / 2.0) == pytest.approx(0.8, rel=5e-3)
    m0, m2 = np.sum(a**2), np.sum(a**2 * rate**2)
    assert 2.0 * math.pi * math.sqrt(m0 / m2) == pytest.approx(4.0, rel=3e-3)  # 4.187 by all waves
    np.testing.assert_allclose(number, rate**2 / GRAVITY, rtol=1e-14)
    np.testing.assert_allclose([c, s], np.tile([[-1.0], [0.0]], 100), atol=1e-15)  # from the north


TURN, PEAK, SECONDS = 2.0 * math.pi, 2.0 * math.pi / 1.5, 310.0


def heights(components, amplitudes):
    """The significant heights of 310 s of a sea of 1 m, for 60 seeds."""
    times, found = np.arange(0.0, SECONDS, 0.25), []
    for seed in range(60):
        sea = Waves(height=1.0, period=1.5, components=components, amplitudes=amplitudes, seed=seed)
        turns, phase, _, a, *_ = rows(sea)
        found.append(4.0 * (np.cos(TURN * (np.outer(times, turns) + phase)) @ a).std())
    return np.array(found)


@pytest.mark.long
def test_heights_of_random_amplitudes_scatter_as_those_of_a_gaussian_sea():
    """Of a Gaussian process var(m0)/m0^2 = 2 pi (integral of S^2)/(T m0^2); Hs has half of it.

    With 372 components, twice what `resolving` says, 6 % more come out, with 100 39 %.
    """
    rates = np.linspace(0.5, 4.0, 20_001) * PEAK
    density = spectra.jonswap(rates, 1.0, PEAK, 3.3)
    square, m0 = np.trapezoid(density**2, rates), np.trapezoid(density, rates)
    theory = 0.5 * math.sqrt(TURN * square / (SECONDS * m0**2))
    assert theory == pytest.approx(0.043, abs=2e-4)
    many = heights(372, "random")
    assert many.std() == pytest.approx(1.06 * theory, rel=0.28)  # three deviations of 60 draws
    assert many.mean() == pytest.approx(1.0, abs=0.02)
    assert heights(100, "deterministic").std() < 0.75 * theory
    few = heights(100, "random").std()
    assert 1.1 * theory < few < 1.75 * theory, "bins of one width give 2.5 times as much"


def test_components_that_are_asked_for_are_0_9_for_every_period_of_the_peak():
    """Where the bins, weighted by the square of their energy, are 1/duration wide."""
    sea = Waves(height=1.0, period=1.5)
    rate = np.linspace(0.5 * PEAK, 4.0 * PEAK, 200_001)
    density = spectra.jonswap(rate, 1.0, PEAK, 3.3)
    energy = np.interp(sea._edges(), rate, cumulative_trapezoid(density, rate, initial=0.0))
    width = np.sum(np.diff(energy) ** 2) / np.trapezoid(density**2, rate) / TURN
    assert sea.resolving(SECONDS) == pytest.approx(100 * SECONDS * width, rel=0.01)
    assert sea.resolving(SECONDS) / (SECONDS / 1.5) == pytest.approx(0.9, abs=0.01)
    assert sea.model_copy(update={"components": 999}).resolving(SECONDS) == pytest.approx(
        186, abs=1
    )
    assert sea.model_copy(update={"amplitudes": "deterministic"}).resolving(SECONDS) == 0
    assert one().resolving(SECONDS) == 0, "a regular wave"


def test_the_components_of_a_run_are_by_default_twice_those_that_it_needs_or_more():
    """100, doubled: 400 for 310 s of 1.5 s, which need 186; a given number stays."""
    text = (
        "name: sea\nvessel: {{preset: paper_nonlinear}}\npath: {{kind: line}}\n"
        "actuator: {{kind: saturated}}\ncontroller: {{kind: pid}}\n"
        "disturbance: {sea}\nsimulation: {{duration: {duration}}}\n"
    )

    def counts(sea, duration):
        loaded = load_text(text.format(sea=sea, duration=duration), "sea.yaml")
        again = load_text(resolved_yaml(loaded.scenario), "again.yaml").scenario
        assert again == loaded.scenario
        return [part.cosines() for part in again.disturbances().values()]

    one = "{kind: waves, height: 0.1, period: 1.5}"
    assert counts(one, 310.0) == [400]
    assert counts(one, 10.0) == [100]
    assert counts(one.replace("1.5", "0.3"), 310.0) == [3200]
    given = one.replace("1.5}", "1.5, components: 7, seed: 2}")
    assert counts(f"[{one}, {given}]", 310.0) == [400, 7]


@pytest.mark.parametrize("kind", [{}, {"spectrum": "ittc", "period_is": "zero_crossing"}])
def test_a_regular_wave_has_exactly_the_period_that_is_asked_for(kind):
    """The rate was drawn between the cut-offs: 2.7 s where 4 s were asked for."""
    sea = Waves(height=0.5, period=4.0, components=1, amplitudes="deterministic", **kind)
    rate, _, a = component(sea)
    assert rate == pytest.approx(sea.peak, rel=1e-15)
    assert 4.0 * a / math.sqrt(2.0) == pytest.approx(0.5, rel=0.02)
    if not kind:
        assert rate == pytest.approx(TURN / 4.0, rel=1e-15)


@pytest.mark.parametrize(("psi", "u"), [(0.0, 1.5), (math.pi, 1.5), (math.pi / 3, 2.0)])
def test_a_vessel_under_way_meets_the_waves_at_the_encounter_frequency(psi, u):
    """rate - rate^2/g U cos(angle between course and travel), by zero crossings of 30 waves."""
    sea = one(direction=SOUTHWARD)
    rate, _, _ = component(sea)
    met = abs(rate - rate**2 / GRAVITY * u * math.cos(psi))
    at, t = asked(sea), np.linspace(0.0, 60.0 * math.pi / met, 600)
    here = [(u * math.cos(psi) * s, u * math.sin(psi) * s, psi, u, 0, 0) for s in t]
    zeta = np.array([at(s, x)[ZETA] for s, x in zip(t, here, strict=True)])
    up = np.flatnonzero((zeta[:-1] < 0) & (zeta[1:] >= 0))
    crossings = t[up] - zeta[up] * (t[up + 1] - t[up]) / (zeta[up + 1] - zeta[up])
    assert 2.0 * math.pi / np.diff(crossings).mean() == pytest.approx(met, rel=1e-4)


def test_a_short_hull_goes_round_with_the_water():
    """Under a crest water moves on in the wave's direction, in a trough back, as far as high."""
    sea = one(direction=SOUTHWARD)
    rate, _, a = component(sea)
    at, h = asked(sea, SHORT), 1e-3
    for t in np.linspace(0.0, 2.0, 9):
        x = (2.0, 5.0, 0.3, 0, 0, 0)
        velocity = (at(t + h, x)[3:5] - at(t - h, x)[3:5]) / (2 * h)
        here = at(t, x)
        np.testing.assert_allclose(velocity, [rate * here[ZETA], 0.0], atol=1e-4 * a * rate)
        assert here[3] ** 2 + here[ZETA] ** 2 == pytest.approx(a * a, rel=1e-6)


def test_yaw_is_the_slope_of_the_sway_along_the_hull():
    sea = one(direction=0.4)
    at, h = asked(sea, SHORT), 1e-4
    for psi in (0.0, 1.0, -2.0):
        ahead, aside = np.array([math.cos(psi), math.sin(psi)]), [-math.sin(psi), math.cos(psi)]
        bow, stern = (at(1.3, (*(s * ahead), psi, 0, 0, 0))[3:5] @ np.array(aside) for s in (h, -h))
        assert at(1.3, (0, 0, psi, 0, 0, 0))[5] == pytest.approx((bow - stern) / (2 * h), rel=1e-4)


def test_a_long_hull_hardly_feels_short_waves():
    sea = one(direction=SOUTHWARD, period=0.4, height=0.1)  # a quarter of a metre long
    _, number, a = component(sea)
    assert number * NONLINEAR.length > 25.0
    at = asked(sea)
    assert max(abs(at(t, np.zeros(6))[3]) for t in np.linspace(0, 0.4, 9)) < 0.01 * a
    long = one(direction=SOUTHWARD, period=5.0)
    slow, size = asked(long), component(long)[2]
    assert max(slow(t, np.zeros(6))[3] for t in np.linspace(0, 5, 50)) == pytest.approx(
        size, rel=0.01
    )


def test_regular_waves_push_with_a_constant_force():
    """Half of rho g a^2, times the reflected share squared, times the width that they meet."""
    sea = one(direction=0.0, reflection_u=0.6, reflection_v=0.5, drift_arm=0.2)
    at, square = asked(sea), component(sea)[2] ** 2
    X = 0.5 * WATER * GRAVITY * 0.36 * NONLINEAR.beam * square
    Y = 0.5 * WATER * GRAVITY * 0.25 * NONLINEAR.length * square
    for t in (0.0, 0.7, 33.0):
        np.testing.assert_allclose(at(t, np.zeros(6))[:3], [-X, 0, 0], rtol=1e-8, atol=1e-9)
        from_port = at(t, (1, 2, math.pi / 2, 0, 0, 0))[:3]
        np.testing.assert_allclose(from_port, [0, Y, 0.2 * Y], rtol=1e-8, atol=1e-9)
        astern = at(t, (1, 2, math.pi, 0, 0, 0))[:3]
        np.testing.assert_allclose(astern, [X, 0, 0], rtol=1e-8, atol=1e-9)


# Mean drift force over the squared amplitude [N/m2], at wave length over hull length: head and beam
# sea, by VERES. C/S Arctic Drillship from MCSimPython 0.1.6, vessel_data/CSAD/vessel_json.json.
STRIP_THEORY = {
    8.0: (0.64, 0.76),
    5.0: (2.9, 3.2),
    4.0: (6.7, 6.8),
    3.0: (22, 19),
    2.0: (142, 90),
    1.5: (468, 281),
    1.0: (1579, 1769),
    0.7: (2322, 6057),
}
# R/V Gunnerus from vessel_data/gunnerus/vessel.json.
AT_SEA = {
    8.395: (12.21, 48.05),
    5.078: (88.07, 321.1),
    2.948: (838.8, 2314.3),
    1.946: (4761.7, 9479.3),
    1.151: (27605, 48474),
    0.737: (29566, 118305),
}
SHIPS = {(2.578, 0.444): STRIP_THEORY, (33.9, 9.6): AT_SEA}


@pytest.mark.parametrize("size", SHIPS)
def test_regular_waves_push_ships_as_strip_theory_has_it(size):
    """Within the factor by which the two ships of the curve differ from their mean, 1.5."""
    hull = NONLINEAR.model_copy(update=dict(zip(("length", "beam"), size, strict=True)))
    for ratio, forces in SHIPS[size].items():
        period = math.sqrt(TURN * ratio * hull.length / GRAVITY)
        sea = one(direction=0.0, period=period, height=0.01, lowest=0.99, highest=1.01)
        at, square = asked(sea, hull), component(sea)[2] ** 2
        pushed = -at(0.0, np.zeros(6))[0], at(0.0, (0, 0, math.pi / 2, 0, 0, 0))[1]
        np.testing.assert_allclose(np.log(np.divide(pushed, square) / forces), 0.0, atol=0.4)


@pytest.mark.parametrize("curve", [BOW_AND_STERN, SIDES])
def test_the_curve_goes_through_its_points_and_on_beyond_them(curve):
    np.testing.assert_allclose(
        interpolate_shares(curve, np.array(curve.size)), curve.share, rtol=1e-12
    )
    low, high = curve.size[0], curve.size[-1]
    assert interpolate_shares(curve, np.array([10.0 * high]))[0] == pytest.approx(curve.share[-1])
    steep = math.log(curve.share[1] / curve.share[0]) / math.log(curve.size[1] / low)
    below = interpolate_shares(curve, np.array([0.1 * low]))[0]
    assert below == pytest.approx(curve.share[0] * 0.1**steep, rel=1e-9)


def test_irregular_waves_push_on_average_with_twice_the_variance():
    sea = Waves(height=0.4, period=2.0, components=16, reflection_u=0.5)
    at = asked(sea)
    pushed = [at(t, np.zeros(6))[0] for t in np.arange(0.0, 900.0, 0.7)]
    c_u = 0.5 * WATER * GRAVITY * 0.25 * NONLINEAR.beam
    m0 = np.sum(rows(sea)[3] ** 2) / 2.0
    assert np.mean(pushed) == pytest.approx(-2.0 * m0 * c_u, rel=0.05)
    assert max(pushed) <= 0.0
    assert np.std(pushed) == pytest.approx(2.0 * m0 * c_u, rel=0.25)  # of an exponential law


def test_the_two_sides_of_a_hull_are_alike():
    sea = Waves(height=0.4, period=2.0, components=9)
    at = asked(sea)
    for psi in (0.3, 1.2, 2.7):
        one_side, other = (at(5.0, (1, 0, sign * psi, 0, 0, 0)) for sign in (1, -1))
        mirrored = one_side * [1, -1, -1, 1, 1, -1, 1, -1, -1, 1]
        np.testing.assert_allclose(other, mirrored, rtol=1e-9, atol=1e-12)


def test_a_factor_on_the_motion_leaves_sea_and_load():
    given = {"height": 0.4, "period": 2.0, "components": 9, "direction": 0.5}
    full, half = (asked(Waves(motion=f, **given))(3.0, np.ones(6)) for f in (1.0, 0.5))
    half, full = (np.delete(b, VELOCITY[:2]) for b in (half, full))  # of axes that yaw with it
    np.testing.assert_allclose(half, full * [1, 1, 1, 0.5, 0.5, 0.5, 0.5, 1], rtol=1e-12)


SEA = Total(
    parts=(
        Waves(height=0.05, period=1.0, components=20, direction=0.7),
        Wind(speed=3.0, at=1.0, gusts="norsok", components=10, direction=0.7),
    )
)


@pytest.mark.parametrize("spreading", [0, 1])
def test_machine_code_computes_what_plain_python_does(spreading):
    first = SEA.parts[0].model_copy(update={"spreading": spreading})
    loop = adrift(disturbance=Total(parts=(first, SEA.parts[1])), controller=Constant(surge=2.0))
    fast, slow = (run(loop, 0.3, compiled=compiled) for compiled in (True, False))
    for name in ("b_u", "b_v", "b_r", *MOTION, "zeta", "V_w", "beta_w", "x", "psi"):
        np.testing.assert_array_equal(fast[name], slow[name])


def test_halving_the_step_changes_the_integration_error_only():
    loop = adrift(disturbance=SEA, controller=Constant(surge=2.0, yaw=0.3))
    ends = []
    for step in (0.02, 0.01, 0.005):
        last = run(loop, 6.0, step)  # at 6.7 s the wind is dead ahead: a corner of |gamma|
        ends.append(np.array([last[name][-1] for name in ("x", "y", "psi")]))
    order = math.log2(np.abs(ends[0] - ends[1]).max() / np.abs(ends[1] - ends[2]).max())
    assert 3.8 < order < 4.3


def sensed(at, t, x):
    """The pose that sensors see, without errors."""
    return x[:3] + at(t, x)[3:6]


@pytest.mark.parametrize("spreading", [0, 2])
def test_sensors_of_velocity_see_the_rate_of_what_sensors_of_pose_see(spreading):
    """By differences along the motion, in the axes of the hull that yaws with the waves."""
    sea = Waves(height=0.3, period=1.8, direction=0.8, components=21, spreading=spreading)
    at, random, h = asked(sea), np.random.default_rng(5), 1e-3
    for _ in range(5):
        t, x = random.uniform(0, 300), random.normal(0, 1, 6)
        c, s = math.cos(x[2]), math.sin(x[2])
        moving = np.array([c * x[3] - s * x[4], s * x[3] + c * x[4], x[5], 0, 0, 0])
        ends = [sensed(at, t + e, x + e * moving) for e in (h, -h)]
        north, east, r = (ends[0] - ends[1]) / (2 * h)
        heading = sensed(at, t, x)[2]
        c, s = math.cos(heading), math.sin(heading)
        expected = [c * north + s * east, c * east - s * north, r]
        np.testing.assert_allclose(x[3:] + at(t, x)[6:9], expected, atol=2e-5)


def test_a_longer_run_begins_with_the_same_waves():
    sea = SEA.parts[0]
    np.testing.assert_array_equal(sea.table_for(SHORT, 1.0), sea.table_for(SHORT, 1e5))


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ("height: 0, period: 2", "disturbance.height"),
        ("height: 1, period: 0", "disturbance.period"),
        ("height: 1, period: 2, components: 0", "disturbance.components"),
        ("height: 1, period: 2, seed: -1", "disturbance.seed"),
        ("height: 1, period: 2, lowest: 3, highest: 2", "lowest 3 must be below highest 2"),
        ("height: 1, period: 2, lowest: 0.01, highest: 0.2", "has 0.0 % of its energy"),
        ("height: 2, period: 5, spectrum: torsethaugen", "87 % of its energy; take lowest 0.29"),
        (
            "height: 6, period: 20, spectrum: torsethaugen, highest: 2",
            "67 % of its energy; take highest 5",
        ),
        ("height: 60, period: 30, spectrum: torsethaugen", "holds up to 20 m and below 25 s"),
        (
            "height: 2, period: 5, spectrum: torsethaugen, lowest: 0.3, period_is: mean",
            "must be peak",
        ),
        ("height: 1, period: 0.05", "waves up to 502.7 rad/s (4 times the peak's 125.7) are too"),
    ],
)
def test_what_cannot_be_is_told_in_a_sentence(given, says):
    lines = told(SOUND.replace("{kind: none}", f"{{kind: waves, {given}}}"))
    assert len([line for line in lines if says in line]) == 1
