"""Which elements bear a visible edge, and how it moves when they stand off.

A free edge moves with its element. A line where two elements cut through each other lies in a face of each: n1.a = n1.t1 and
n2.a = n2.t2 give its displacement a [m] across its direction from those of the elements, t1 and t2.

Where an element ends at the face of another (a post on a floor), what shows depends on how they were built: that face, if the
element reaches into it, or the element's own edge before a gap. Of two independent displacements the larger counts then; it is
half of each, and what is left is as uncertain as either half and belongs to this edge, in all images that show it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Ints = NDArray[np.int64]
LEFT = 0.5
"""Mean square of max(x, y) - (x + y) / 2 for two independent numbers of variance one: 1 / 2."""
LEAST_TURN = math.radians(25.0)
"""Faces that meet at less have no line that is theirs; it is taken to go half with each element."""


@dataclass(frozen=True)
class EdgeBearers:
    """``element`` (N, 2) rows of the model's elements (twice the same: it alone bears the edge); ``carry`` (N, 2, 3, 3): the
    edge's displacement is the sum of ``carry`` times the displacement of each, and of ``own`` (N, 3, 3) times one that only
    the model's ``edge`` (N,) has."""

    element: Ints
    carry: Vector
    edge: Ints
    own: Vector

    def __len__(self) -> int:
        return len(self.element)

    def rows(self, chosen: NDArray[np.bool_] | Ints) -> EdgeBearers:
        """Only the chosen edges."""
        return EdgeBearers(self.element[chosen], self.carry[chosen], self.edge[chosen], self.own[chosen])


def free_edges(element: Ints) -> EdgeBearers:
    """Edges that move with one element (N,) each."""
    half = np.tile(0.5 * np.eye(3), (len(element), 2, 1, 1))
    return EdgeBearers(np.column_stack([element, element]), half, np.full(len(element), -1), np.zeros((len(element), 3, 3)))


def meeting_of(
    element: Ints, normal: Vector, edge: Ints | None = None, ends: NDArray[np.bool_] | None = None
) -> EdgeBearers:
    """Lines in which faces of two elements (N, 2) meet; ``normal`` (N, 2, 3) are theirs.

    ``ends`` (N, 2) are the elements that end there, with an ``edge`` (N,) of their own; without it both go on.
    """
    count = len(element)
    edge = np.full(count, -1) if edge is None else edge
    ends = np.zeros((count, 2), np.bool_) if ends is None else ends
    carry, own = np.tile(0.5 * np.eye(3), (count, 2, 1, 1)), np.zeros((count, 3, 3))
    turned = np.abs(np.einsum("ni,ni->n", normal[:, 0], normal[:, 1])) < math.cos(LEAST_TURN)
    two = (element[:, 0] != element[:, 1]) & turned
    faces = normal[two]
    along = np.einsum("nik,nkj->nkij", np.linalg.pinv(faces), faces)
    other = 0.5 * ends[two][:, ::-1, None, None] * along
    carry[two] = along - other + other[:, ::-1]
    own[two] = 2.0 * math.sqrt(LEFT) * other.sum(axis=1)
    return EdgeBearers(element, carry, edge, own)


def together(parts: list[EdgeBearers]) -> EdgeBearers:
    """One after the other."""
    return EdgeBearers(*(np.concatenate([getattr(p, name) for p in parts]) for name in EdgeBearers.__dataclass_fields__))


def element_design(bearers: EdgeBearers, to_point: Vector) -> Vector:
    """(2N, 3 B) derivatives of distances with respect to the displacements of the B elements, and edges, that bear them.

    ``to_point`` (2N, 3) are those with respect to the edge; two distances an edge.
    """
    first = int(bearers.element.max(initial=0)) + 1
    apart = bearers.own.any(axis=(1, 2))
    bearer = np.column_stack([bearers.element, np.where(apart, first + bearers.edge, bearers.element[:, 0])])
    known, number = np.unique(bearer, return_inverse=True)
    number = number.reshape(-1, 3).repeat(2, axis=0)
    carry = np.concatenate([bearers.carry, bearers.own[:, None]], axis=1)
    part = np.einsum("ni,nkij->nkj", to_point, carry.repeat(2, axis=0))
    design = np.zeros((len(to_point), len(known), 3))
    rows = np.arange(len(to_point))
    for bearer_of in range(3):
        design[rows, number[:, bearer_of]] += part[:, bearer_of]
    return design.reshape(len(to_point), -1)
