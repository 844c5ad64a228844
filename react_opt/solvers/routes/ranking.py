"""Kernels that only kernels call, and the sorts that they share."""

from __future__ import annotations

import numpy as np

from react_opt.kernels import kernel
from react_opt.route_problem import FloatArray, IntArray

INSERTED = 40  # values that are sorted by insertion at most

inner = kernel(nogil=True, no_cpython_wrapper=True, no_cfunc_wrapper=True)
"""Kernel that only kernels call: without the wrappers for Python, which take longer to compile than it does."""


@inner
def ranking(keys: FloatArray) -> IntArray:
    """Indices that sort the keys in rising order, equal ones as they come (a merge sort quick to compile)."""
    count = len(keys)
    order, other = np.empty(count, dtype=np.int64), np.empty(count, dtype=np.int64)
    for k in range(count):
        order[k] = k
    run = 1
    while run < count:
        for low in range(0, count, 2 * run):
            middle, high = min(low + run, count), min(low + 2 * run, count)
            i, j = low, middle
            for k in range(low, high):
                if j >= high or (i < middle and keys[order[i]] <= keys[order[j]]):
                    other[k] = order[i]
                    i += 1
                else:
                    other[k] = order[j]
                    j += 1
        order, other = other, order
        run *= 2
    return order


@kernel(inline="always")
def sort_falling(value: FloatArray, count: int, order: IntArray) -> None:
    """Write the indices of the first ``count`` values into ``order``, the largest first.

    Most lists are short, where inserting is several times faster than a general sort and allocates nothing.
    """
    if count > INSERTED:
        falling = np.argsort(-value[:count])
        for k in range(count):
            order[k] = falling[k]
        return
    for k in range(count):
        v = value[k]
        place = k
        while place > 0 and value[order[place - 1]] < v:
            order[place] = order[place - 1]
            place -= 1
        order[place] = k
