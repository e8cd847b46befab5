"""Which elements bear a visible edge, and how it moves when they stand off.

A free edge moves with its element. A line where two elements meet lies in a face of each: n1.a = n1.t1 and n2.a = n2.t2 give
its displacement a [m] across its direction from those of the elements, t1 and t2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Ints = NDArray[np.int64]
LEAST_TURN = math.radians(25.0)
"""Faces that meet at less have no line that is theirs; it is taken to go half with each element."""


@dataclass(frozen=True)
class EdgeBearers:
    """``element`` (N, 2) rows of the model's elements (twice the same: it alone bears the edge); ``carry`` (N, 2, 3, 3): the
    edge's displacement is the sum of ``carry`` times the displacement of each."""

    element: Ints
    carry: Vector

    def __len__(self) -> int:
        return len(self.element)

    def rows(self, chosen: NDArray[np.bool_] | Ints) -> EdgeBearers:
        """Only the chosen edges."""
        return EdgeBearers(self.element[chosen], self.carry[chosen])


def free_edges(element: Ints) -> EdgeBearers:
    """Edges that move with one element (N,) each."""
    half = np.tile(0.5 * np.eye(3), (len(element), 2, 1, 1))
    return EdgeBearers(np.column_stack([element, element]), half)


def meeting_of(element: Ints, normal: Vector) -> EdgeBearers:
    """Lines in which faces of two elements (N, 2) meet; ``normal`` (N, 2, 3) are theirs."""
    carry = np.tile(0.5 * np.eye(3), (len(element), 2, 1, 1))
    turned = np.abs(np.einsum("ni,ni->n", normal[:, 0], normal[:, 1])) < math.cos(LEAST_TURN)
    two = (element[:, 0] != element[:, 1]) & turned
    faces = normal[two]
    dual = np.linalg.pinv(faces)
    carry[two] = np.einsum("nik,nkj->nkij", dual, faces)
    return EdgeBearers(element, carry)


def together(parts: list[EdgeBearers]) -> EdgeBearers:
    """One after the other."""
    return EdgeBearers(np.concatenate([p.element for p in parts]), np.concatenate([p.carry for p in parts]))


def element_design(bearers: EdgeBearers, to_point: Vector) -> Vector:
    """(2N, 3 E) derivatives of distances with respect to the displacements of the E elements that bear the edges.

    ``to_point`` (2N, 3) are those with respect to the edge; two distances an edge.
    """
    known, number = np.unique(bearers.element, return_inverse=True)
    number = number.reshape(-1, 2).repeat(2, axis=0)
    part = np.einsum("ni,nkij->nkj", to_point, bearers.carry.repeat(2, axis=0))
    design = np.zeros((len(to_point), len(known), 3))
    rows = np.arange(len(to_point))
    for side in (0, 1):
        design[rows, number[:, side]] += part[:, side]
    return design.reshape(len(to_point), -1)
