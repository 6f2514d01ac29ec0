# SPDX-License-Identifier: MIT
"""Vectors of doubles in processor registers, for compiled kernels: several numbers go through each operation at once.

A vector has n components; where L flights go side by side each component has L numbers, one for each flight. Operations are
those of IEEE 754 on every number by itself, in the order written and never contracted to a fused one: so a flight has the
same bits whether it goes alone or beside others.
"""

from __future__ import annotations

import operator

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic, models, overload, register_model

_DOUBLE, _NUMBER = ir.DoubleType(), ir.IntType(32)
_LINE = 64
"""Bytes."""


class Doubles(types.Type):
    """A vector of ``count`` doubles."""

    def __init__(self, count: int) -> None:
        self.count = count
        super().__init__(name=f"Doubles({count})")


@register_model(Doubles)
class _DoublesModel(models.PrimitiveModel):
    def __init__(self, manager, kind) -> None:
        super().__init__(manager, kind, ir.VectorType(_DOUBLE, kind.count))


def aligned(shape: tuple[int, int]) -> np.ndarray:
    """Zeros whose first number begins a line of the processor's cache: a vector that crosses two takes twice as long."""
    spare = _LINE // 8
    whole = np.zeros(shape[0] * shape[1] + spare)
    first = -(whole.ctypes.data // 8) % spare
    return whole[first : first + shape[0] * shape[1]].reshape(shape)


def _pointer(context, builder, kind, array, at, count):
    """Of ``count`` doubles in a contiguous array, from the one numbered ``at`` on."""
    first = builder.gep(context.make_array(kind)(context, builder, array).data, [at])
    return builder.bitcast(first, ir.VectorType(_DOUBLE, count).as_pointer())


def _shuffled(builder, a, b, chosen):
    """Elements of a, then of b, by their numbers."""
    return builder.shuffle_vector(a, b, ir.Constant(ir.VectorType(_NUMBER, len(chosen)), chosen))


def _filled(builder, x, count):
    unknown = ir.Constant(ir.VectorType(_DOUBLE, count), ir.Undefined)
    return _shuffled(builder, builder.insert_element(unknown, x, ir.Constant(_NUMBER, 0)), unknown, [0] * count)


@intrinsic
def load(typing_context, array, at, like):
    """Numbers of a contiguous array from the number ``at`` on, as many as the vector ``like`` has."""

    def code(context, builder, signature, arguments):
        return builder.load(_pointer(context, builder, signature.args[0], *arguments[:2], like.count), align=8)

    return like(array, types.int64, like), code


@intrinsic
def store(typing_context, array, at, vector):
    """Put a vector into a contiguous array from the number ``at`` on."""

    def code(context, builder, signature, arguments):
        pointer = _pointer(context, builder, signature.args[0], *arguments[:2], vector.count)
        builder.store(arguments[2], pointer, align=8)
        return context.get_dummy_value()

    return types.void(array, types.int64, vector), code


@intrinsic(prefer_literal=True)
def filled(typing_context, x, count):
    """A constant number of times x."""
    kind = Doubles(count.literal_value)
    return kind(types.float64, count), lambda _, builder, signature, arguments: _filled(
        builder, arguments[0], kind.count
    )


@intrinsic
def width(typing_context, vector):
    """How many doubles a vector has."""
    return types.int64(vector), lambda context, builder, signature, arguments: ir.Constant(ir.IntType(64), vector.count)


@intrinsic
def joined(typing_context, a, b, c, d):
    """The vector of the components a, b, c, d."""

    def code(context, builder, signature, arguments):
        n = a.count
        first, second = (_shuffled(builder, *pair, list(range(2 * n))) for pair in (arguments[:2], arguments[2:]))
        return _shuffled(builder, first, second, list(range(4 * n)))

    return Doubles(4 * a.count)(a, b, c, d), code


@intrinsic(prefer_literal=True)
def arranged(typing_context, vector, order):
    """Components of a vector of four in another order; 4 to 7 stand for the negatives of 0 to 3."""
    each = vector.count // 4
    chosen = [part.literal_value * each + k for part in order for k in range(each)]

    def code(context, builder, signature, arguments):
        return _shuffled(builder, arguments[0], builder.fneg(arguments[0]), chosen)

    return vector(vector, order), code


@intrinsic(prefer_literal=True)
def component(typing_context, vector, number):
    """One component of a vector of four."""
    each = vector.count // 4
    chosen = [number.literal_value * each + k for k in range(each)]

    def code(context, builder, signature, arguments):
        return _shuffled(builder, arguments[0], arguments[0], chosen)

    return Doubles(each)(vector, number), code


@intrinsic(prefer_literal=True)
def number(typing_context, vector, at):
    """One of a vector's doubles."""
    index = ir.Constant(_NUMBER, at.literal_value)
    return types.float64(vector, at), lambda _, builder, signature, arguments: builder.extract_element(
        arguments[0], index
    )


@intrinsic
def root(typing_context, vector):
    """Square roots."""

    def code(context, builder, signature, arguments):
        kind = arguments[0].type
        function = builder.module.declare_intrinsic(f"llvm.sqrt.v{vector.count}f64", (), ir.FunctionType(kind, [kind]))
        return builder.call(function, arguments)

    return vector(vector), code


def _operation(name: str):
    """The instruction of this name on two vectors, or on a vector and a number."""

    @intrinsic
    def of_vectors(typing_context, a, b):
        kind = a if isinstance(a, Doubles) else b

        def code(context, builder, signature, arguments):
            sides = [
                value if isinstance(side, Doubles) else _filled(builder, value, kind.count)
                for side, value in zip(signature.args, arguments, strict=True)
            ]
            return getattr(builder, name)(*sides)

        return kind(*(side if isinstance(side, Doubles) else types.float64 for side in (a, b))), code

    def typed(a, b):
        if isinstance(a, Doubles) and isinstance(b, Doubles) and a.count != b.count:
            return None
        if isinstance(a, Doubles) or isinstance(b, Doubles):
            return lambda a, b: of_vectors(a, b)
        return None

    return typed


overload(operator.add)(_operation("fadd"))
overload(operator.sub)(_operation("fsub"))
overload(operator.mul)(_operation("fmul"))
overload(operator.truediv)(_operation("fdiv"))
