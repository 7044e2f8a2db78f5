# mypy: disable-error-code="no-untyped-call,union-attr"
"""What stands for primitives and builtins in a kernel for lanes, as numba's intrinsics."""

from __future__ import annotations

import operator
from typing import Any

from llvmlite import ir
from numba import types
from numba.core.errors import TypingError
from numba.extending import intrinsic

from podusv_cli.core import elementary, kernel
from podusv_cli.core.kernel import LANES
from podusv_cli.engine.machine.compile_numba import scratch_of, widest
from podusv_cli.engine.machine.lane_masks import (
    joined,
    lanes_and,
    lanes_any,
    lanes_assign,
    lanes_else,
    lanes_if,
    lanes_lift,
    lanes_not,
    lanes_or,
    lanes_pick,
    lanes_same,
    lanes_start,
    mask_of,
)
from podusv_cli.engine.machine.lane_places import lanes_load, lanes_store, lanes_tail, lanes_whole
from podusv_cli.engine.machine.lane_types import (
    BOOL,
    FLOAT,
    IR,
    WHOLE,
    LanesType,
    each_lane,
    intrinsic_call,
    lanes_of,
)
from podusv_cli.engine.step import lane_march


@intrinsic
def lanes_first(typing: Any, number: Any) -> Any:
    """The number of the first lane, where it is the same in all."""
    if not isinstance(number, LanesType):
        return number(number), lambda c, b, s, args: args[0]

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.extract_element(args[0], ir.IntType(32)(0))

    return types.float64(number), code


@intrinsic
def lane_true(typing: Any, mask: Any, lane: Any) -> Any:
    """Whether one lane of a mask is true."""

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.extract_element(args[0], builder.trunc(args[1], ir.IntType(32)))

    return types.boolean(mask, types.int64), code


@intrinsic
def lane_numbers(typing: Any, vector: Any) -> Any:
    """The vector's numbers one by one: those of all lanes, then the next."""

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.bitcast(args[0], ir.DoubleType().as_pointer())

    return types.CPointer(types.float64)(vector), code


@intrinsic
def _filled(typing: Any, whole: Any, count: Any) -> Any:
    return types.int64(types.int64, types.int64), lambda c, b, s, args: args[1]


def _bitwise(from_lanes: Any, to_lanes: Any) -> Any:
    def typed(typing: Any, number: Any) -> Any:
        if number == from_lanes:
            return to_lanes(number), lambda c, b, s, args: b.bitcast(args[0], IR[to_lanes])
        to = to_lanes.scalar

        def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            return builder.bitcast(args[0], context.get_value_type(to))

        return to(from_lanes.scalar), code

    return intrinsic(typed)


def _rounded(name: str) -> Any:
    def typed(typing: Any, number: Any) -> Any:
        if number is FLOAT:
            return FLOAT(FLOAT), lambda c, b, s, args: intrinsic_call(b, name, args[0])

        def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            return builder.call(
                builder.module.declare_intrinsic(f"llvm.{name}", [args[0].type]), args
            )

        return types.float64(types.float64), code

    return intrinsic(typed)


@intrinsic
def _float(typing: Any, number: Any) -> Any:
    kind = FLOAT if isinstance(number, LanesType) else types.float64
    return kind(number), lambda c, b, s, args: c.cast(b, args[0], number, kind)


@intrinsic(prefer_literal=True)
def _power(typing: Any, number: Any, exponent: Any) -> Any:
    """`number ** exponent`, as numba has it: by products where the exponent is written out."""
    if mask_of(number, exponent) is not BOOL:
        plain = typing.resolve_function_type(operator.pow, (number, exponent), {})
        return plain, lambda c, b, s, args: c.get_function(operator.pow, plain)(b, args)
    if isinstance(exponent, types.IntegerLiteral) and number is FLOAT:
        return FLOAT(number, exponent), lambda c, b, s, args: _product(
            b, args[0], exponent.literal_value
        )
    if not {lanes_of(number), lanes_of(exponent)} == {FLOAT}:
        raise TypingError(f"{number} ** {exponent}; write both as floats, or the base as a float")

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        both = [context.cast(builder, v, k, FLOAT) for v, k in zip(args, sig.args, strict=True)]
        return each_lane(context, builder, operator.pow, both)

    return FLOAT(number, exponent), code


def _product(builder: Any, number: Any, exponent: int) -> Any:
    result = ir.Constant(IR[FLOAT], [1.0] * LANES)
    for place in range(exponent.bit_length()):
        if exponent >> place & 1:
            result = builder.fmul(result, number)
        number = builder.fmul(number, number)
    return result


def _extreme(sign: str) -> Any:
    """min or max as Python has it: the first of the two unless the second is beyond it."""

    def typed(typing: Any, one: Any, other: Any) -> Any:
        differs = mask_of(one, other) is BOOL
        kind = joined(one, other) if differs else typing.unify_types(one, other)
        scalar = kind.scalar if isinstance(kind, LanesType) else kind

        def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            first, second = (
                context.cast(builder, v, k, kind) for v, k in zip(args, sig.args, strict=True)
            )
            compare = (
                builder.fcmp_ordered if isinstance(scalar, types.Float) else builder.icmp_signed
            )
            if isinstance(scalar, types.Boolean):
                compare = builder.icmp_unsigned
            return builder.select(compare(sign, second, first), second, first)

        return kind(one, other), code

    return intrinsic(typed)


# What stands for kernels that are no arithmetic.
PRIMITIVES = {
    kernel.tail: lanes_tail, kernel.scratch: scratch_of(FLOAT), kernel.shared: lanes_first,
    kernel.filled: _filled, kernel.widest: widest,
    elementary.bits: _bitwise(FLOAT, WHOLE), elementary.of_bits: _bitwise(WHOLE, FLOAT),
    lane_march.lanes_and: lanes_and, lane_march.lanes_not: lanes_not,
    lane_march.lanes_any: lanes_any, lane_march.lane_true: lane_true,
    lane_march.lane_numbers: lane_numbers,
}  # fmt: skip
WORDS: dict[str, Any] = {
    "lanes_lift": lanes_lift, "lanes_assign": lanes_assign, "lanes_pick": lanes_pick,
    "lanes_and": lanes_and, "lanes_or": lanes_or, "lanes_not": lanes_not, "lanes_if": lanes_if,
    "lanes_else": lanes_else, "lanes_any": lanes_any, "lanes_start": lanes_start,
    "lanes_same": lanes_same,
    "lanes_load": lanes_load, "lanes_store": lanes_store, "int": lanes_whole,
    "lanes_ceil": _rounded("ceil"), "lanes_floor": _rounded("floor"),
    "lanes_power": _power, "min": _extreme("<"), "max": _extreme(">"), "float": _float,
}  # fmt: skip
