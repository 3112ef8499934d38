"""Arrays of a size that the compiler knows, on the stack of a kernel.

Kernels cannot make arrays on the heap, and such ones are better where they fit: the distances between rows are constants and
nothing else can lie in the same place, so loops over them vectorise.
"""

from __future__ import annotations

from typing import Any

from numba import types
from numba.core import cgutils
from numba.extending import intrinsic
from numba.np.arrayobj import populate_array

LINE = 64
"""Arrays begin at a cache line [bytes]."""


@intrinsic(prefer_literal=True)  # type: ignore[untyped-decorator]  # the compiler has no types
def on_stack(context: Any, rows: Any, columns: Any, dtype: Any) -> Any:
    """An array of shape [rows, columns], both constants, that lives as long as the kernel runs; its numbers are arbitrary.

    To be called outside of loops; some ten thousand numbers at most, since threads have stacks of half a megabyte on macOS.
    """
    shape = (rows.literal_value, columns.literal_value)
    array = types.Array(dtype.dtype, 2, "C")

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        element = context.get_data_type(array.dtype)
        size = context.get_abi_sizeof(element)
        count = context.get_constant(types.intp, shape[0] * shape[1])
        data = cgutils.alloca_once(builder, element, size=count)
        data.align = LINE
        made = context.make_array(array)(context, builder)
        lengths, steps = (
            [context.get_constant(types.intp, n) for n in numbers]
            for numbers in (shape, (shape[1] * size, size))
        )
        populate_array(made, data=data, shape=lengths, strides=steps, itemsize=steps[1], meminfo=None)
        return made._getvalue()

    return array(rows, columns, dtype), codegen
