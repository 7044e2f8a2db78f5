"""The words that a kernel for lanes is written in, see `lane_kernels`, as numba's intrinsics.

A mask says in which lanes a statement acts: `None` for all, a bool where all lanes go the same way,
or a truth a lane.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.errors import TypingError
from numba.extending import intrinsic

from podusv_cli.core import elementary, kernel
from podusv_cli.core.kernel import LANES
from podusv_cli.engine import lane_march
from podusv_cli.engine.lane_types import BOOL, FLOAT, IR, WHOLE, LanesType, intrinsic_call, lanes_of

VECTOR: Any = types.CPointer(FLOAT)  # type: ignore[no-untyped-call]


def _all_lanes(mask: Any) -> bool:
    """Whether a mask of this type is the same in all lanes."""
    return not isinstance(mask, LanesType)


def _joined(one: Any, other: Any) -> Any:
    """The type of a value that comes from one or the other, lane by lane."""
    if isinstance(one, types.BaseTuple) and isinstance(other, types.BaseTuple):
        pairs = zip(one, other, strict=True)
        return _tuple_like(one, [_joined(a, b) for a, b in pairs])
    found = {lanes_of(one), lanes_of(other)}
    if None in found or (BOOL in found and len(found) > 1):
        raise TypingError(f"a choice between {one} and {other} cannot differ from lane to lane")
    return FLOAT if FLOAT in found else found.pop()


def _tuple_like(one: Any, kinds: list[Any]) -> Any:
    return types.BaseTuple.from_types(tuple(kinds), getattr(one, "instance_class", None))


def _parts(builder: Any, value: Any, kind: Any) -> list[Any]:
    return cgutils.unpack_tuple(builder, value, len(kind))  # type: ignore[no-untyped-call,no-any-return]


def _select(
    context: Any, builder: Any, mask: Any, one: tuple[Any, Any], other: tuple[Any, Any], kind: Any
) -> Any:
    """Type and value of `one` where the mask is true, else of the other; both as `kind`."""
    if isinstance(kind, types.BaseTuple):
        ones, others = (
            list(zip(of, _parts(builder, v, of), strict=True)) for of, v in (one, other)
        )
        chosen = [
            _select(context, builder, mask, a, b, part)
            for a, b, part in zip(ones, others, kind, strict=True)
        ]
        return context.make_tuple(builder, kind, chosen)
    left, right = (context.cast(builder, v, of, kind) for of, v in (one, other))
    return builder.select(mask, left, right)


def _lift(kind: Any, into_lanes: bool) -> Any:
    """The type of a value that may differ from lane to lane; floats always may."""
    if isinstance(kind, types.BaseTuple):
        return _tuple_like(kind, [_lift(part, into_lanes) for part in kind])
    kind = types.unliteral(kind)
    wanted = lanes_of(kind)
    return wanted if wanted is not None and (into_lanes or wanted is FLOAT) else kind


@intrinsic
def lanes_lift(typing: Any, mask: Any, new: Any) -> Any:
    """The new value of a variable that had none."""
    kind = _lift(new, not _all_lanes(mask))
    return kind(mask, new), lambda c, b, sig, args: _as(c, b, args[1], new, kind)


def _as(context: Any, builder: Any, value: Any, given: Any, wanted: Any) -> Any:
    """The value as the wanted type, a tuple part by part."""
    if not isinstance(wanted, types.BaseTuple):
        return context.cast(builder, value, given, wanted)
    parts = zip(_parts(builder, value, given), given, wanted, strict=True)
    made = [_as(context, builder, part, has, gets) for part, has, gets in parts]
    return context.make_tuple(builder, wanted, made)


@intrinsic
def lanes_assign(typing: Any, mask: Any, new: Any, old: Any) -> Any:
    """The new value where the mask is true, the old one elsewhere; runs if any lane is true."""
    if _all_lanes(mask):
        return new(mask, new, old), lambda c, b, sig, args: args[1]
    kind = _joined(new, old)

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return _select(context, builder, args[0], (new, args[1]), (old, args[2]), kind)

    return kind(mask, new, old), code


@intrinsic
def lanes_pick(typing: Any, condition: Any, one: Any, other: Any) -> Any:
    """`one if condition else other`, both evaluated."""
    condition_type = types.unliteral(condition)
    if isinstance(condition_type, LanesType):
        kind = _joined(one, other)
    else:
        kind = typing.unify_types(types.unliteral(one), types.unliteral(other))
        if kind is None:
            raise TypingError(f"a choice between {one} and {other}")

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        mask = _truth(context, builder, condition, args[0])
        return _select(context, builder, mask, (one, args[1]), (other, args[2]), kind)

    return kind(condition, one, other), code


def _truth(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    if not isinstance(kind, LanesType):
        return context.cast(builder, value, kind, types.boolean)
    if kind is FLOAT:
        return builder.fcmp_unordered("!=", value, ir.Constant(IR[FLOAT], [0.0] * LANES))
    return builder.icmp_signed("!=", value, ir.Constant(IR[WHOLE], [0] * LANES)) if (
        kind is WHOLE
    ) else value


def _mask_of(*kinds: Any) -> Any:
    return BOOL if any(isinstance(k, LanesType) for k in kinds) else types.boolean


def _as_mask(context: Any, builder: Any, kind: Any, value: Any, wanted: Any) -> Any:
    truth = _truth(context, builder, kind, value)
    own = BOOL if isinstance(kind, LanesType) else types.boolean
    return context.cast(builder, truth, own, wanted) if own != wanted else truth


def _combined(combine: Any) -> Any:
    def typed(typing: Any, one: Any, other: Any) -> Any:
        kind = _mask_of(one, other)

        def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            both = [
                _as_mask(context, builder, k, v, kind) for k, v in zip(sig.args, args, strict=True)
            ]
            return combine(builder, *both)

        return kind(one, other), code

    return typed


lanes_and = intrinsic(_combined(lambda b, x, y: b.and_(x, y)))
lanes_or = intrinsic(_combined(lambda b, x, y: b.or_(x, y)))


@intrinsic
def lanes_not(typing: Any, one: Any) -> Any:
    """`not one`."""
    kind = _mask_of(one)

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.not_(_as_mask(context, builder, one, args[0], kind))

    return kind(one), code


def _within(mask: Any, condition: Any, turned: bool) -> Any:
    """Signature and code of the mask of a branch; a mask that is the same in all lanes is true."""
    kind = _mask_of(condition) if _all_lanes(mask) else BOOL

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        truth = _as_mask(context, builder, condition, args[1], kind)
        truth = builder.not_(truth) if turned else truth
        return truth if _all_lanes(mask) else builder.and_(args[0], truth)

    return kind(mask, condition), code


@intrinsic
def lanes_if(typing: Any, mask: Any, condition: Any) -> Any:
    """The lanes that take a branch."""
    return _within(mask, condition, False)


@intrinsic
def lanes_else(typing: Any, mask: Any, condition: Any) -> Any:
    """The lanes that take the other branch."""
    return _within(mask, condition, True)


def _any(builder: Any, mask: Any) -> Any:
    byte = ir.IntType(LANES)
    return builder.icmp_unsigned("!=", builder.bitcast(mask, byte), byte(0))


@intrinsic
def lanes_any(typing: Any, mask: Any) -> Any:
    """Whether any lane is true."""
    if _all_lanes(mask):
        return types.boolean(mask), lambda c, b, sig, args: args[0]
    return types.boolean(mask), lambda c, b, sig, args: _any(b, args[0])


@intrinsic
def lanes_same(typing: Any, condition: Any) -> Any:
    """A condition that has to be the same in all lanes."""
    if isinstance(condition, LanesType):
        raise TypingError("a loop ends at another time in every lane")
    return types.boolean(condition), lambda c, b, s, args: _truth(c, b, condition, args[0])


@intrinsic
def lanes_store(typing: Any, mask: Any, vector: Any, index: Any, number: Any) -> Any:
    """`vector[index] = number` in the lanes of the mask."""
    if not isinstance(vector, types.CPointer) or not isinstance(index, types.Integer):
        raise TypingError(f"{vector}[{index}] = {number}")
    kind = vector.dtype

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        at = builder.gep(args[1], [args[2]])
        new = context.cast(builder, args[3], number, kind)
        if not _all_lanes(mask):
            new = builder.select(args[0], new, builder.load(at))
        builder.store(new, at)
        return context.get_dummy_value()

    return types.none(mask, vector, index, number), code


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

    return types.CPointer(types.float64)(vector), code  # type: ignore[no-untyped-call]


@intrinsic
def _tail(typing: Any, vector: Any, start: Any) -> Any:
    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.gep(arguments[0], [arguments[1]])

    return vector(vector, types.int64), code


@intrinsic(prefer_literal=True)
def _scratch(typing: Any, count: Any) -> Any:
    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return cgutils.alloca_once(builder, IR[FLOAT], count.literal_value)  # type: ignore[no-untyped-call]

    return VECTOR(count), code


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
            return builder.call(builder.module.declare_intrinsic(f"llvm.{name}", [args[0].type]), args)

        return types.float64(types.float64), code

    return intrinsic(typed)


@intrinsic
def _float(typing: Any, number: Any) -> Any:
    kind = FLOAT if isinstance(number, LanesType) else types.float64
    return kind(number), lambda c, b, s, args: _converted(c, b, number, args[0], kind)


def _converted(context: Any, builder: Any, given: Any, value: Any, kind: Any) -> Any:
    if given is WHOLE:
        return builder.sitofp(value, IR[FLOAT])
    return context.cast(builder, value, given, kind)


def _extreme(sign: str) -> Any:
    """min or max as Python has it: the first of the two unless the second is beyond it."""

    def typed(typing: Any, one: Any, other: Any) -> Any:
        kind = _joined(one, other) if _mask_of(one, other) is BOOL else typing.unify_types(one, other)
        scalar = kind.scalar if isinstance(kind, LanesType) else kind

        def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            first, second = (
                context.cast(builder, v, k, kind) for v, k in zip(args, sig.args, strict=True)
            )
            compare = builder.fcmp_ordered if isinstance(scalar, types.Float) else builder.icmp_signed
            return builder.select(compare(sign, second, first), second, first)

        return kind(one, other), code

    return intrinsic(typed)


# What stands for kernels that are no arithmetic.
PRIMITIVES = {
    kernel.tail: _tail, kernel.scratch: _scratch, kernel.shared: lanes_first,
    kernel.filled: _filled,
    elementary.bits: _bitwise(FLOAT, WHOLE), elementary.of_bits: _bitwise(WHOLE, FLOAT),
    lane_march.lanes_and: lanes_and, lane_march.lanes_not: lanes_not,
    lane_march.lanes_any: lanes_any, lane_march.lane_true: lane_true,
    lane_march.lane_numbers: lane_numbers,
}  # fmt: skip
WORDS = {
    word.__name__: word
    for word in (
        lanes_lift, lanes_assign, lanes_pick, lanes_not, lanes_if, lanes_else, lanes_any,
        lanes_same, lanes_store,
    )
} | {
    "lanes_and": lanes_and, "lanes_or": lanes_or, "min": _extreme("<"), "max": _extreme(">"),
    "float": _float, "lanes_ceil": _rounded("ceil"), "lanes_floor": _rounded("floor"),
}  # fmt: skip
