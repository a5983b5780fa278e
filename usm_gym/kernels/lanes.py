"""Numbers for several robots side by side: what turns a scalar kernel into a vector one.

Inside kernels a quantity of the plant is either a float64, for one robot, or a `Lanes`, one number
for each of `WIDTH` robots, held in vector registers. Arithmetic, `abs`, `math.sqrt`, comparisons
and `where` work alike on both, lane by lane, so that each equation is written once, as for one
robot, and numba compiles it for either type. Every operation is the IEEE 754 one, and so are its
bits.
"""

from __future__ import annotations

import math
import operator
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.typing.templates import ConcreteTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, models, overload, register_model

from usm_gym.kernels.compile import shared

WIDTH = 8


class LanesType(types.Type):
    """numba's name for a number per lane."""

    def __init__(self) -> None:
        """Name the type."""
        super().__init__(name=f"Lanes({WIDTH})")


class MaskType(types.Type):
    """numba's name for a truth value per lane."""

    def __init__(self) -> None:
        """Name the type."""
        super().__init__(name=f"Mask({WIDTH})")


class BlockType(types.Type):
    """numba's name for the address of a block whose rows have `width` numbers."""

    def __init__(self, width: int) -> None:
        """Name the type."""
        self.width = width
        super().__init__(name=f"Block({width})")


LANES = LanesType()
MASK = MaskType()
VECTOR = ir.VectorType(ir.DoubleType(), WIDTH)
INTEGERS = ir.VectorType(ir.IntType(64), WIDTH)


@register_model(LanesType)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, VECTOR)


@register_model(MaskType)
class _MaskModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, ir.VectorType(ir.IntType(1), WIDTH))


@register_model(BlockType)
class _BlockModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, ir.DoubleType().as_pointer())


def _splat(builder: Any, scalar: Any) -> Any:
    vector = builder.insert_element(ir.Constant(VECTOR, ir.Undefined), scalar, _index(0))
    zeros = ir.Constant(ir.VectorType(ir.IntType(32), WIDTH), None)
    return builder.shuffle_vector(vector, vector, zeros)


def _index(value: int) -> Any:
    return ir.Constant(ir.IntType(32), value)


