"""Wind: Blendermann's coefficients, the relative wind, the profile, gusts, and what is refused."""

import math

import numpy as np
import pytest
from conftest import NONLINEAR, VESSELS, load_at
from scenario_samples import SOUND, told
from scipy.integrate import quad

from podusv_cli.components.disturbances.wind import Wind, blendermann
from podusv_cli.components.vessels.windage import Windage
from podusv_cli.core.kernel import bundle, call

AIR = 1.225
HULL = Windage(
    A_F=2.0, A_L=5.0, s_L=0.3, CD_t=0.85, CD_l_bow=0.55, CD_l_stern=0.65, delta=0.6
)  # a research vessel's coefficients
LENGTH = 4.0
BLOWN = VESSELS["otter"].model_copy(update={"windage": HULL, "length": LENGTH})


def load(gamma, speed=10.0, hull=HULL):
    """The load of wind from gamma off the bow, positive from port."""
    b = np.full(3, np.nan)
    k = bundle(hull.constants() | {"density": AIR, "length": LENGTH})
    blendermann(speed * math.cos(gamma), -speed * math.sin(gamma), k, b)
    return b


def coefficients(gamma, hull=HULL):
    q = 0.5 * AIR * 100.0
    return load(gamma, 10.0, hull) / (q * np.array([hull.A_F, hull.A_L, hull.A_L * LENGTH]))


@pytest.mark.parametrize(
    ("gamma", "C_X", "C_Y"),
    [(0.0, -0.55, 0.0), (math.pi / 2, 0.0, 0.85), (math.pi, 0.65, 0.0), (-math.pi / 2, 0.0, -0.85)],
)
def test_ahead_abeam_and_astern_the_coefficients_are_the_drag_coefficients(gamma, C_X, C_Y):
    found = coefficients(gamma)
    np.testing.assert_allclose(found[:2], [C_X, C_Y], atol=1e-12)
    assert found[2] == pytest.approx(HULL.s_L / LENGTH * C_Y, abs=1e-12)


@pytest.mark.parametrize("degrees", [10, 30, 60, 120, 150])
def test_between_them_they_are_those_of_a_hand_computation(degrees):
    g = math.radians(degrees)
    CDl = (0.55 if degrees < 90 else 0.65) * 2.0 / 5.0
    den = 1.0 - 0.3 * (1.0 - CDl / 0.85) * math.sin(2.0 * g) ** 2
    C_Y = 0.85 * math.sin(g) / den
    C_N = (0.3 / 4.0 - 0.18 * (g - math.pi / 2)) * C_Y
    expected = [-CDl * 5.0 / 2.0 * math.cos(g) / den, C_Y, C_N]
    np.testing.assert_allclose(coefficients(g), expected, rtol=1e-12)


def test_the_two_sides_of_a_hull_are_alike():
    for g in np.linspace(0.05, math.pi - 0.05, 9):
        X, Y, N = load(g)
        np.testing.assert_allclose(load(-g), [X, -Y, -N], rtol=1e-12)


def test_no_wind_no_load_and_twice_the_wind_four_times_the_load():
    assert load(0.7, 0.0).tolist() == [0.0, 0.0, 0.0]
    np.testing.assert_allclose(load(0.7, 20.0), 4.0 * load(0.7, 10.0), rtol=1e-12)


def blown(sea, x, t=0.0, vessel=BLOWN):
    b = np.full(5, np.nan)
    k, table = bundle(sea.constants_with(vessel)), sea.table_for(vessel, 300.0)
    call(sea.evaluate, t=t, x=np.array(x), k=k, table=table, b=b, again=0.0, stage=0.0)
    return b


def test_wind_from_the_north_pushes_south():
    ahead = blown(Wind(speed=10.0), (0, 0, 0.0, 0, 0, 0))
    np.testing.assert_allclose(ahead[:3], [-0.5 * AIR * 100 * 0.55 * 2.0, 0, 0], atol=1e-12)
    assert ahead[3:].tolist() == [10.0, 0.0]
    eastward = blown(Wind(speed=10.0), (0, 0, math.pi / 2, 0, 0, 0))  # it comes from port
    assert eastward[1] == pytest.approx(0.5 * AIR * 100 * 0.85 * 5.0)
    from_starboard = blown(Wind(speed=10.0, direction=math.pi / 2), (0, 0, 0, 0, 0, 0))
    assert from_starboard[1] == pytest.approx(-0.5 * AIR * 100 * 0.85 * 5.0)


def test_only_the_motion_through_the_air_counts():
    """A vessel that goes with the wind feels none; one against it feels the sum of both speeds."""
    sea = Wind(speed=3.0, direction=math.pi)
    np.testing.assert_allclose(blown(sea, (5, 6, 0, 3.0, 0, 0.1))[:3], 0.0, atol=1e-12)
    against = blown(Wind(speed=3.0), (0, 0, 0, 2.0, 0, 0))[0]
    assert against == pytest.approx(-0.5 * AIR * 25.0 * 0.55 * 2.0)
    psi, u, v = 0.7, 1.1, -0.4
    through_air = np.array([u, v]) - 3.0 * np.array([-math.cos(psi), math.sin(psi)])
    g = -math.atan2(through_air[1], through_air[0])
    expected = load(g, float(np.hypot(*through_air)))
    np.testing.assert_allclose(
        blown(Wind(speed=3.0), (0, 0, psi, u, v, 0))[:3], expected, rtol=1e-9
    )


