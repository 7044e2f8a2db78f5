# mypy: disable-error-code="no-untyped-call,misc,attr-defined,untyped-decorator"
"""numba's types for a number of every lane, and the LLVM code of what kernels do with them.

`LANES_FLOAT` is one float a lane, in vector registers; `LANES_WHOLE` a whole number, `LANES_BOOL`
a truth a lane, which is called a mask. Every operation is that of numba's scalars, lane by lane.
"""

from __future__ import annotations

import math
import operator
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.datamodel import models, register_default
from numba.core.errors import TypingError
from numba.core.imputils import lower_builtin, lower_cast
from numba.core.typeconv import Conversion
from numba.core.typing.templates import AbstractTemplate, infer_global, signature

from podusv_cli.core.kernel import LANES


class LanesType(types.Type):
    """One number of this scalar type a lane; a scalar stands for the same number in all lanes."""

    def __init__(self, scalar: Any, accepts: tuple[type, ...]) -> None:
        """`accepts` are the classes of scalar types that may stand for this type."""
        self.scalar, self.accepts = scalar, accepts
        super().__init__(name=f"lanes({scalar})")

    def can_convert_from(self, typingctx: Any, other: Any) -> Any:
        """From a scalar, and from whole numbers to floats."""
        whole = self.scalar == types.float64 and other is WHOLE
        return Conversion.safe if whole or isinstance(other, self.accepts) else None


FLOAT = LanesType(types.float64, (types.Float, types.Integer))
WHOLE = LanesType(types.int64, (types.Integer,))
BOOL = LanesType(types.boolean, (types.Boolean,))
IR = {
    FLOAT: ir.VectorType(ir.DoubleType(), LANES),
    WHOLE: ir.VectorType(ir.IntType(64), LANES),
    BOOL: ir.VectorType(ir.IntType(1), LANES),
}


@register_default(LanesType)
class _Model(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, IR[kind])


def lanes_of(kind: Any) -> Any:
    """The type with one of these a lane; None where there is none."""
    kind = types.unliteral(kind)
    if isinstance(kind, LanesType):
        return kind
    if isinstance(kind, types.Float):
        return FLOAT
    if isinstance(kind, types.Boolean):
        return BOOL
    return WHOLE if isinstance(kind, types.Integer) else None


def splat(builder: Any, number: Any) -> Any:
    """The number in every lane."""
    vector = ir.VectorType(number.type, LANES)
    if isinstance(number, ir.Constant):
        return ir.Constant(vector, [number.constant] * LANES)
    first = builder.insert_element(ir.Constant(vector, ir.Undefined), number, ir.IntType(32)(0))
    order = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
    return builder.shuffle_vector(first, ir.Constant(vector, ir.Undefined), order)


@lower_cast(types.Any, LanesType)
def cast_to_lanes(context: Any, builder: Any, given: Any, wanted: Any, number: Any) -> Any:
    """A scalar into every lane, or a whole number of every lane as a float."""
    if given == wanted:
        return number
    if isinstance(given, LanesType):
        return _converted(builder, number, given, wanted)
    scalar = context.cast(builder, number, given, wanted.scalar)
    if wanted is BOOL:
        scalar = builder.trunc(scalar, ir.IntType(1)) if scalar.type.width != 1 else scalar
    return splat(builder, scalar)


def _converted(builder: Any, number: Any, given: Any, wanted: Any) -> Any:
    """A truth is 0 or 1, as in Python."""
    if given is BOOL and wanted is WHOLE:
        return builder.zext(number, IR[WHOLE])
    if given is BOOL and wanted is FLOAT:
        return builder.uitofp(number, IR[FLOAT])
    if given is WHOLE and wanted is FLOAT:
        return builder.sitofp(number, IR[FLOAT])
    raise TypingError(f"{given} cannot become {wanted}")


ONE: tuple[Any, ...] = (
    math.sin, math.cos, math.tan, math.asin, math.acos, math.atan, math.exp, math.log,
    math.sinh, math.cosh, math.tanh, math.log10, math.log1p, math.expm1, math.asinh, math.acosh,
    math.atanh, math.erf, math.radians, math.degrees,
)  # fmt: skip
TWO: tuple[Any, ...] = (math.atan2, math.hypot, math.pow, math.copysign)
OF_FLOATS = {operator.truediv, math.sqrt, math.fabs, *ONE, *TWO} - {math.pow}  # numba's pow differs


def _has_lanes(args: Any) -> bool:
    return any(isinstance(a, LanesType) for a in args)


def _operation(function: Any, arity: int, result: Any = None) -> None:
    """Let numba know `function` of floats; `result` is the type, by default the same."""

    @infer_global(function)
    class Template(AbstractTemplate):
        key = function

        def generic(self, args: Any, kws: Any) -> Any:
            kinds = [lanes_of(a) for a in args]
            if kws or len(args) != arity or not _has_lanes(args) or None in kinds:
                return None
            floats = FLOAT in kinds or function in OF_FLOATS
            kind = FLOAT if floats else WHOLE  # truths are the numbers 0 and 1
            return signature(result or kind, *[kind] * arity)


def _lower(function: Any, kind: Any, arity: int, emit: Any) -> None:
    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return emit(builder, *args)

    lower_builtin(function, *[kind] * arity)(code)


