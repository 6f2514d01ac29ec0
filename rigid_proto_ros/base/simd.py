# SPDX-License-Identifier: MIT
"""SIMD vectors of doubles for compiled kernels: each operation processes several numbers at once.

Operations are those of IEEE 754 on each element, in the order written and never contracted to fused ones: the bits are
those of the same operations on single numbers. The only fused operation is ``fused_multiply_add``.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from fractions import Fraction
from typing import Any, TypeVar

import numpy as np

from .compilation import COMPILED, Emitted, intrinsic, njit
from .library import address_of
from .vectors import FloatArray

if COMPILED:
    from llvmlite import ir
    from numba import types
    from numba.extending import models, overload, register_model

    _DOUBLE, _NUMBER, _BITS = ir.DoubleType(), ir.IntType(32), ir.IntType(64)

LINE = 8
"""Doubles in a cache line."""
Packed = Any
"""Type of a vector in a kernel, for type checkers."""
_Plain = TypeVar("_Plain")


if COMPILED:

    class Doubles(types.Type):
        """A vector of ``count`` doubles."""

        def __init__(self, count: int) -> None:
            self.count = count
            super().__init__(name=f"Doubles({count})")

    @register_model(Doubles)
    class _DoublesModel(models.PrimitiveModel):
        def __init__(self, manager: Any, kind: Any) -> None:
            initialize: Any = super().__init__
            initialize(manager, kind, ir.VectorType(_DOUBLE, kind.count))


def aligned(count: int, before: int = 0) -> FloatArray:
    """Memory for ``count`` doubles of which the first, or the one with index ``before``, is aligned to a cache line: a
    vector that crosses two lines takes twice as long.
    """
    whole = np.empty(count + LINE)
    first = -(address_of(whole) // 8 + before) % LINE
    return whole[first : first + count]


def _operation_on_vectors(plain: Callable[..., _Plain], **options: bool) -> Callable[[Any], Callable[..., _Plain]]:
    """Decorator of an intrinsic; where numba doesn't compile, vectors are arrays and ``plain`` is used."""
    if not COMPILED:
        return lambda _: plain
    of_types: Callable[[Any], Callable[..., _Plain]] = intrinsic(**options) if options else intrinsic
    return of_types


def _pointer(context: Any, builder: ir.IRBuilder, kind: Any, array: Any, at: Any, count: Any) -> Any:
    """Pointer to ``count`` doubles in a contiguous array, from index ``at`` on."""
    first = builder.gep(context.make_array(kind)(context, builder, array).data, [at])
    return builder.bitcast(first, ir.VectorType(_DOUBLE, count).as_pointer())


def _shuffled(builder: ir.IRBuilder, a: Any, b: Any, chosen: Any) -> Any:
    """Elements of a and b, concatenated, with the indices ``chosen``."""
    return builder.shuffle_vector(a, b, ir.Constant(ir.VectorType(_NUMBER, len(chosen)), chosen))


def _filled(builder: ir.IRBuilder, x: Any, count: Any) -> Any:
    unknown = ir.Constant(ir.VectorType(_DOUBLE, count), ir.Undefined)
    return _shuffled(builder, builder.insert_element(unknown, x, ir.Constant(_NUMBER, 0)), unknown, [0] * count)


@_operation_on_vectors(lambda array, at, like: array.reshape(-1)[at : at + like.size].copy())
def load(_typing_context: Any, array: Any, _at: Any, like: Any) -> Emitted:
    """Load numbers of a contiguous array from index ``at`` on, as many as the vector ``like`` has."""

    def code(context: Any, builder: ir.IRBuilder, signature: Any, arguments: Any) -> Any:
        return builder.load(
            _pointer(context, builder, signature.args[0], arguments[0], arguments[1], like.count), align=8
        )

    return like(array, types.int64, like), code


