"""The plane of a scenario's origin, beside Vincenty's way along the ellipsoid."""

import math

import numpy as np
import pytest

from podusv_cli.core.earth import Plane, error_at

A, F = 6378137.0, 1.0 / 298.257223563


def vincenty(lat, lon, azimuth, distance):
    """The place [deg] so far from another along the ellipsoid, by T. Vincenty (1975)."""
    b = A * (1.0 - F)
    reduced = math.atan((1.0 - F) * math.tan(math.radians(lat)))
    sigma1 = math.atan2(math.tan(reduced), math.cos(azimuth))
    sin_alpha = math.cos(reduced) * math.sin(azimuth)
    cos2 = 1.0 - sin_alpha**2
    u2 = cos2 * (A * A - b * b) / (b * b)
    big_a = 1 + u2 / 16384 * (4096 + u2 * (-768 + u2 * (320 - 175 * u2)))
    big_b = u2 / 1024 * (256 + u2 * (-128 + u2 * (74 - 47 * u2)))
    sigma = distance / (b * big_a)
    for _ in range(50):
        m = math.cos(2 * sigma1 + sigma)
        inner = math.cos(sigma) * (-1 + 2 * m * m)
        outer = big_b / 6 * m * (-3 + 4 * math.sin(sigma) ** 2) * (-3 + 4 * m * m)
        step = big_b * math.sin(sigma) * (m + big_b / 4 * (inner - outer))
        sigma = distance / (b * big_a) + step
    m, su, cu = math.cos(2 * sigma1 + sigma), math.sin(reduced), math.cos(reduced)
    ss, cs, ca = math.sin(sigma), math.cos(sigma), math.cos(azimuth)
    phi = math.atan2(
        su * cs + cu * ss * ca, (1 - F) * math.hypot(sin_alpha, su * ss - cu * cs * ca)
    )
    away = math.atan2(ss * math.sin(azimuth), cu * cs - su * ss * ca)
    c = F / 16 * cos2 * (4 + F * (4 - 3 * cos2))
    away -= (1 - c) * F * sin_alpha * (sigma + c * ss * (m + c * cs * (-1 + 2 * m * m)))
    return math.degrees(phi), lon + math.degrees(away)


@pytest.mark.parametrize("lat", [-77.0, -33.4, 0.0, 12.3, 59.9, 84.0])
@pytest.mark.parametrize("azimuth", [0.0, 0.4, 1.7, 2.9, 4.4, 5.9])
@pytest.mark.parametrize("distance", [5e3, 50e3])
def test_north_and_east_are_those_along_the_ellipsoid(lat, azimuth, distance):
    """At 5 km within 1 cm, and everywhere by what `error_at` says; also over the date line."""
    plane = Plane(lat, 179.99)
    there = [np.array([part]) for part in vincenty(lat, 179.99, azimuth, distance)]
    north, east = plane.north_east(*there)
    off = math.hypot(
        north[0] - distance * math.cos(azimuth), east[0] - distance * math.sin(azimuth)
    )
    assert off == pytest.approx(error_at(distance), rel=0.02)
    assert distance > 5e3 or off < 0.01


def test_places_are_where_the_points_come_from():
    rng = np.random.default_rng(7)
    plane = Plane(-41.2, -179.9)
    north, east = rng.uniform(-2e5, 2e5, (2, 500))
    lat, lon = plane.places(north, east)
    back = plane.north_east(lat, lon)
    assert np.abs(np.subtract(back, (north, east))).max() < 1e-8
    assert np.abs(lon).max() <= 180.0


def test_a_degree_is_as_long_as_tables_have_it():
    """At 45 deg: 111 131.8 m along the meridian, 78 846.8 m across it (WGS 84)."""
    plane, small = Plane(45.0, 7.0), np.array([1e-4])
    assert plane.north_east(45.0 + small, 7.0 + 0.0 * small)[0] / small == pytest.approx(
        111_131.8, abs=0.3
    )
    assert plane.north_east(45.0 + 0.0 * small, 7.0 + small)[1] / small == pytest.approx(
        78_846.8, abs=0.3
    )


def test_beyond_the_rim_of_the_earth_is_no_place():
    assert np.isnan(Plane(10.0, 10.0).places(np.array([7e6]), np.array([0.0]))[0])