FLOATS: dict[Any, Any] = {
    operator.add: lambda b, x, y: b.fadd(x, y),
    operator.sub: lambda b, x, y: b.fsub(x, y),
    operator.mul: lambda b, x, y: b.fmul(x, y),
    operator.truediv: lambda b, x, y: b.fdiv(x, y),
}
WHOLES: dict[Any, Any] = {
    operator.add: lambda b, x, y: b.add(x, y),
    operator.sub: lambda b, x, y: b.sub(x, y),
    operator.mul: lambda b, x, y: b.mul(x, y),
    operator.and_: lambda b, x, y: b.and_(x, y),
    operator.or_: lambda b, x, y: b.or_(x, y),
    operator.lshift: lambda b, x, y: b.shl(x, y),
    operator.rshift: lambda b, x, y: b.ashr(x, y),
}
COMPARISONS: dict[Any, str] = {
    operator.lt: "<", operator.le: "<=", operator.gt: ">", operator.ge: ">=", operator.eq: "==",
    operator.ne: "!=",
}  # fmt: skip


def _compare_floats(sign: str) -> Any:
    def emit(builder: Any, x: Any, y: Any) -> Any:
        compare = builder.fcmp_unordered if sign == "!=" else builder.fcmp_ordered
        return compare(sign, x, y)

    return emit


for _function in FLOATS.keys() | WHOLES.keys():
    _operation(_function, 2)
for _function, _emit in FLOATS.items():
    _lower(_function, FLOAT, 2, _emit)
for _function, _emit in WHOLES.items():
    _lower(_function, WHOLE, 2, _emit)
for _function, _sign in COMPARISONS.items():
    _operation(_function, 2, BOOL)
    _lower(_function, FLOAT, 2, _compare_floats(_sign))
    _lower(_function, WHOLE, 2, lambda b, x, y, sign=_sign: b.icmp_signed(sign, x, y))
_operation(operator.neg, 1)
_lower(operator.neg, FLOAT, 1, lambda b, x: b.fsub(ir.Constant(x.type, [-0.0] * LANES), x))
_lower(operator.neg, WHOLE, 1, lambda b, x: b.sub(ir.Constant(x.type, [0] * LANES), x))
_operation(operator.pos, 1)
_lower(operator.pos, FLOAT, 1, lambda b, x: x)
_lower(operator.pos, WHOLE, 1, lambda b, x: x)


def intrinsic_call(builder: Any, name: str, x: Any) -> Any:
    """LLVM's own function of one vector of floats."""
    kind = ir.FunctionType(x.type, [x.type])
    full = f"llvm.{name}.v{LANES}f64"
    return builder.call(cgutils.get_or_insert_function(builder.module, kind, full), [x])


def each_lane(context: Any, builder: Any, function: Any, args: Any, kind: Any = FLOAT) -> Any:
    """numba's function of scalars, lane by lane."""
    code = context.get_function(function, signature(kind.scalar, *[kind.scalar] * len(args)))
    result = ir.Constant(IR[kind], ir.Undefined)
    for lane in range(LANES):
        at = ir.IntType(32)(lane)
        own = [builder.extract_element(a, at) for a in args]
        result = builder.insert_element(result, code(builder, own), at)
    return result


def _by_lane(function: Any, arity: int, kind: Any = FLOAT) -> None:
    @lower_builtin(function, *[kind] * arity)
    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return each_lane(context, builder, function, args, kind)


def _library(function: Any, arity: int) -> None:
    _operation(function, arity, FLOAT)
    _by_lane(function, arity)


LLVM: dict[Any, str] = {math.sqrt: "sqrt", math.fabs: "fabs", abs: "fabs"}
for _function in ONE:
    _library(_function, 1)
for _function in TWO:
    _library(_function, 2)
for _function, _llvm in LLVM.items():
    _operation(_function, 1)
    _lower(_function, FLOAT, 1, lambda b, x, name=_llvm: intrinsic_call(b, name, x))
_lower(
    abs, WHOLE, 1,
    lambda b, x: b.select(
        b.icmp_signed("<", x, ir.Constant(x.type, [0] * LANES)),
        b.sub(ir.Constant(x.type, [0] * LANES), x),
        x,
    ),
)  # fmt: skip
for _function in (operator.mod, operator.floordiv):
    _operation(_function, 2)
    _by_lane(_function, 2, FLOAT)
    _by_lane(_function, 2, WHOLE)
for _function, _llvm in {math.floor: "floor", math.ceil: "ceil", math.trunc: "trunc"}.items():
    _operation(_function, 1, WHOLE)
    _lower(
        _function, FLOAT, 1,
        lambda b, x, name=_llvm: b.fptosi(intrinsic_call(b, name, x), IR[WHOLE]),
    )  # fmt: skip
_operation(math.isnan, 1, BOOL)
_lower(math.isnan, FLOAT, 1, lambda b, x: b.fcmp_unordered("uno", x, x))
_operation(math.isinf, 1, BOOL)
_operation(math.isfinite, 1, BOOL)
_INFINITE = ir.Constant(IR[FLOAT], [math.inf] * LANES)
_lower(
    math.isinf, FLOAT, 1,
    lambda b, x: b.fcmp_ordered("==", intrinsic_call(b, "fabs", x), _INFINITE),
)  # fmt: skip
_lower(
    math.isfinite, FLOAT, 1,
    lambda b, x: b.fcmp_ordered("<", intrinsic_call(b, "fabs", x), _INFINITE),
)  # fmt: skip
