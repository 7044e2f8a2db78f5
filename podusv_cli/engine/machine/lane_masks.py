# mypy: disable-error-code="no-untyped-call,call-overload,attr-defined,no-any-return"
"""The words for branches that a kernel for lanes is written in, as numba's intrinsics.

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

from podusv_cli.core.kernel import LANES
from podusv_cli.engine.machine.lane_types import BOOL, FLOAT, IR, WHOLE, LanesType, lanes_of


def all_lanes(mask: Any) -> bool:
    """Whether a mask of this type is the same in all lanes."""
    return not isinstance(mask, LanesType)


def joined(one: Any, other: Any) -> Any:
    """The type of a value that comes from one or the other, lane by lane."""
    if isinstance(one, types.BaseTuple) and isinstance(other, types.BaseTuple):
        pairs = zip(one, other, strict=True)
        return _tuple_like(one, [joined(a, b) for a, b in pairs])
    found = {lanes_of(one), lanes_of(other)}
    if None in found or (BOOL in found and len(found) > 1):
        raise TypingError(f"a choice between {one} and {other} cannot differ from lane to lane")
    return FLOAT if FLOAT in found else found.pop()


def _tuple_like(one: Any, kinds: list[Any]) -> Any:
    return types.BaseTuple.from_types(tuple(kinds), getattr(one, "instance_class", None))


def _parts(builder: Any, value: Any, kind: Any) -> list[Any]:
    return cgutils.unpack_tuple(builder, value, len(kind))


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
    """The type of a variable with this first value; floats may always differ from lane to lane."""
    if isinstance(kind, types.BaseTuple):  # a tuple's type cannot become another one later
        return _tuple_like(kind, [_part(part, into_lanes) for part in kind])
    return _part(kind, False)


def _part(kind: Any, into_lanes: bool) -> Any:
    if isinstance(kind, types.BaseTuple):
        return _lift(kind, into_lanes)
    kind = types.unliteral(kind)
    wanted = lanes_of(kind)
    return wanted if wanted is not None and (into_lanes or wanted is FLOAT) else kind


@intrinsic
def lanes_lift(typing: Any, mask: Any, new: Any) -> Any:
    """The new value of a variable that had none."""
    kind = _lift(new, not all_lanes(mask))
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
    if all_lanes(mask):
        return new(mask, new, old), lambda c, b, sig, args: args[1]
    kind = joined(new, old)

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return _select(context, builder, args[0], (new, args[1]), (old, args[2]), kind)

    return kind(mask, new, old), code


@intrinsic
def lanes_same(typing: Any, before: Any, now: Any) -> Any:
    """Refuse a variable that is whole before a branch, and a float where the other one reads it."""
    if lanes_of(before) is WHOLE and lanes_of(now) is FLOAT:
        raise TypingError(
            "a variable is a whole number where one branch reads it, and a float in the other "
            "branch; write 1.0 for 1 before them"
        )
    return types.none(before, now), lambda c, b, sig, args: c.get_dummy_value()


@intrinsic
def lanes_pick(typing: Any, condition: Any, one: Any, other: Any) -> Any:
    """`one if condition else other`, both evaluated."""
    condition_type = types.unliteral(condition)
    if isinstance(condition_type, LanesType):
        kind = joined(one, other)
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
    return (
        builder.icmp_signed("!=", value, ir.Constant(IR[WHOLE], [0] * LANES))
        if (kind is WHOLE)
        else value
    )


def mask_of(*kinds: Any) -> Any:
    """The type of a mask that is made of these types."""
    return BOOL if any(isinstance(k, LanesType) for k in kinds) else types.boolean


def _as_mask(context: Any, builder: Any, kind: Any, value: Any, wanted: Any) -> Any:
    truth = _truth(context, builder, kind, value)
    own = BOOL if isinstance(kind, LanesType) else types.boolean
    return context.cast(builder, truth, own, wanted) if own != wanted else truth


def _combined(combine: Any) -> Any:
    def typed(typing: Any, one: Any, other: Any) -> Any:
        kind = mask_of(one, other)

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
    kind = mask_of(one)

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.not_(_as_mask(context, builder, one, args[0], kind))

    return kind(one), code


def _within(mask: Any, condition: Any, turned: bool) -> Any:
    """Signature and code of the mask of a branch; a mask that is the same in all lanes is true."""
    kind = mask_of(condition) if all_lanes(mask) else BOOL

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        truth = _as_mask(context, builder, condition, args[1], kind)
        truth = builder.not_(truth) if turned else truth
        return truth if all_lanes(mask) else builder.and_(args[0], truth)

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
    if all_lanes(mask):
        return types.boolean(mask), lambda c, b, sig, args: args[0]
    return types.boolean(mask), lambda c, b, sig, args: _any(b, args[0])


@intrinsic
def lanes_start(typing: Any, mask: Any) -> Any:
    """The lanes in which a loop begins, that may end at another time in every lane."""
    if isinstance(mask, types.NoneType):
        return types.boolean(mask), lambda c, b, sig, args: cgutils.true_bit
    return mask(mask), lambda c, b, sig, args: args[0]