@_operation_on_vectors(lambda array, at, vector: array.reshape(-1).__setitem__(slice(at, at + vector.size), vector))
def store(_typing_context: Any, array: Any, _at: Any, vector: Any) -> Emitted:
    """Store a vector in a contiguous array from index ``at`` on."""

    def code(context: Any, builder: ir.IRBuilder, signature: Any, arguments: Any) -> Any:
        pointer = _pointer(context, builder, signature.args[0], arguments[0], arguments[1], vector.count)
        builder.store(arguments[2], pointer, align=8)
        return context.get_dummy_value()

    return types.void(array, types.int64, vector), code


@_operation_on_vectors(lambda x, count: np.full(count, float(x)), prefer_literal=True)
def filled(_typing_context: Any, _x: Any, count: Any) -> Emitted:
    """A vector of ``count`` numbers x; count is a compile-time constant."""
    kind = Doubles(count.literal_value)
    return kind(types.float64, count), lambda _, builder, _signature, arguments: _filled(
        builder, arguments[0], kind.count
    )


@_operation_on_vectors(lambda a, b: np.concatenate([a, b]))
def paired(_typing_context: Any, a: Any, b: Any) -> Emitted:
    """Concatenation of a and b, which have equal lengths."""

    def code(_context: Any, builder: ir.IRBuilder, _signature: Any, arguments: Any) -> Any:
        return _shuffled(builder, arguments[0], arguments[1], list(range(2 * a.count)))

    return Doubles(2 * a.count)(a, b), code


@njit(error_model="numpy", allocates=False)
def joined(a: Packed, b: Packed, c: Packed, d: Packed) -> Packed:
    """Concatenation of a, b, c and d, which have equal lengths."""
    return paired(paired(a, b), paired(c, d))


@_operation_on_vectors(lambda vector, number: vector.reshape(2, -1)[number], prefer_literal=True)
def half(_typing_context: Any, vector: Any, number: Any) -> Emitted:
    """The first or second half of a vector."""
    return _part(vector, number, 2)


@_operation_on_vectors(lambda vector: float(np.max(np.abs(vector))))
def largest(_typing_context: Any, vector: Any) -> Emitted:
    """The largest absolute value; NaN counts as larger than any number."""

    def code(_context: Any, builder: ir.IRBuilder, _signature: Any, arguments: Any) -> Any:
        # The bits of positive doubles are in the order of their values.
        bits = ir.VectorType(_BITS, vector.count)
        unsigned = builder.and_(builder.bitcast(arguments[0], bits), ir.Constant(bits, [(1 << 63) - 1] * vector.count))
        name, kind = f"llvm.vector.reduce.smax.v{vector.count}i64", ir.FunctionType(_BITS, [bits])
        return builder.bitcast(builder.call(builder.module.declare_intrinsic(name, (), kind), [unsigned]), _DOUBLE)

    return types.float64(vector), code


@_operation_on_vectors(
    lambda vector, order: np.concatenate([vector.reshape(4, -1), -vector.reshape(4, -1)])[list(order)].ravel(),
    prefer_literal=True,
)
def arranged(_typing_context: Any, vector: Any, order: Any) -> Emitted:
    """Permutation of the components of a vector of four; 4 to 7 stand for the negatives of 0 to 3."""
    each = vector.count // 4
    chosen = [part.literal_value * each + k for part in order for k in range(each)]

    def code(_context: Any, builder: ir.IRBuilder, _signature: Any, arguments: Any) -> Any:
        return _shuffled(builder, arguments[0], builder.fneg(arguments[0]), chosen)

    return vector(vector, order), code


