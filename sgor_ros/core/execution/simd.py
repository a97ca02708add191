"""Sixteen float32 side by side, for compiled loops whose branches are bits.

LLVM makes vectors of plain loops, but not where a comparison is to become a bit, or a bit is to
choose what is added: such loops say here what they mean. Whatever the processor has (AVX-512,
AVX2, NEON), LLVM finds instructions for it.

All are for compiled code: ``splat(x)``, ``load(array, at)`` and ``store(array, at, lanes)`` with
any alignment and no check of bounds; ``+``, ``-``, ``*``; ``add_where(bits, a, b)``, a + b where
a bit is set and else a; ``at_most(a, b)``, the bits of a <= b; ``total(lanes)``. Bits are a
uint16, the lowest for the first lane. And for words of 64 bits ``lowest(word)``, the place of the
lowest that is set, and ``count(word)``.
"""
from collections.abc import Callable
import operator
from typing import Any

from llvmlite import ir
from numba import extending
from numba import types
from numba.core.datamodel import models
from numba.extending import overload
from numba.extending import register_model
from numba.np.arrayobj import make_array

# its own types want the first argument, which numba fills in, of whoever calls
intrinsic: Callable[[Callable[..., Any]], Any] = extending.intrinsic

WIDTH = 16

_FLOAT = ir.FloatType()
_VECTOR = ir.VectorType(_FLOAT, WIDTH)
_BITS = ir.IntType(WIDTH)
_MASK = ir.VectorType(ir.IntType(1), WIDTH)
# multiply and add may be one instruction
_FLAGS = ('contract', 'nsz')


class _Lanes(types.Type):
    def __init__(self) -> None:
        super().__init__('Lanes')


LANES = _Lanes()


@register_model(_Lanes)
class _Model(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _VECTOR)  # type: ignore[no-untyped-call]


def _place(context: Any, builder: Any, kind: Any, array: Any, at: Any) -> Any:
    """Return a pointer to the lanes from an element on."""
    view = make_array(kind)(context, builder, array)  # type: ignore[no-untyped-call]
    return builder.bitcast(builder.gep(view.data, [at]), _VECTOR.as_pointer())


@intrinsic
def load(typing: Any, array: Any, at: Any) -> Any:
    """Return the 16 from `at` on of a contiguous row of float32."""
    def generate(context: Any, builder: Any, _: Any, arguments: Any) -> Any:
        return builder.load(_place(context, builder, array, *arguments), align=4)
    return LANES(array, types.uint64), generate


@intrinsic
def store(typing: Any, array: Any, at: Any, lanes: Any) -> Any:
    """Write lanes into the 16 from `at` on of a contiguous row of float32."""
    def generate(context: Any, builder: Any, _: Any, arguments: Any) -> Any:
        builder.store(arguments[2], _place(context, builder, array, *arguments[:2]), align=4)
        return context.get_dummy_value()
    return types.void(array, types.uint64, LANES), generate


def _splatted(builder: Any, value: Any) -> Any:
    one = builder.insert_element(ir.Constant(_VECTOR, ir.Undefined), value,
                                 ir.Constant(ir.IntType(32), 0))
    zeros = ir.Constant(ir.VectorType(ir.IntType(32), WIDTH), None)
    return builder.shuffle_vector(one, ir.Constant(_VECTOR, ir.Undefined), zeros)


@intrinsic
def splat(typing: Any, value: Any) -> Any:
    """Return a number in all lanes."""
    def generate(context: Any, builder: Any, _: Any, arguments: Any) -> Any:
        return _splatted(builder, arguments[0])
    return LANES(types.float32), generate


@intrinsic
def add_where(typing: Any, bits: Any, a: Any, b: Any) -> Any:
    """Return a + b in the lanes whose bit is set, and a in the others."""
    def generate(context: Any, builder: Any, _: Any, arguments: Any) -> Any:
        bits, a, b = arguments
        chosen = builder.bitcast(bits, _MASK)
        return builder.select(chosen, builder.fadd(a, b, flags=_FLAGS), a)
    return LANES(types.uint16, LANES, LANES), generate


@intrinsic
def at_most(typing: Any, a: Any, b: Any) -> Any:
    """Return the bits of a <= b; never for NaN."""
    def generate(context: Any, builder: Any, _: Any, arguments: Any) -> Any:
        return builder.bitcast(builder.fcmp_ordered('<=', *arguments), _BITS)
    return types.uint16(LANES, LANES), generate


@intrinsic
def total(typing: Any, lanes: Any) -> Any:
    """Return the sum of all lanes."""
    def generate(context: Any, builder: Any, _: Any, arguments: Any) -> Any:
        kind = ir.FunctionType(_FLOAT, [_FLOAT, _VECTOR])
        add = builder.module.declare_intrinsic(f'llvm.vector.reduce.fadd.v{WIDTH}f32', fnty=kind)
        return builder.call(add, [ir.Constant(_FLOAT, -0.0), arguments[0]], fastmath=('reassoc',))
    return types.float32(LANES), generate


def _operator(of: Any, instruction: str) -> None:
    """Let an operator of two lanes be one instruction."""
    @intrinsic
    def operate(typing: Any, a: Any, b: Any) -> Any:
        def generate(context: Any, builder: Any, _: Any, arguments: Any) -> Any:
            return getattr(builder, instruction)(*arguments, flags=_FLAGS)
        return LANES(LANES, LANES), generate

    @overload(of, strict=False)    # or annotations would have to agree
    def overloaded(a: Any, b: Any) -> Any:
        if isinstance(a, _Lanes) and isinstance(b, _Lanes):
            return lambda a, b: operate(a, b)
        return None


for _of, _instruction in ((operator.add, 'fadd'), (operator.sub, 'fsub'), (operator.mul, 'fmul')):
    _operator(_of, _instruction)


@intrinsic
def lowest(typing: Any, word: Any) -> Any:
    """Return the place of the lowest bit that is set in a uint64 that is not 0."""
    def generate(context: Any, builder: Any, _: Any, arguments: Any) -> Any:
        return builder.cttz(arguments[0], ir.Constant(ir.IntType(1), 1))
    return types.uint64(types.uint64), generate


@intrinsic
def count(typing: Any, word: Any) -> Any:
    """Return how many bits of a uint64 are set."""
    def generate(context: Any, builder: Any, _: Any, arguments: Any) -> Any:
        return builder.ctpop(arguments[0])
    return types.uint64(types.uint64), generate
