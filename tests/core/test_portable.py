"""Functions and sums of arrays that depend on no processor and no library."""

import math

import numpy as np
import pytest

from podusv_cli.core import elementary, portable
from podusv_cli.theory.bounds import least_eigenvalue

RANDOM = np.random.default_rng(7)
ANGLES = np.concatenate(
    [RANDOM.uniform(-10.0, 10.0, 2000), RANDOM.uniform(-1e6, 1e6, 500), [0.0, -0.0, math.pi]]
)


def test_cosine_and_sine_have_the_bits_of_the_kernel():
    alone = np.array([elementary.cos_sin(angle) for angle in ANGLES.tolist()]).T
    assert np.array(portable.cosine_and_sine(ANGLES)).tobytes() == alone.tobytes()
    np.testing.assert_allclose(alone[0], np.cos(ANGLES), rtol=0.0, atol=3e-10)
    np.testing.assert_allclose(alone[0][:2000], np.cos(ANGLES[:2000]), rtol=0.0, atol=3e-16)
    assert np.isnan(portable.cosine_and_sine(np.array([np.inf, np.nan, 1e16]))).all()


def test_angles_of_vectors_have_the_bits_of_the_kernel():
    y, x = RANDOM.normal(size=(2, 3000))
    y[:3], x[1:4] = 0.0, 0.0
    alone = [elementary.arctangent(*vector) for vector in zip(y.tolist(), x.tolist(), strict=True)]
    assert portable.arctangents(y, x).tobytes() == np.array(alone).tobytes()
    np.testing.assert_allclose(alone, np.arctan2(y, x), rtol=1e-15)


def test_the_exponential_ends_where_numbers_do():
    x = np.array([-np.inf, -800.0, -745.0, -1.0, 0.0, 709.7, 800.0, np.inf])
    with np.errstate(over="ignore"):
        np.testing.assert_allclose(portable.exponential(x), np.exp(x), rtol=5e-16)


@pytest.mark.parametrize("count", [0, 1, 2, 3, 7, 8, 1001])
def test_a_total_is_the_sum_over_the_first_axis(count):
    terms = RANDOM.normal(size=(count, 3)) * 10.0 ** RANDOM.integers(-8, 8, size=(count, 3))
    exact = [math.fsum(column) for column in terms.T.tolist()]
    most = np.abs(terms).max(initial=0.0)
    np.testing.assert_allclose(portable.total(terms), exact, rtol=0.0, atol=1e-13 * most)


def test_terms_of_a_total_stay_as_they_are():
    terms = np.arange(5.0)
    assert (portable.total(terms), terms.tolist()) == (10.0, [0.0, 1.0, 2.0, 3.0, 4.0])


@pytest.mark.parametrize("size", [1, 2, 27, 60])
def test_an_equation_is_solved_as_lapack_does(size):
    rows = RANDOM.normal(size=(3 * size, size))
    matrix, right = rows.T @ rows + 0.1 * np.eye(size), RANDOM.normal(size=size)
    solved = portable.solve(matrix, right)
    np.testing.assert_allclose(matrix @ solved, right, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(solved, np.linalg.solve(matrix, right), rtol=1e-10, atol=1e-14)


@pytest.mark.parametrize("size", [1, 2, 3, 4])
def test_the_least_eigenvalue_is_that_of_lapack(size):
    for scales in 10.0 ** RANDOM.uniform(-3, 3, size=(50, size)):
        form = RANDOM.normal(size=(size, size)) * np.outer(scales, scales)
        form = form + form.T
        eigenvalues = np.linalg.eigvalsh(form)
        assert least_eigenvalue(form) == pytest.approx(
            eigenvalues[0], abs=1e-13 * np.abs(eigenvalues).max()
        )
    assert least_eigenvalue(np.diag([3.0, -1.0, 2.0])) == -1.0


def test_floats_are_added_one_by_one_on_every_python():
    """The `sum` of Python 3.12 and later carries what rounding took."""
    numbers = [1.0, 1e-16, 1e-16, 1e-16]
    assert portable.add_up(numbers) == 1.0 != math.fsum(numbers)
    assert portable.add_up([]) == 0.0
