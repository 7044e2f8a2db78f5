"""The radial basis network: (13)-(15), and its adaptation (27), (36)."""

from typing import Any

import numpy as np
import pytest
from conftest import NONLINEAR
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from podusv_cli.components.controllers.adaptive_neural import AdaptiveNeural
from podusv_cli.components.controllers.network import Network, activate, activation, adapt, weigh
from podusv_cli.core.kernel import Vector, bundle

LISTED = ((0.0, 0.0, 0.0), (1.0, -0.5, 0.2), (2.0, 0.5, -0.7), (-1.0, 0.1, 0.9))
WIDTHS = (0.9, 0.4, 0.6)
NETWORKS = {
    "default": Network(),
    "uneven grid": Network(nodes=(5, 2, 4), low=(-0.5, -0.2, -1.0), high=(2.0, 0.3, 3.0)),
    "one node an axis": Network(nodes=(3, 1, 2), widths=WIDTHS),
    "listed": Network(centers=LISTED, widths=WIDTHS),
    "one node": Network(centers=LISTED[1:2], widths=WIDTHS),
}
every_network = pytest.mark.parametrize("network", NETWORKS.values(), ids=NETWORKS.keys())
velocities = st.tuples(*[st.floats(-4, 4)] * 3).map(np.array)


def outputs(network: Network, nu: Any) -> Vector:
    """Phi by the law's own kernel."""
    law = AdaptiveNeural(network=network)
    phi, work = np.full(network.count, np.nan), np.full(law.workspace(), np.nan)
    activate(
        np.concatenate([np.zeros(3), nu]),
        bundle(law.constants_with(NONLINEAR)),
        law.table(),
        phi,
        work,
    )
    return phi


@every_network
@given(nu=velocities)
def test_nodes_are_the_gaussians_of_14(network, nu):
    c, sigma = network.center_array(), network.width_array()
    direct = np.array([np.exp(-sum((nu - c_i) ** 2 / (2 * sigma**2))) for c_i in c])
    np.testing.assert_allclose(outputs(network, nu), direct, rtol=1e-13, atol=1e-300)
    np.testing.assert_allclose(activation(network, nu[None])[0], direct, rtol=1e-13, atol=1e-300)


@every_network
@given(nu=velocities, seed=st.integers(0, 1000))
def test_the_output_is_the_sum_of_15(network, nu, seed):
    weights, phi = np.random.default_rng(seed).normal(size=network.count), outputs(network, nu)
    found, wanted = weigh(network.count, weights, -weights, phi), weights @ phi
    assert found == pytest.approx((wanted, -wanted), rel=1e-12, abs=1e-15)


@every_network
def test_a_node_is_one_at_its_centre_and_in_the_order_of_the_weights(network):
    for node, center in enumerate(network.center_array()):
        assert outputs(network, center)[node] == 1.0


def test_the_default_grid():
    network = Network()
    assert network.count == 27
    np.testing.assert_allclose(network.width_array(), [0.7 * 1.75, 0.7, 0.7])
    c = network.center_array()
    np.testing.assert_array_equal(np.unique(c[:, 0]), [-1.0, 0.75, 2.5])
    np.testing.assert_array_equal(c.min(axis=0), [-1, -1, -1])
    np.testing.assert_array_equal(c.max(axis=0), [2.5, 1, 1])
    # Symmetric in sway and yaw, or port and starboard would not be mirror images.
    assert {tuple(row) for row in c * [1, -1, -1]} == {tuple(row) for row in c}


def test_weights_follow_27():
    random = np.random.default_rng(2)
    weights, phi, rate = random.normal(size=9), random.uniform(size=9), np.full(9, np.nan)
    adapt(9, weights, phi, 0.8, 100.0, 0.1, 0.25, rate)
    np.testing.assert_allclose(rate, 100 * (0.8 * phi - 0.1 * (weights - 0.25)), rtol=1e-13)


@pytest.mark.parametrize(
    "fields",
    [
        {"nodes": (0, 3, 3)},
        {"nodes": (1, 3, 3)},
        {"centers": LISTED},
        {"widths": (1.0, 0.0, 1.0)},
        {"low": (3.0, -1.0, -1.0)},
        {"spread": 0.0},
    ],
)
def test_a_network_that_spans_nothing_is_refused(fields):
    with pytest.raises(ValidationError):
        Network(**fields)