def test_the_profile_is_logarithmic():
    low = Wind(speed=10.0, at=1.0, drag=0.0026)
    z_0 = 10.0 * math.exp(-2.0 / (5.0 * math.sqrt(0.0026)))
    expected = 2.5 * math.sqrt(0.0026) * 10.0 * math.log(1.0 / z_0)
    assert low.mean == pytest.approx(expected, rel=1e-12)
    assert Wind(speed=10.0).mean == 10.0


def test_norsok_gusts_have_norsok_s_profile():
    """C = 0.0573 sqrt(1 + 0.15 U10), whatever the drag: 0.8632 of 8 m/s at 2 m."""
    low = Wind(speed=8.0, at=2.0, gusts="norsok", drag=0.01)
    assert low.mean / 8.0 == pytest.approx(0.8632144598, rel=1e-9)
    assert Wind(speed=8.0, at=2.0).mean / 8.0 == pytest.approx(0.7948361170, rel=1e-9)


@pytest.mark.parametrize("gusts", ["norsok", "harris"])
def test_gusts_have_the_variance_of_their_spectrum_and_no_mean(gusts):
    sea = Wind(speed=12.0, gusts=gusts, at=8.0, components=60, amplitudes="deterministic")
    rate, _, amplitude = sea.table().reshape(3, -1)
    energy = quad(lambda f: sea._density(np.array([f]))[0], sea.lowest, sea.highest, limit=200)[0]
    assert np.sum(amplitude**2) / 2.0 == pytest.approx(energy, rel=2e-3)
    assert np.all((rate[:60] > sea.lowest) & (rate[:60] < sea.highest))
    assert 0.05 < math.sqrt(energy) / sea.mean < 0.2, "no usual intensity of turbulence"


def test_the_kernel_adds_up_its_table():
    sea = Wind(speed=12.0, gusts="norsok", components=13)
    rate, phase, amplitude = sea.table().reshape(3, -1)
    for t in (0.0, 3.7, 1e5):
        speed = blown(sea, (0, 0, 0, 0, 0, 0), t)[3]
        turns = rate * t + phase
        expected = 12.0 + np.sum(amplitude * np.cos(2.0 * math.pi * (turns - np.round(turns))))
        assert speed == pytest.approx(expected, abs=1e-8)


def test_without_gusts_the_wind_is_steady():
    for t in (0.0, 100.0):
        assert blown(Wind(speed=5.0), (0, 0, 0, 0, 0, 0), t)[3] == 5.0


def test_a_vessel_without_windage_is_refused():
    bare = NONLINEAR.model_copy(update={"windage": None})
    ((key, text),) = Wind(speed=5.0).conflicts(bare, 0.01)
    assert key == "kind"
    assert "no windage" in text
    with pytest.raises(ValueError, match="no windage"):
        Wind(speed=5.0).constants_with(bare)
    windy = SOUND.replace("{kind: none}", "{kind: wind, speed: 5}")
    assert told(windy) == []
    (line,) = told(windy.replace("preset: paper", "preset: paper, windage: null"))
    assert "disturbance.kind: the vessel has no windage" in line


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ("speed: 0", "disturbance.speed"),
        ("speed: 5, components: 0", "disturbance.components"),
        ("speed: 5, seed: -1", "disturbance.seed"),
        ("speed: 5, gusts: norsok, lowest: 0.5, highest: 0.1", "lowest 0.5 Hz must be below"),
        ("speed: 5, at: 0.001", "has no wind left, which ends 0.00392 m above the sea"),
        (
            "speed: 5, gusts: harris, highest: 60",
            "gusts up to 60 Hz are too fast for steps of 0.01",
        ),
    ],
)
def test_what_cannot_be_is_told_in_a_sentence(given, says):
    lines = told(SOUND.replace("{kind: none}", f"{{kind: wind, {given}}}"))
    assert len([line for line in lines if says in line]) == 1


def test_every_shipped_vessel_says_where_its_windage_comes_from():
    for name, vessel in VESSELS.items():
        assert vessel.windage is not None, name
        assert "estimate" in vessel.windage.source
        assert 0.1 < vessel.windage.A_F / vessel.beam**2 < 1.5
        assert 0.05 < vessel.windage.A_L / vessel.length**2 < 0.3
        assert np.isfinite(load_at(Wind(speed=5.0), 1.0)).all()


def test_windage_is_no_constant_of_the_hull():
    assert not [name for name in NONLINEAR.constants() if "windage" in name]


def test_a_longer_run_begins_with_the_same_gusts():
    sea = Wind(speed=12.0, gusts="norsok")
    np.testing.assert_array_equal(sea.table_for(BLOWN, 10.0), sea.table_for(NONLINEAR, 1e4))
