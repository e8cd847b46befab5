"""Flat faces of elements: what a modeller draws, and the size of what has to be drawn."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..model.elements import BuildingModel

Array = NDArray[np.float64]
NORMAL_STEPS = 20.0
"""Normals that agree to about 3 degrees, and planes to the next, belong to one face."""
OFFSET_STEP_M = 0.02


@dataclass(frozen=True)
class Face:
    """One flat face of an element, as a rectangle around it. Metres, local frame."""

    element: int
    corner: Array
    """(3,) lowest corner in the face's own axes."""
    axes: Array
    """(3, 3) rows: along the width, along the height, outward normal."""
    width: float
    height: float
    filled: float
    """Share of the rectangle that is face: 1 for a plain wall, less with openings or another outline."""


def number_faces(model: BuildingModel) -> NDArray[np.int64]:
    """(T,) number of the flat face that each triangle belongs to; faces of different elements differ."""
    corner = model.vertices[model.triangles]
    cross = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    normal = cross / np.maximum(np.linalg.norm(cross, axis=1, keepdims=True), 1e-30)
    offset = np.einsum("ij,ij->i", normal, corner.mean(axis=1))
    key = np.column_stack([
        model.triangle_element, np.round(normal * NORMAL_STEPS), np.round(offset / OFFSET_STEP_M)
    ]).astype(np.int64)
    return np.unique(key, axis=0, return_inverse=True)[1].ravel().astype(np.int64)


def face_rectangle(model: BuildingModel, triangles: NDArray[np.int64]) -> Face:
    """The rectangle around a face given by its triangles' rows; it is upright where the face is.

    On a level face it lies along the direction in which its outline is longest.
    """
    corner = model.vertices[model.triangles[triangles]]
    cross = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    area = 0.5 * np.linalg.norm(cross, axis=1)
    normal = cross.sum(axis=0)
    normal /= max(float(np.linalg.norm(normal)), 1e-30)
    if abs(normal[2]) < 0.95:
        across = np.cross([0.0, 0.0, 1.0], normal)
    else:
        edges = (np.roll(corner, -1, axis=1) - corner).reshape(-1, 3)
        across = edges[np.argmax(np.linalg.norm(edges, axis=1))]
        across = across - (across @ normal) * normal
    across /= max(float(np.linalg.norm(across)), 1e-30)
    axes = np.stack([across, np.cross(normal, across), normal])
    place = corner.reshape(-1, 3) @ axes.T
    low, high = place.min(axis=0), place.max(axis=0)
    level = float(np.average(corner.mean(axis=1) @ normal, weights=np.maximum(area, 1e-12)))
    start = axes.T @ np.array([low[0], low[1], level])
    width, height = float(high[0] - low[0]), float(high[1] - low[1])
    return Face(
        int(model.triangle_element[triangles[0]]), start, axes, width, height,
        float(area.sum() / max(width * height, 1e-12)),
    )


def main_faces(
    model: BuildingModel, face: NDArray[np.int64], weight: Array
) -> list[Face | None]:
    """Per element its face with the most ``weight`` (T,) (an area per triangle, say the seen one); None without any."""
    total = np.bincount(face, weights=weight)
    owner = np.zeros(len(total), np.int64)
    owner[face] = model.triangle_element
    order = np.argsort(face, kind="stable")
    start = np.searchsorted(face[order], np.arange(len(total) + 1))
    best: list[Face | None] = [None] * len(model.elements)
    chosen = np.full(len(model.elements), -1, np.int64)
    for number in np.argsort(total, kind="stable"):
        if total[number] > 0:
            chosen[owner[number]] = number
    for element, number in enumerate(chosen):
        if number >= 0:
            best[element] = face_rectangle(model, order[start[number] : start[number + 1]])
    return best
