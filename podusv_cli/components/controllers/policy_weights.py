"""The weights of a policy: a safetensors file, read and checked.

The format: eight bytes with the length of a header (little-endian), the header as JSON, then the
numbers of all tensors (https://huggingface.co/docs/safetensors). The header may have remarks, texts
by name; `PERIOD` is one of them.
"""

from __future__ import annotations

import base64
import binascii
import math
import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np
from pydantic import BaseModel, Field, NonNegativeInt, ValidationError

from podusv_cli.core.kernel import Vector
from podusv_cli.core.phrases import quote

PERIOD = "control.period"  # the remark for how long a demand held in training [s]
LENGTH = 8  # bytes of the header's length
KINDS: dict[str, np.dtype[Any]] = {"F32": np.dtype("<f4"), "F64": np.dtype("<f8")}
# As torch names what its Sequential holds
LAYER = re.compile(r"(?P<of>.+\.)?(?P<number>0|[1-9][0-9]{0,3})\.(weight|bias)")


class PolicyNetwork(NamedTuple):
    """Weights as a kernel takes them; narrower hidden layers are filled up with zeros.

    `period` is for how long a demand held in training [s], where the file says it.
    """

    hidden: int
    width: int
    table: Vector
    period: float | None


class Tensor(BaseModel):
    """What the header says of a tensor; the offsets are from its end [bytes]."""

    dtype: str
    shape: tuple[NonNegativeInt, ...]
    data_offsets: tuple[NonNegativeInt, NonNegativeInt]


class Header(BaseModel, extra="allow"):
    """A safetensors file's header: its tensors by name, and a user's remarks."""

    __pydantic_extra__: dict[str, Tensor] = Field(init=False)
    remarks: dict[str, str] = Field({}, alias="__metadata__")


def tensors(data: bytes) -> tuple[dict[str, Vector], dict[str, str]]:
    """The arrays of a safetensors file's bytes by name, each in its own shape, and its remarks.

    Raises ValueError.
    """
    begin = LENGTH + int.from_bytes(data[:LENGTH], "little")  # where the numbers begin [bytes]
    try:
        header = Header.model_validate_json(data[LENGTH:begin] if begin <= len(data) else b"")
    except ValidationError:
        raise ValueError(
            "is no safetensors file; write it with safetensors.numpy.save_file"
        ) from None
    numbers, entries = data[begin:], header.__pydantic_extra__
    arrays = {name: _numbers(name, tensor, numbers) for name, tensor in entries.items()}
    # The tensors have to fill the file from end to end: each begins where the one before ends
    pieces = sorted(tensor.data_offsets for tensor in entries.values())
    if [0, *(end for _, end in pieces)] != [*(first for first, _ in pieces), len(numbers)]:
        raise ValueError("its header does not fit its numbers; save it again")
    return arrays, header.remarks


def _numbers(name: str, tensor: Tensor, numbers: bytes) -> Vector:
    """The array of the tensor called `name`, in the tensor's shape, as float64.

    `numbers` is the file behind its header. Raises ValueError.
    """
    begin, end = tensor.data_offsets
    if tensor.dtype not in KINDS:
        raise ValueError(f"{name} has numbers {tensor.dtype}; save it as {' or '.join(KINDS)}")
    if not math.prod(tensor.shape):
        raise ValueError(f"{name} has shape {tensor.shape}, which has no numbers")
    kind = KINDS[tensor.dtype]
    if end > len(numbers) or end - begin != math.prod(tensor.shape) * kind.itemsize:
        raise ValueError(f"the file ends within {name}, or its header does not fit; save it again")
    array = np.frombuffer(numbers[begin:end], kind).astype(float).reshape(tensor.shape)
    if not np.isfinite(array).all():
        raise ValueError(f"{name} has a number that is not finite; train again, or save it again")
    return array


