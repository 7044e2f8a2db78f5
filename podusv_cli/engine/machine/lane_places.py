# mypy: disable-error-code="no-untyped-call,untyped-decorator,attr-defined"
"""Places of a vector that differ from lane to lane, and reading and writing there.

A number of a vector is one a lane, one beside the other. So lane j's number i of a vector is number
`LANES * i + j` in memory.
"""

from __future__ import annotations

import operator
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.datamodel import models, register_default
from numba.core.errors import TypingError
from numba.core.imputils import lower_builtin
from numba.core.typing.templates import AbstractTemplate, infer_global
from numba.extending import intrinsic

from podusv_cli.core.kernel import LANES
from podusv_cli.engine.machine.compile_numba import tail_of
from podusv_cli.engine.machine.lane_masks import all_lanes
from podusv_cli.engine.machine.lane_types import BOOL, FLOAT, IR, WHOLE, LanesType

VECTOR: Any = types.CPointer(FLOAT)


class LanesTail(types.Type):
    """The part of a vector that begins at a place of its own in every lane."""

    def __init__(self) -> None:
        """There is one such type."""
        super().__init__(name="lanes(tail)")


TAIL = LanesTail()


@register_default(LanesTail)
class _Model(models.StructModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, [("vector", VECTOR), ("at", WHOLE)])


def _begins(context: Any, builder: Any, kind: Any, value: Any) -> tuple[Any, Any]:
    """Where the whole vector begins, and from which place on each lane has a part of it."""
    if kind is not TAIL:
        return value, ir.Constant(IR[WHOLE], [0] * LANES)
    part = cgutils.create_struct_proxy(TAIL)(context, builder, value)
    return part.vector, part.at


def differs(vector: Any, index: Any) -> bool:
    """Whether `vector[index]` is at another place in every lane."""
    return vector is TAIL or (isinstance(vector, types.CPointer) and index is WHOLE)


def _addresses(context: Any, builder: Any, sig: Any, mask: Any, vector: Any, index: Any) -> Any:
    """Where each lane's number lies; for lanes outside the mask the vector's first."""
    masked, kind, given = sig
    base, at = _begins(context, builder, kind, vector)
    at = builder.add(at, context.cast(builder, index, given, WHOLE))
    if not all_lanes(masked):
        at = builder.select(mask, at, ir.Constant(IR[WHOLE], [0] * LANES))
    numbers = builder.bitcast(base, ir.DoubleType().as_pointer())
    for lane in range(LANES):
        own = builder.extract_element(at, ir.IntType(32)(lane))
        place = builder.add(builder.mul(own, own.type(LANES)), own.type(lane))
        yield ir.IntType(32)(lane), builder.gep(numbers, [place])


@infer_global(operator.getitem)
class _Item(AbstractTemplate):
    """`tail[0]`, an index that is written out."""

    def generic(self, args: Any, kws: Any) -> Any:
        vector, index = args
        return (
            FLOAT(vector, types.intp)
            if vector is TAIL and isinstance(index, types.Integer)
            else None
        )


@lower_builtin(operator.getitem, LanesTail, types.Integer)
def _item(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    return _gathered(context, builder, (types.none, *sig.args), (None, *args))


def _gathered(context: Any, builder: Any, kinds: Any, place: Any) -> Any:
    """Each lane's number at its place."""
    result = ir.Constant(IR[FLOAT], ir.Undefined)
    for lane, address in _addresses(context, builder, kinds, *place):
        result = builder.insert_element(result, builder.load(address), lane)
    return result


@intrinsic
def lanes_load(typing: Any, mask: Any, vector: Any, index: Any) -> Any:
    """`vector[index]` in the lanes of the mask."""
    if not differs(vector, index):
        plain = typing.resolve_function_type(operator.getitem, (vector, index), {})
        found = plain.return_type(mask, *plain.args)
        return found, lambda c, b, s, args: c.get_function(operator.getitem, plain)(b, args[1:])
    return FLOAT(mask, vector, index), lambda c, b, s, args: _gathered(c, b, s.args, args)


@intrinsic
def lanes_store(typing: Any, mask: Any, vector: Any, index: Any, number: Any) -> Any:
    """`vector[index] = number` in the lanes of the mask."""
    if differs(vector, index):
        return types.none(mask, vector, index, number), _scattered
    if not isinstance(vector, types.CPointer) or not isinstance(index, types.Integer):
        raise TypingError(f"{vector}[{index}] = {number}")
    kind = vector.dtype

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        at = builder.gep(args[1], [args[2]])
        new = context.cast(builder, args[3], number, kind)
        if not all_lanes(mask):
            new = builder.select(args[0], new, builder.load(at))
        builder.store(new, at)
        return context.get_dummy_value()

    return types.none(mask, vector, index, number), code


def _scattered(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    """Store each lane's number at its place."""
    *place, number = args
    kinds = sig.args[:3]
    new = context.cast(builder, number, sig.args[3], FLOAT)
    for lane, address in _addresses(context, builder, kinds, *place):
        own = builder.extract_element(new, lane)
        if all_lanes(kinds[0]):
            builder.store(own, address)
        else:
            with builder.if_then(builder.extract_element(args[0], lane)):
                builder.store(own, address)
    return context.get_dummy_value()


@intrinsic
def lanes_tail(typing: Any, vector: Any, start: Any) -> Any:
    """The part of a vector from a place on."""
    if not differs(vector, start):
        return tail_of(typing, vector, start)

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        base, at = _begins(context, builder, vector, args[0])
        part = cgutils.create_struct_proxy(TAIL)(context, builder)
        part.vector, part.at = base, builder.add(at, context.cast(builder, args[1], start, WHOLE))
        return part._getvalue()

    return TAIL(vector, start), code


@intrinsic
def lanes_whole(typing: Any, number: Any) -> Any:
    """`int(number)`."""
    if number is WHOLE:
        return WHOLE(number), lambda c, b, s, args: args[0]
    if number is BOOL:
        return WHOLE(number), lambda c, b, s, args: c.cast(b, args[0], BOOL, WHOLE)
    if isinstance(number, LanesType):
        return WHOLE(FLOAT), lambda c, b, s, args: b.fptosi(args[0], IR[WHOLE])
    return types.int64(number), lambda c, b, s, args: c.cast(b, args[0], number, types.int64)
