# SPDX-License-Identifier: MIT
"""All exported kernels as one LLVM module, the same for every target: what numba makes of them, unoptimized, and around
each a C function that takes a block (base/library.py).

numba's own functions return a status and take arrays as their parts: ``i32 f(result*, error**, parts ...)``.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm
from llvmlite import ir
from numba import boolean, float64, from_dtype, int64, types
from numba.core import callconv, cgutils, codegen
from numba.core.errors import NumbaError
from numba.np.arrayobj import populate_array

from ..base.errors import InputError
from ..base.files import whole_file
from ..base.library import KERNELS, Kernel, place
from .layouts import import_kernels

NUMBERS = {"f8": float64, "i8": int64, "b1": boolean}
RAISES = "raises."
"""Beginning of the name of what a kernel's C function calls if the kernel raises: the optimizer removes it."""
FUSED = "fused_multiply_add"
"""The C function of a b + c rounded once."""

_SLOT, _DOUBLE = ir.IntType(64), ir.DoubleType()


def _finish_without_code(library: Any) -> None:
    """Numba would link each function with all that it calls, and emit machine code for this processor."""
    library._finalized = True  # noqa: SLF001 (numba has no option)


def _raise_unless_index(raising: Callable[..., None]) -> Callable[..., None]:
    """Numba's code that raises an exception. An index of a tuple is no more checked than one of an array."""

    def code(convention: Any, builder: Any, kind: type, *arguments: Any, **options: Any) -> None:
        if kind is IndexError:
            builder.unreachable()
        else:
            raising(convention, builder, kind, *arguments, **options)

    return code


def lowered(kept: Path, told: Callable[[int, int], None]) -> Any:
    """The module, from a file where it is kept for other targets, or made and kept there. Raises InputError."""
    import_kernels()
    if kept.is_file():
        return llvm.parse_bitcode(kept.read_bytes())
    whole = whole_module(told)
    with whole_file("kernels", kept) as file:
        file.write_bytes(whole.as_bitcode())
    return whole


def whole_module(told: Callable[[int, int], None]) -> Any:
    """The module. ``told`` is called with the number of kernels that are done, and of all."""
    numbas: Any = codegen
    numbas.CPUCodeLibrary.finalize = _finish_without_code
    numbas.JITCodeLibrary.get_pointer_to_function = lambda *_: 0
    numbas.JITCPUCodegen.set_env = lambda *_: None
    convention: Any = callconv.CPUCallConv
    convention.return_user_exc = _raise_unless_index(convention.return_user_exc)
    whole = llvm.parse_assembly("")
    linked: set[int] = set()

    def add(result: Any, c_function: ir.Module) -> None:
        waiting = [result.library]
        while waiting:
            library = waiting.pop()
            if id(library) not in linked:
                linked.add(id(library))
                whole.link_in(library._final_module, preserve=True)  # noqa: SLF001 (its text would be parsed again)
                waiting += library._linking_libraries  # noqa: SLF001 (numba has no other way)
        whole.link_in(llvm.parse_assembly(str(c_function)))

    for done, kernel in enumerate(KERNELS.values()):
        told(done, len(KERNELS))
        result = compiled(kernel)
        add(result, block_function(kernel, result))
        if kernel.name == "fused":
            add(result, fused_function(result))
    return whole


def numba_type(declared: Any) -> Any:
    """Type of an argument."""
    kind, dimensions = place(declared)
    if kind is None:
        return NUMBERS[declared]
    return types.Array(from_dtype(kind), dimensions, "C") if dimensions else from_dtype(kind)


def compiled(kernel: Kernel) -> Any:
    """Numba's result for the arguments that a kernel declares. Raises InputError for what numba can't compile, or only
    with its runtime.
    """
    arguments = tuple(map(numba_type, kernel.arguments))
    try:
        kernel.compiled.compile(arguments)
    except NumbaError as error:
        raise InputError(kernel.name, f"{error}") from None
    return kernel.compiled.overloads[arguments]


def fused_function(result: Any) -> ir.Module:
    """A module with FUSED."""
    context = result.target_context
    module = ir.Module(FUSED)
    callee = context.declare_function(module, result.fndesc)
    function = ir.Function(module, ir.FunctionType(_DOUBLE, [_DOUBLE] * 3), FUSED)
    builder = ir.IRBuilder(function.append_basic_block())
    kinds = [float64] * 3
    _, value = context.call_conv.call_function(builder, callee, float64, kinds, function.args)
    builder.ret(value)
    return module


def block_function(kernel: Kernel, result: Any) -> ir.Module:
    """A module with the C function of a kernel. Raises InputError if it doesn't return what is declared."""
    context, signature = result.target_context, result.signature
    returned: Any = signature.return_type
    found = getattr(returned, "types", () if returned == types.none else (returned,))
    if list(found) != [NUMBERS[kind] for kind in kernel.returns]:
        raise InputError(kernel.name, f"returns {returned}", f"as declared: {' '.join(kernel.returns) or 'nothing'}")
    module = ir.Module(f"block.{kernel.name}")
    callee = context.declare_function(module, result.fndesc)
    function = ir.Function(module, ir.FunctionType(ir.VoidType(), [_SLOT.as_pointer()]), kernel.name)
    builder = ir.IRBuilder(function.append_basic_block())
    block, slots = function.args[0], iter(range(len(kernel.returns), 1000))

    def slot(number: int) -> Any:
        return builder.gep(block, [ir.Constant(ir.IntType(32), number)], inbounds=True)

    def taken(kind: Any) -> Any:
        bits = builder.load(slot(next(slots)))
        if kind == float64:
            return builder.bitcast(bits, _DOUBLE)
        return builder.trunc(bits, ir.IntType(1)) if kind == boolean else bits

    def argument(kind: Any) -> Any:
        if isinstance(kind, types.Record):
            return builder.inttoptr(taken(int64), context.get_value_type(kind))
        if not isinstance(kind, types.Array):
            return taken(kind)
        array = context.make_array(kind)(context, builder)
        data = builder.inttoptr(taken(int64), context.get_data_type(kind.dtype).as_pointer())
        each = context.get_abi_sizeof(context.get_data_type(kind.dtype))
        extents = [taken(int64) for _ in range(kind.ndim)]
        strides = [ir.Constant(_SLOT, each)]
        for extent in reversed(extents[1:]):
            strides.insert(0, builder.mul(strides[0], extent))
        populate_array(array, data=data, shape=extents, strides=strides, itemsize=each, meminfo=None)
        return array._getvalue()  # noqa: SLF001 (as in numba's guide to extensions)

    arguments = [argument(kind) for kind in signature.args]
    status, value = context.call_conv.call_function(builder, callee, signature.return_type, signature.args, arguments)
    # With the exception, so that the optimizer leaves which it is.
    raises = ir.Function(module, ir.FunctionType(ir.VoidType(), [status.excinfoptr.type]), RAISES + kernel.name)
    with builder.if_then(status.is_error, likely=False):
        builder.call(raises, [status.excinfoptr])
    several = isinstance(returned, types.BaseTuple)
    numbers = cgutils.unpack_tuple(builder, value) if several else [value] * len(kernel.returns)
    for number, (kind, given) in enumerate(zip(kernel.returns, numbers, strict=True)):
        bits = builder.bitcast(given, _SLOT) if kind == "f8" else builder.zext(given, _SLOT) if kind == "b1" else given
        builder.store(bits, slot(number))
    builder.ret_void()
    return module