@_operation_on_vectors(
    lambda a, b, order: np.concatenate([a.reshape(4, -1), b.reshape(4, -1)])[list(order)].ravel(), prefer_literal=True
)
def mixed(_typing_context: Any, a: Any, b: Any, order: Any) -> Emitted:
    """Selection of components of two vectors of four: 0 to 3 of the first, 4 to 7 of the second."""
    each = a.count // 4
    chosen = [part.literal_value * each + k for part in order for k in range(each)]

    def code(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return _shuffled(builder, arguments[0], arguments[1], chosen)

    return a(a, b, order), code


@_operation_on_vectors(lambda vector, number: vector.reshape(4, -1)[number], prefer_literal=True)
def component(_typing_context: Any, vector: Any, number: Any) -> Emitted:
    """One component of a vector of four."""
    return _part(vector, number, 4)


def _part(vector: Any, number: Any, count: int) -> Emitted:
    """Part ``number`` of ``count`` parts of equal length."""
    each = vector.count // count
    chosen = [number.literal_value * each + k for k in range(each)]

    def code(_context: Any, builder: ir.IRBuilder, _signature: Any, arguments: Any) -> Any:
        return _shuffled(builder, arguments[0], arguments[0], chosen)

    return Doubles(each)(vector, number), code


@_operation_on_vectors(lambda vector, at: float(vector[at]), prefer_literal=True)
def number(_typing_context: Any, vector: Any, at: Any) -> Emitted:
    """One element of a vector."""
    index = ir.Constant(_NUMBER, at.literal_value)
    return types.float64(vector, at), lambda _, builder, _signature, arguments: builder.extract_element(
        arguments[0], index
    )


@njit(error_model="numpy", allocates=False)
def four(a: float, b: float, c: float, d: float) -> Packed:
    """A vector of four numbers. A vector load of numbers just stored one by one would stall until they are written."""
    return joined(filled(a, 1), filled(b, 1), filled(c, 1), filled(d, 1))


@njit(error_model="numpy", allocates=False)
def triple(array: FloatArray, at: int, last: float) -> Packed:
    """A vector of three numbers of an array from index ``at`` on, and ``last``."""
    return four(array[at], array[at + 1], array[at + 2], last)


def _operation(name: str) -> Callable[..., Any]:
    """The instruction of this name on two vectors, or on a vector and a number."""

    @intrinsic
    def of_vectors(_typing_context: Any, a: Any, b: Any) -> Emitted:
        kind = a if isinstance(a, Doubles) else b

        def code(_context: Any, builder: ir.IRBuilder, signature: Any, arguments: Any) -> Any:
            sides = [
                value if isinstance(side, Doubles) else _filled(builder, value, kind.count)
                for side, value in zip(signature.args, arguments, strict=True)
            ]
            return getattr(builder, name)(*sides)

        return kind(*(side if isinstance(side, Doubles) else types.float64 for side in (a, b))), code

    # numba compares the annotations of both functions.
    def implementation(a: Any, b: Any) -> Any:
        return of_vectors(a, b)

    def typed(a: Any, b: Any) -> Any:
        if isinstance(a, Doubles) and isinstance(b, Doubles) and a.count != b.count:
            return None
        return implementation if isinstance(a, Doubles) or isinstance(b, Doubles) else None

    return typed


if COMPILED:
    overload(operator.add)(_operation("fadd"))
    overload(operator.sub)(_operation("fsub"))
    overload(operator.mul)(_operation("fmul"))
    overload(operator.truediv)(_operation("fdiv"))

    @overload(operator.neg)
    def _negated(vector: Any) -> Any:
        def implementation(vector: Any) -> Any:
            return -1.0 * vector

        return implementation if isinstance(vector, Doubles) else None


def _fused_exactly(a: Any, b: Any, c: Any) -> Any:
    if isinstance(a, np.ndarray):
        return np.array([_fused_exactly(*of_one) for of_one in zip(a, b, c, strict=True)])
    if not all(map(math.isfinite, (a, b, c))):
        return a * b + c
    return float(Fraction(a) * Fraction(b) + Fraction(c))


@_operation_on_vectors(_fused_exactly)
def fused_multiply_add(_typing_context: Any, a: Any, _b: Any, _c: Any) -> Emitted:
    """a b + c, rounded once; for three numbers, or for three vectors."""
    kind = a if isinstance(a, Doubles) else types.float64

    def code(_context: Any, builder: ir.IRBuilder, _signature: Any, arguments: Any) -> Any:
        # Where the processor has no such operation LLVM calls fma of the C library, which rounds once, too.
        each = arguments[0].type
        name = f"llvm.fma.v{kind.count}f64" if isinstance(kind, Doubles) else "llvm.fma.f64"
        return builder.call(builder.module.declare_intrinsic(name, (), ir.FunctionType(each, [each] * 3)), arguments)

    return kind(kind, kind, kind), code
