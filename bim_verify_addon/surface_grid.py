"""The planned surface cut fine enough to carry what the scans say about it, and the samples' values on its vertices.

Arrays in, arrays out: nothing here knows Blender, so it may run in a worker thread.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..core.model.elements import BuildingModel
from ..core.model.samples import SurfaceSamples
from ..core.progress import Progress
from ..core.results import SampleEvidence, VerificationResult

VERTICES_PER_CELL = 4.5
"""Vertices that bisection leaves per square of the allowed edge (measured; the halves of a right triangle make 4)."""
VERTICES_ALONG = 6.0
"""The same per allowed edge along a triangle much narrower than it."""
COARSE_M = 0.25
"""A coarser grid hardly shows where on an element something is wrong; a note says that there is one."""
LEAST_STEP = 1.1
"""Of making edges longer, so that few rounds are needed."""
FEWEST_CELLS = 200
"""A small element gets at least about this many cells, so that its pattern is more than one colour."""
SIDES_APART_M = 5e-4
"""Shown distance of the two sides of a sheet without thickness; in one place, renderers would show neither."""
NEAREST = 4
"""Samples that a vertex is interpolated from."""
FACING_WEIGHT_M = 1.0
"""A sample whose normal differs by a unit vector counts as this much farther away: the other side never mixes in."""


@dataclass(frozen=True)
class SurfaceGrid:
    """Triangles of all elements, with vertices that belong to one facet each, so both sides of an edge may differ."""

    vertices: NDArray[np.float64]
    """(V, 3) metres, local frame of the model; grouped by element."""
    normal: NDArray[np.float64]
    """(V, 3) outward unit normals."""
    triangles: NDArray[np.int32]
    """(T, 3) rows of ``vertices``; grouped by element."""
    vertex_start: NDArray[np.int64]
    """(E + 1,)"""
    triangle_start: NDArray[np.int64]
    """(E + 1,)"""


@dataclass(frozen=True)
class GridValues:
    """Per vertex of a ``SurfaceGrid``."""

    occupied: NDArray[np.float32]
    empty: NDArray[np.float32]
    unknown: NDArray[np.float32]
    deviation: NDArray[np.float32]
    """Metres, signed along the outward normal; NaN where nothing was measured."""


@dataclass(frozen=True)
class Display:
    """The surfaces of a result, ready to be shown."""

    grid: SurfaceGrid
    values: GridValues
    note: str = ""
    """What a person should know of how it is shown."""


def make_display(result: VerificationResult, budget: int, progress: Progress | None = None) -> Display:
    """The grid for this result with at most ``budget`` vertices, and the samples' values on it."""
    progress = progress or Progress()
    progress.update(0.0, "Making the coloured surfaces")
    grid, edge = grid_within(result.model, result.options.sample_spacing, budget, progress.part(0.0, 0.3))
    values = interpolate(grid, result.samples, result.evidence, progress.part(0.3, 1.0))
    _follow_the_shift(result, grid, values)
    coarse = f"The colours of a surface are up to {edge.max():.1f} m apart: raise 'Result vertices' in the expert settings."
    shown = replace(grid, vertices=_sides_apart(result.model, grid))
    return Display(shown, values, coarse if edge.max() > COARSE_M else "")


def _follow_the_shift(result: VerificationResult, grid: SurfaceGrid, values: GridValues) -> None:
    """Where nothing was measured on an element that was found elsewhere, its deviation is that of its shift."""
    for row, verdict in enumerate(result.verdicts):
        if verdict.status == "DEVIATING" and verdict.significant and verdict.displacement_vector is not None:
            at = slice(grid.vertex_start[row], grid.vertex_start[row + 1])
            shift = (grid.normal[at] @ np.array(verdict.displacement_vector)).astype(np.float32)
            values.deviation[at] = np.where(np.isnan(values.deviation[at]), shift, values.deviation[at])