def network(content: str, inputs: int, outputs: int, names: tuple[str, ...]) -> PolicyNetwork:
    """The network in base64 of a safetensors file; `names` are those of its inputs.

    Raises ValueError for what is no network from so many inputs to so many outputs.
    """
    try:
        arrays, remarks = tensors(base64.b64decode("".join(content.split()), validate=True))
    except binascii.Error:
        raise ValueError("is no base64") from None
    given = _normal(arrays, inputs)
    layers = list(_layers(arrays))
    _check_shapes(layers, inputs, outputs, names)
    # All hidden layers get the width of the widest, so that one loop runs over them; zeros do
    # nothing
    width = max((len(bias) for _, _, bias in layers[:-1]), default=0)
    sizes = [inputs, *[width] * (len(layers) - 1), outputs]
    filled = [
        np.concatenate([_fill(bias, (after,)), _fill(weight, (after, before)).T.ravel()])
        for (_, weight, bias), before, after in zip(layers, sizes, sizes[1:], strict=False)
    ]
    table = np.concatenate([*given, *filled])
    return PolicyNetwork(len(layers) - 1, width, table, _period(remarks))


def _period(remarks: Mapping[str, str]) -> float | None:
    """The remark `PERIOD` as a number; None where there is none. Raises ValueError."""
    if PERIOD not in remarks:
        return None
    # A remark is text, which may be no number
    with suppress(ValueError):
        if 0.0 < (period := float(remarks[PERIOD])) < math.inf:
            return period
    raise ValueError(
        f"its remark {PERIOD} is {quote(remarks[PERIOD])}; write how long a demand held in "
        "training [s], as in '0.2'"
    )


def _normal(arrays: dict[str, Vector], inputs: int) -> tuple[Vector, Vector]:
    """Mean and scale of the inputs, both (inputs,), taken out of `arrays`; 0 and 1 without them.

    Raises ValueError for another shape, and a scale that is not above 0.
    """
    mean, scale = arrays.pop("mean", np.zeros(inputs)), arrays.pop("scale", np.ones(inputs))
    for name, vector in (("mean", mean), ("scale", scale)):
        if vector.shape != (inputs,):
            raise ValueError(f"{name} has shape {vector.shape}, must be {(inputs,)}")
    if not (scale > 0.0).all():
        raise ValueError("scale has a number that is not above 0; it divides the observation")
    return mean, scale


def _layers(arrays: Mapping[str, Vector]) -> Iterator[tuple[str, Vector, Vector]]:
    """Name, weight (outputs, inputs) and bias (outputs,) of every layer, in order.

    Names may all begin with the same word, as "actor.". Raises ValueError for other tensors.
    """
    named = {name: LAYER.fullmatch(name) for name in arrays}
    if strange := [name for name, match in named.items() if not match]:
        raise ValueError(
            f"{strange[0]!r} is no tensor of a policy; it has mean, scale, and of every layer "
            "0.weight and 0.bias, 2.weight and 2.bias, ..., numbered as in torch's Sequential"
        )
    places = {(match["of"] or "", int(match["number"])) for match in named.values() if match}
    if len(networks := sorted({of for of, _ in places})) != 1:
        found_in = " and ".join(map(repr, networks)) or "none"
        raise ValueError(f"must have the layers of one network, found {found_in}; save that alone")
    # In the order of their numbers: as text 10 would come before 2
    for of, number in sorted(places):
        name = f"{of}{number}"
        for part in (f"{name}.weight", f"{name}.bias"):
            if part not in arrays:
                raise ValueError(f"{part} is missing; every layer has a weight and a bias")
        yield name, arrays[f"{name}.weight"], arrays[f"{name}.bias"]


def _check_shapes(
    layers: list[tuple[str, Vector, Vector]], inputs: int, outputs: int, names: tuple[str, ...]
) -> None:
    """Raises ValueError unless each layer (name, weight, bias) takes what the one before gives.

    The first takes the `inputs`, which `names` has; the last gives the `outputs`.
    """
    before, who = inputs, f"the observation ({', '.join(names)})"
    for name, weight, bias in layers:
        if weight.ndim != 2 or weight.shape[1] != before:
            raise ValueError(
                f"{name}.weight has shape {weight.shape}, must be (any, {before}): {who} has "
                f"{before} numbers"
            )
        if bias.shape != weight.shape[:1]:
            raise ValueError(f"{name}.bias has shape {bias.shape}, must be {weight.shape[:1]}")
        before, who = len(bias), name
    if before != outputs:
        raise ValueError(
            f"{who} has {before} outputs, must have {outputs}: shares of surge force and yaw moment"
        )


def _fill(part: Vector, shape: tuple[int, ...]) -> Vector:
    """An array of this shape with `part` in its first corner, zeros elsewhere."""
    whole = np.zeros(shape)
    whole[tuple(slice(size) for size in part.shape)] = part
    return whole
