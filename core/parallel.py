"""Independent parts of a long array, worked on by several threads."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

from numba import get_num_threads, njit

CHUNK = 65_536
"""Rows a part: intermediate arrays then stay in the processor's cache, and memory does not follow the input."""


@njit(cache=True, nogil=True)
def spread(total: int) -> int:
    """A stride without a common divisor with ``total``: the parts (n * stride) % total, n = 0, 1, ..., are each part once, and
    any run of them is a fair sample of all.

    Kernels give each thread a run of n. Work that is uneven along an array (a scanner sees little below itself) is so
    shared evenly.
    """
    stride = max(int(0.618 * total), 1)
    while True:
        a, b = total, stride
        while b:
            a, b = b, a % b
        if a <= 1:
            return stride
        stride += 1


def in_chunks(count: int, work: Callable[[slice], None], size: int = CHUNK) -> None:
    """Call ``work`` with slices that together cover ``count`` rows, in as many threads as the kernels may use.

    ``work`` writes the results of its own rows only, so neither the number of threads nor the size of the parts changes
    them; threads gain where it spends its time in code that releases the interpreter's lock (Embree, large numpy
    operations).
    """
    parts = [slice(begin, min(begin + size, count)) for begin in range(0, count, size)]
    threads = min(get_num_threads(), len(parts))
    if threads <= 1:
        for part in parts:
            work(part)
        return
    with ThreadPoolExecutor(threads) as pool:
        for _ in pool.map(work, parts):
            pass