def grid_within(
    model: BuildingModel, spacing: float, budget: int, progress: Progress | None = None
) -> tuple[SurfaceGrid, NDArray[np.float64]]:
    """The grid with at most ``budget`` vertices, unless the model's own corners are more, and (E,) its edges [m]."""
    edge = edge_lengths(model, spacing, budget)
    while True:
        grid = build_grid(model, edge, progress)
        over = len(grid.vertices) / budget
        if over <= 1.0 or len(grid.triangles) == len(model.triangles):
            return grid, edge
        edge = edge * max(np.sqrt(over), LEAST_STEP)


def edge_lengths(model: BuildingModel, spacing: float, budget: int) -> NDArray[np.float64]:
    """(E,) longest allowed edge per element, metres: twice the sample spacing, or more to come near ``budget`` vertices.

    A small element has shorter edges, so that it still shows a pattern; down to a third of the common length.
    """
    corner = model.vertices[model.triangles]
    longest = np.sqrt(np.square(corner[:, (1, 2, 0)] - corner).sum(axis=2).max(axis=1))
    area = 0.5 * np.linalg.norm(_cross(model), axis=1)
    fine = np.sqrt(np.bincount(model.triangle_element, weights=area, minlength=len(model.elements)) / FEWEST_CELLS)
    common = 2.0 * spacing
    while True:
        edge = np.clip(fine, common / 3.0, common)
        own = edge[model.triangle_element]
        vertices = np.maximum(1.0, np.maximum(VERTICES_PER_CELL * area / own**2, VERTICES_ALONG * longest / own))
        if vertices.sum() <= budget or common >= longest.max():
            return edge
        common *= LEAST_STEP


def build_grid(model: BuildingModel, edge: NDArray[np.float64], progress: Progress | None = None) -> SurfaceGrid:
    """Bisect the longest edge of every triangle until none is longer than its element's ``edge`` ((E,), metres)."""
    progress = progress or Progress()
    vertices, normals, triangles = _split_by_facet(model)
    owner = model.triangle_element
    limit = np.square(edge)
    done_triangles, done_owner = [], []
    while len(triangles):
        progress.check()
        corner = vertices[triangles]
        length = np.square(corner[:, (1, 2, 0)] - corner).sum(axis=2)
        longest = length.argmax(axis=1)
        long = np.take_along_axis(length, longest[:, None], 1)[:, 0] > limit[owner]
        done_triangles.append(triangles[~long])
        done_owner.append(owner[~long])
        triangles, owner, longest = triangles[long], owner[long], longest[long]
        a, b, c = (np.take_along_axis(triangles, (longest[:, None] + k) % 3, 1)[:, 0] for k in range(3))
        pair = np.minimum(a, b) * np.int64(len(vertices)) + np.maximum(a, b)
        _, first, middle = np.unique(pair, return_index=True, return_inverse=True)
        m = middle + len(vertices)
        vertices = np.concatenate([vertices, 0.5 * (vertices[a[first]] + vertices[b[first]])])
        normals = np.concatenate([normals, normals[a[first]]])
        triangles = np.concatenate([np.stack([a, m, c], 1), np.stack([m, b, c], 1)])
        owner = np.concatenate([owner, owner])
    return _grouped(vertices, normals, np.concatenate(done_triangles), np.concatenate(done_owner), len(model.elements))


def interpolate(
    grid: SurfaceGrid, samples: SurfaceSamples, evidence: SampleEvidence, progress: Progress | None = None
) -> GridValues:
    """Carry the samples' values to the vertices, from the nearest samples of the same element that face the same way.

    The three beliefs of a vertex add up to one. A deviation is the mean over those neighbours that have one.
    """
    from scipy.spatial import cKDTree  # here: enabling the extension must not wait for it

    progress = progress or Progress()
    count = len(grid.vertices)
    belief = np.zeros((count, 3), dtype=np.float32)
    belief[:, 2] = 1.0
    deviation = np.full(count, np.nan, dtype=np.float32)
    known = np.stack([evidence.m_occ, evidence.m_emp, evidence.m_unk], axis=1)
    elements = len(grid.vertex_start) - 1
    sample_start = np.searchsorted(samples.element, np.arange(elements + 1))
    for e in range(elements):
        progress.update(e / elements, "Colouring the surface")
        at = slice(grid.vertex_start[e], grid.vertex_start[e + 1])
        of = slice(sample_start[e], sample_start[e + 1])
        if at.start == at.stop or of.start == of.stop:
            continue
        tree = cKDTree(np.hstack([samples.position[of], FACING_WEIGHT_M * samples.normal[of]]))
        k = min(NEAREST, of.stop - of.start)
        distance, nearest = tree.query(np.hstack([grid.vertices[at], FACING_WEIGHT_M * grid.normal[at]]), k=np.arange(1, k + 1))
        floor = 0.1 * np.sqrt(samples.area[of].mean())
        weight = 1.0 / (np.square(distance) + floor**2)
        belief[at] = np.einsum("vk,vkc->vc", weight / weight.sum(axis=1, keepdims=True), known[of][nearest])
        measured = evidence.deviation[of][nearest]
        weight = np.where(np.isfinite(measured), weight, 0.0)
        total = weight.sum(axis=1)
        has = total > 0
        deviation[at][has] = (weight * np.nan_to_num(measured)).sum(axis=1)[has] / total[has]
    return GridValues(belief[:, 0], belief[:, 1], belief[:, 2], deviation)


