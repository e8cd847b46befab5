"""Independent parts of a long array, worked on by several threads."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

from numba import get_num_threads

CHUNK = 65_536
"""Rows a part: intermediate arrays then stay in the processor's cache, and memory does not follow the input."""


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
