"""Copying bytes inside compiled kernels."""

from __future__ import annotations

from numba import njit


@njit(nogil=True, inline="always")
def copy_bytes(source, start, target, at, count):  # type: ignore[no-untyped-def]
    """Copy within kernels; a slice assignment takes seconds to compile, for the sake of its error message."""
    bytes_from = source[start : start + count]
    bytes_to = target[at : at + count]
    for k in range(bytes_to.size):
        bytes_to[k] = bytes_from[k]