def second_sides(model: BuildingModel) -> NDArray[np.bool_]:
    """(T,) the triangle is the other side of one before it: an open sheet has both sides in the model."""
    _, place = np.unique(np.round(model.vertices * 1e5).astype(np.int64), axis=0, return_inverse=True)
    corners = np.sort(place.reshape(-1)[model.triangles], axis=1)
    key = np.column_stack([model.triangle_element, corners])
    _, first = np.unique(key, axis=0, return_index=True)
    second = np.ones(len(model.triangles), dtype=np.bool_)
    second[first] = False
    return second


def _sides_apart(model: BuildingModel, grid: SurfaceGrid) -> NDArray[np.float64]:
    sheet = np.zeros(len(model.elements))
    sheet[np.unique(model.triangle_element[second_sides(model)])] = 0.5 * SIDES_APART_M
    shift: NDArray[np.float64] = np.repeat(sheet, np.diff(grid.vertex_start))
    return grid.vertices + shift[:, None] * grid.normal


def _cross(model: BuildingModel) -> NDArray[np.float64]:
    corner = model.vertices[model.triangles]
    return np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])


def _split_by_facet(model: BuildingModel) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """Vertices welded by place (10 um) within an element's facet, and not across facets."""
    cross = _cross(model)
    length = np.linalg.norm(cross, axis=1, keepdims=True)
    normal = np.divide(cross, length, out=np.zeros_like(cross), where=length > 0)
    facet_key = np.column_stack([model.triangle_element, np.round(normal * 1000)]).astype(np.int64)
    _, facet = np.unique(facet_key, axis=0, return_inverse=True)
    _, place = np.unique(np.round(model.vertices * 1e5).astype(np.int64), axis=0, return_inverse=True)
    place = place.reshape(-1).astype(np.int64)
    key = facet.reshape(-1, 1).astype(np.int64) * (place.max() + 1) + place[model.triangles]
    _, first, corner = np.unique(key.reshape(-1), return_index=True, return_inverse=True)
    return model.vertices[model.triangles.reshape(-1)[first]], normal[first // 3], corner.reshape(-1, 3)


def _grouped(
    vertices: NDArray[np.float64],
    normals: NDArray[np.float64],
    triangles: NDArray[np.int64],
    owner: NDArray[np.int32],
    elements: int,
) -> SurfaceGrid:
    order = np.argsort(owner, kind="stable")
    triangles, owner = triangles[order], owner[order]
    vertex_owner = np.zeros(len(vertices), dtype=np.int32)
    vertex_owner[triangles.reshape(-1)] = np.repeat(owner, 3)
    order = np.argsort(vertex_owner, kind="stable")
    rank = np.empty(len(order), dtype=np.int64)
    rank[order] = np.arange(len(order))
    steps = np.arange(elements + 1)
    return SurfaceGrid(
        vertices=vertices[order],
        normal=normals[order],
        triangles=rank[triangles].astype(np.int32),
        vertex_start=np.searchsorted(vertex_owner[order], steps),
        triangle_start=np.searchsorted(owner, steps),
    )