def _as_vector(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    if kind == LANES:
        return value
    return _splat(builder, context.cast(builder, value, kind, types.float64))


def _register(function: Any, result: Any, emit: Any) -> None:
    """Teach numba a binary operation between lanes, and between lanes and a number."""
    pairs = [(LANES, LANES)]
    for scalar in (types.float64, types.int64):
        pairs += [(LANES, scalar), (scalar, LANES)]

    cases = [signature(result, *pair) for pair in pairs]
    infer_global(function)(type("Template", (ConcreteTemplate,), {"cases": cases}))

    def lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        left, right = (
            _as_vector(context, builder, kind, value)
            for kind, value in zip(sig.args, args, strict=True)
        )
        return emit(builder, left, right)

    for pair in pairs:
        lower_builtin(function, *pair)(lower)


def _comparison(sign: str) -> Any:
    return lambda builder, left, right: builder.fcmp_ordered(sign, left, right)


for _functions, _emit in (
    ((operator.add, operator.iadd), lambda builder, a, b: builder.fadd(a, b)),
    ((operator.sub, operator.isub), lambda builder, a, b: builder.fsub(a, b)),
    ((operator.mul, operator.imul), lambda builder, a, b: builder.fmul(a, b)),
    ((operator.truediv, operator.itruediv), lambda builder, a, b: builder.fdiv(a, b)),
):
    for _function in _functions:
        _register(_function, LANES, _emit)
for _function, _sign in (
    (operator.gt, ">"),
    (operator.ge, ">="),
    (operator.lt, "<"),
    (operator.le, "<="),
    (operator.eq, "=="),
):
    _register(_function, MASK, _comparison(_sign))


@overload(operator.neg)
def _negation(value):
    return (lambda value: _negate(value)) if value == LANES else None


@overload(abs)
def _size(value):
    return (lambda value: _without_sign(value)) if value == LANES else None


@overload(math.sqrt)
def _root(value):
    return (lambda value: _square_root(value)) if value == LANES else None


@intrinsic
def _negate(typing_context, value):
    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.fneg(args[0])

    return LANES(LANES), emit


@intrinsic
def _without_sign(typing_context, value):
    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        mask = ir.Constant(INTEGERS, [2**63 - 1] * WIDTH)
        bits = builder.and_(builder.bitcast(args[0], INTEGERS), mask)
        return builder.bitcast(bits, VECTOR)

    return LANES(LANES), emit


@intrinsic
def _square_root(typing_context, value):
    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        kind = ir.FunctionType(VECTOR, [VECTOR])
        root = cgutils.get_or_insert_function(builder.module, kind, f"llvm.sqrt.v{WIDTH}f64")
        return builder.call(root, [args[0]])

    return LANES(LANES), emit


@intrinsic
def _splat_lanes(typing_context, value):
    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return _splat(builder, args[0])

    return LANES(types.float64), emit


@intrinsic
def _select(typing_context, mask, yes, no):
    lanes = LANES in (mask, yes, no) or mask == MASK
    result = LANES if lanes else types.float64

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        convert = _as_vector if lanes else _as_float
        values = [
            convert(context, builder, kind, value)
            for kind, value in zip(sig.args[1:], args[1:], strict=True)
        ]
        return builder.select(args[0], *values)

    return result(mask, yes, no), emit


def _as_float(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    return context.cast(builder, value, kind, types.float64)


@intrinsic
def _block(typing_context, blocks, k, like):
    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        array = context.make_array(sig.args[0])(context, builder, args[0])
        size = builder.extract_value(array.shape, 1)
        return builder.gep(array.data, [builder.mul(args[1], size)])

    return BlockType(_width(like))(blocks, types.intp, like), emit


@intrinsic
def _load(typing_context, block, row, like):
    kind = VECTOR if like == LANES else ir.DoubleType()

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        address = _address(builder, block.width, args[0], args[1], kind)
        return builder.load(address, align=8, typ=kind)

    return like(block, types.intp, like), emit


@intrinsic
def _store(typing_context, block, row, value):
    lanes = value == LANES or block.width == WIDTH
    kind, convert = (VECTOR, _as_vector) if lanes else (ir.DoubleType(), _as_float)

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        address = _address(builder, block.width, args[0], args[1], kind)
        builder.store(convert(context, builder, value, args[2]), address, align=8)
        return context.get_dummy_value()

    return types.none(block, types.intp, value), emit


def _address(builder: Any, width: int, block: Any, row: Any, kind: Any) -> Any:
    offset = builder.mul(row, ir.Constant(row.type, width))
    return builder.bitcast(builder.gep(block, [offset]), kind.as_pointer())


def _width(kind: Any) -> int:
    return WIDTH if kind == LANES else 1


@shared
def padded(numbers: int) -> int:
    """Rows of a quantity that is worked on in whole `Lanes`."""
    return (numbers + WIDTH - 1) // WIDTH * WIDTH


def where(mask: Any, yes: Any, no: Any) -> Any:
    """`yes` where the mask holds, else `no`; for kernels only."""
    raise NotImplementedError


def spread(value: Any) -> Any:
    """A `Lanes` that holds the same number in every lane; for kernels only."""
    raise NotImplementedError


def load(block: Any, row: Any, like: Any) -> Any:
    """Row `row` of a block, of the type of `like`; for kernels only.

    From a block of one robot, a `Lanes` is as many rows that follow each other.
    """
    raise NotImplementedError


def store(block: Any, row: Any, value: Any) -> Any:
    """Write row `row` of a block, as `load` reads it; for kernels only."""
    raise NotImplementedError


def block_at(blocks: Any, k: Any, like: Any) -> Any:
    """Block `k` of an array of shape (blocks, numbers of a block); for kernels only.

    Its rows hold `WIDTH` numbers if `like` is a `Lanes`, else one.
    """
    raise NotImplementedError


@overload(where)
def _where(mask, yes, no):
    return lambda mask, yes, no: _select(mask, yes, no)


@overload(spread)
def _spread_lanes(value):
    return lambda value: _splat_lanes(value)


@overload(load)
def _load_row(block, row, like):
    return lambda block, row, like: _load(block, row, like)


@overload(store)
def _store_row(block, row, value):
    return lambda block, row, value: _store(block, row, value)


@overload(block_at)
def _block_of(blocks, k, like):
    return lambda blocks, k, like: _block(blocks, k, like)
