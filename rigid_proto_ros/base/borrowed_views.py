# SPDX-License-Identifier: MIT
"""Arrays in compiled code whose references nobody counts: every slice of a counted one costs two atomic operations."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numba import types
from numba.core import cgutils

from .compilation import INTERPRETED, Emitted, intrinsic, njit

_Arrays = TypeVar("_Arrays")


def _without_owner(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    """The value as a view that owns nothing; of a tuple all its parts."""
    kinds = getattr(kind, "types", None)
    if kinds is not None:
        parts = zip(kinds, cgutils.unpack_tuple(builder, value), strict=True)
        return context.make_tuple(builder, kind, [_without_owner(context, builder, *part) for part in parts])
    if not isinstance(kind, types.Array):
        return value
    view = context.make_array(kind)(context, builder, value)
    view.meminfo, view.parent = cgutils.get_null_value(view.meminfo.type), cgutils.get_null_value(view.parent.type)
    return view._getvalue()  # noqa: SLF001 (so numba's guide to extensions does it)


if TYPE_CHECKING or INTERPRETED:

    def borrowed(arrays: _Arrays) -> _Arrays:
        """The same array, or tuple with arrays in it, as borrowed views, whose references nobody counts. Whoever calls
        the compiled function keeps the arrays: what that function has allocated itself may be gone after its last use.
        """
        return arrays

else:

    @intrinsic
    def borrowed(_typing_context: Any, arrays: Any) -> Emitted:
        """As above."""

        def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            return _without_owner(context, builder, signature.args[0], arguments[0])

        return arrays(arrays), code


@njit(cache=True, error_model="numpy", allocates=False, forceinline=True)
def copy_numbers(of: np.ndarray, to: np.ndarray) -> None:
    """The first numbers of one array to all of another, one by one: numba's own way with slices looks first whether the
    two share memory, and makes room for a copy if they do.
    """
    for k in range(to.shape[0]):
        to[k] = of[k]
