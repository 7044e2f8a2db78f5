"""A learned law: a neural network from what the vessel sees of its target to a demand.

Source: none; layers as torch's Sequential has them, weights from any program that learns. podusv's
own are from examples/learned, an evolution strategy.

Proved: nothing. Not proved: that it comes to its target, within its limits or at all, on any hull,
and least of all where it has not learned. Anti-windup: it has no memory that could wind up.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, ClassVar, Literal, Self

from pydantic import field_validator, model_validator

from podusv_cli.components.controllers.base import Controller
from podusv_cli.components.controllers.policy_weights import PolicyNetwork, network
from podusv_cli.core.component import value
from podusv_cli.core.elementary import arctangent, cos_sin, hyperbolic_tangent
from podusv_cli.core.kernel import Vector, kernel, tail

# What a policy is given, in the vessel's own frame: x ahead, y to starboard
OBSERVED = (
    "target ahead [m]",
    "target to starboard [m]",
    "u [m/s]",
    "v [m/s]",
    "r [rad/s]",
    "target's velocity ahead [m/s]",
    "target's velocity to starboard [m/s]",
    "heading error [rad]",
)
INPUTS, OUTPUTS = len(OBSERVED), 2
RELU, CLIP = 1.0, 1.0  # the places of "relu" and "clip" among the choices, as kernels know them


# x (6) state, target (6); writes signals (8).
@kernel
def observe(x: Vector, target: Vector, signals: Vector) -> None:
    """Write what a policy is given of a state and a target into `signals`, as `OBSERVED`.

    The heading error is that of (19): the direction of the target less the heading, in [-pi, pi].
    """
    cosine, sine = cos_sin(x[2])
    north, east = target[0] - x[0], target[1] - x[1]
    ahead, aside = cosine * north + sine * east, cosine * east - sine * north
    signals[0], signals[1], signals[7] = ahead, aside, arctangent(aside, ahead)
    signals[2], signals[3], signals[4] = x[3], x[4], x[5]
    signals[5] = cosine * target[2] + sine * target[3]
    signals[6] = cosine * target[3] - sine * target[2]


# given (inputs), out (outputs); returns the part of `weights` with the next layer.
@kernel
def layer(inputs: int, outputs: int, given: Vector, weights: Vector, out: Vector) -> Vector:
    """Write W given + b, of `weights` with b first and then W column by column; what is behind."""
    for i in range(outputs):
        out[i] = weights[i]
    for j in range(inputs):
        column = tail(weights, outputs * (j + 1))
        for i in range(outputs):
            out[i] += column[i] * given[j]
    return tail(weights, outputs * (inputs + 1))


@lru_cache(maxsize=4)  # the same weights are read a dozen times in a run
def _network(content: str) -> PolicyNetwork:
    """The network in a law's `content`, the base64 of a file. Raises ValueError for none."""
    return network(content, INPUTS, OUTPUTS, OBSERVED)


class Policy(Controller):
    """A learned law: layers of a neural network, their weights from a safetensors file.

    tau = (surge, yaw) s(W_n h_n + b_n), h_1 = (o - mean)/scale, h_(i+1) = a(W_i h_i + b_i), where o
    is what the vessel sees (`OBSERVED`), a the `activation` and s the `squash` into [-1, 1]. The
    file's tensors have the names that torch's Sequential gives its layers: 0.weight (out, in),
    0.bias, 2.weight, ...; `mean` and `scale` of the observation may be left out. A remark
    `control.period` of the file says for how long a demand held in training.

    It has no memory, so a constant load leaves an error.
    """

    kind: Literal["policy"] = "policy"
    bytes_of: ClassVar[dict[str, str]] = {"weights": "content"}
    no_gains: ClassVar[tuple[str, ...]] = ("surge", "yaw")
    weights: str | None = value(
        None, "", "safetensors file beside the scenario; it is read into `content`"
    )
    content: str | None = value(None, "", "the bytes of such a file, as base64")
    activation: Literal["tanh", "relu"] = value("tanh", "", "what hidden layers end with")
    squash: Literal["tanh", "clip"] = value(
        "tanh", "", "how outputs get into [-1, 1]: tanh, or cut off"
    )
    surge: float = value(8.0, "N", "surge force at an output of 1", gt=0)
    yaw: float = value(2.5, "N m", "yaw moment at an output of 1", gt=0)

    @field_validator("content")
    @classmethod
    def _readable(cls, content: str | None) -> str | None:
        """The content as it is. Raises ValueError for a file that holds no network."""
        if content is not None:
            _network(content)
        return content

    @model_validator(mode="after")
    def _check_weights(self) -> Self:
        """Raises ValueError where no file is named."""
        if self.content is None:
            raise ValueError(
                "weights is missing; name a safetensors file, as in weights: policy.safetensors"
            )
        return self

    def network(self) -> PolicyNetwork:
        """The network's weights and sizes, as the kernel takes them."""
        assert self.content is not None  # else there is no such law
        return _network(self.content)

    def constants(self) -> dict[str, float]:
        """The fields' numbers, how many hidden layers there are, and the width of the widest."""
        layers = self.network()
        return super().constants() | {"hidden": float(layers.hidden), "width": float(layers.width)}

    def table(self) -> Vector:
        """Mean and scale of the observation, then layer by layer as `layer` takes them."""
        return self.network().table

    def workspace(self) -> int:
        """How many numbers of scratch the law needs: those before and after a layer."""
        return 2 * max(INPUTS, self.network().width)

    # x (6), target (6), table as `table` lays it out, work as `workspace`; writes tau (2) [N, N m].
    # A hidden layer's numbers replace its inputs, so two rooms will do for any number of layers.
    @staticmethod
    @kernel
    def law(x: Vector, target: Vector, k: Any, table: Vector, tau: Vector, work: Vector) -> None:
        """The network's outputs, squashed, times (surge, yaw)."""
        hidden, width, inputs = int(k.hidden), int(k.width), INPUTS
        given, out = work, tail(work, max(inputs, width))
        observe(x, target, given)
        for i in range(inputs):
            given[i] = (given[i] - table[i]) / table[INPUTS + i]
        weights = tail(table, 2 * INPUTS)
        for _ in range(hidden):
            weights = layer(inputs, width, given, weights, out)
            for i in range(width):
                rectified = max(out[i], 0.0)
                given[i] = rectified if k.activation == RELU else hyperbolic_tangent(out[i])
            inputs = width
        layer(inputs, OUTPUTS, given, weights, out)
        for i in range(OUTPUTS):
            cut = min(max(out[i], -1.0), 1.0)
            tau[i] = cut if k.squash == CLIP else hyperbolic_tangent(out[i])
        tau[0] *= k.surge
        tau[1] *= k.yaw
