"""Which elements are parts of which others that have a body too: a stair and its flights, a curtain wall and its plates."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

DEEPEST = 50
"""A file may state that something is its own part; nothing real is nested this deep."""

Parts = frozenset[tuple[int, int]]
"""Pairs of rows (part, whole)."""


def read_parts(file: Any, step_ids: Sequence[int]) -> Parts:
    """Part and whole of all pairs among elements with these ids in an IFC file; parts of parts are parts of the whole."""
    import ifcopenshell.util.element

    row = {step: n for n, step in enumerate(step_ids)}
    pairs = set()
    for step, part in row.items():
        whole = ifcopenshell.util.element.get_aggregate(file.by_id(step))
        for _ in range(DEEPEST):
            if whole is None or whole.id() == step:
                break
            if whole.id() in row:
                pairs.add((part, row[whole.id()]))
            whole = ifcopenshell.util.element.get_aggregate(whole)
    return frozenset(pairs)
