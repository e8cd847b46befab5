"""What a simulated scanner sees: triangles with owners, of a model as it was built, with things standing about."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ..model.elements import BuildingModel
from ..model.embree import triangle_scene
from .clip import cut_away

PANE_THICKEST_M = 0.03
PANE_SMALLEST_M = 0.2
PANE_FILLED_SHARE = 0.9
"""A separate part of a window or door is a pane when it is thinner than the first, wider and higher than the second,
and fills its rectangle to the third (a frame or a trim does not)."""
GLAZED_CLASSES = ("IfcWindow", "IfcDoor")
GLASS_RETURN_SHARE = 0.05
"""Share of the beams that dust on a pane sends back; a clean pane answers only where it is met head-on."""
GLASS_LOST_SHARE = 0.25
"""Share of the beams that a pane mirrors away or swallows; the others go through."""
GLASS_MIRROR_COS = math.cos(math.radians(2.0))
LOSSY_WINDOW_SHARE = 0.5
Glass = Literal["opaque", "lossy", "clear"]
"""How windows answer: like any other surface, like one that loses half of the beams, or with panes to look through."""
SURFACES_THROUGH_GLASS = 12
STEP_BEHIND_GLASS_M = 1e-4


@dataclass(frozen=True)
class Edit:
    """How one element was built: not at all, shifted by ``offset`` metres along the unit vector ``direction``, or without
    its part between two heights along it."""

    kind: Literal["shift", "remove", "cut"]
    offset: float = 0.0
    direction: tuple[float, float, float] = (0.0, 0.0, 0.0)
    removed: tuple[float, float] = (0.0, 0.0)
    """Of a cut: from and to, metres along ``direction`` in the model's local frame; infinite for an end."""

    @property
    def vector(self) -> NDArray[np.float64]:
        """(3,) metres."""
        return self.offset * np.array(self.direction)


@dataclass(frozen=True)
class Prop:
    """A thing that is not in the model. ``center``, ``size`` [m, model's local frame]; turned by ``yaw`` [rad]."""

    name: str
    kind: Literal["box", "person"]
    center: tuple[float, float, float]
    size: tuple[float, float, float]
    yaw: float = 0.0

    def corners(self) -> NDArray[np.float64]:
        """(T, 3, 3) triangles, outward."""
        half = np.array(self.size) / 2
        if self.kind == "box":
            parts = [_prism(4, -1.0, 1.0, math.sqrt(2.0), math.pi / 4)]
        else:
            parts = [
                _prism(10, -1.0, -0.1, 0.55),
                _prism(10, -0.1, 0.65, 0.95),
                _prism(10, 0.72, 1.0, 0.5),
            ]
        shape = np.concatenate(parts) * half
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        return shape @ turn.T + np.array(self.center)


@dataclass(frozen=True)
class Unevenness:
    """Smooth bumps of built surfaces: what no plan shows and what no shift explains."""

    amplitude: float
    """Standard deviation, metres."""
    wavelength: float
    """Metres."""
    seed: int

    def height(self, points: NDArray[np.float64], owner: NDArray[np.int64] | NDArray[np.int32]) -> NDArray[np.float64]:
        """(N,) metres towards the scanner at (N, 3) points; each owner has its own bumps."""
        waves = 6
        random = np.random.default_rng(self.seed)
        k = random.standard_normal((waves, 3))
        k *= 2 * math.pi / self.wavelength / np.linalg.norm(k, axis=1, keepdims=True)
        phase = (np.asarray(owner, dtype=np.float64)[:, None] + 1.0) * random.uniform(1.0, 50.0, waves)
        return self.amplitude * math.sqrt(2.0 / waves) * np.cos(points @ k.T + phase).sum(axis=1)


@dataclass(frozen=True)
class Cast:
    """First hits of rays."""

    distance: NDArray[np.float64]
    """(N,) metres; infinite where nothing is met."""
    triangle: NDArray[np.int64]
    """(N,) rows of the scene's triangles; -1 where nothing is met."""
    cos_incidence: NDArray[np.float64]
    """(N,) between ray and surface normal, 0..1."""


class Scene:
    """Triangles with owners, ready for ray casting.

    corners (T, 3, 3) [m]; owner (T,) rows of ``names``; reflectance (len(names),) 0..1; glass (T,) True on panes;
    lost_share (len(names),) of the beams that an owner sends nowhere near the scanner, 0..1.
    Any scene can be scanned, not only one made of a model.
    """

    def __init__(
        self,
        corners: NDArray[np.float64],
        owner: NDArray[np.int32],
        names: Sequence[str],
        *,
        reflectance: NDArray[np.float64] | None = None,
        glass: NDArray[np.bool_] | None = None,
        lost_share: NDArray[np.float64] | None = None,
        unevenness: Unevenness | None = None,
    ) -> None:
        if not len(corners):
            corners, owner = np.zeros((1, 3, 3)), np.zeros(1, np.int32)
            names = tuple(names) or ("nothing",)
        self.corners = np.asarray(corners, dtype=np.float64)
        self.owner = np.asarray(owner, dtype=np.int32)
        self.names = tuple(names)
        self.reflectance = np.full(len(self.names), 0.5) if reflectance is None else np.asarray(reflectance)
        self.glass = np.zeros(len(self.owner), dtype=np.bool_) if glass is None else glass
        self.pane_of_model: NDArray[np.bool_] | None = None
        """(T,) panes among the triangles of the model that the scene was built of, removed ones included."""
        self.lost_share = np.zeros(len(self.names)) if lost_share is None else lost_share
        self.unevenness = unevenness
        normal = np.cross(self.corners[:, 1] - self.corners[:, 0], self.corners[:, 2] - self.corners[:, 0])
        self.normal = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
        self._offset = np.einsum("ij,ij->i", self.normal, self.corners[:, 0])
        self._embree, self._mesh = triangle_scene(self.corners)

    def cast(self, origin: NDArray[np.float64], direction: NDArray[np.float64], reach: float = 1e4) -> Cast:
        """First hits of rays from (3,) or (N, 3) [m] along (N, 3) unit vectors.

        Embree finds the triangle in single precision; the distance to its plane is then worked out in double precision.
        """
        count = len(direction)
        if count == 0:
            return Cast(np.zeros(0), np.zeros(0, np.int64), np.zeros(0))
        start = np.broadcast_to(origin, (count, 3))
        found = self._embree.run(
            np.ascontiguousarray(start, dtype=np.float32),
            np.ascontiguousarray(direction, dtype=np.float32),
            dists=np.full(count, reach, dtype=np.float32),
            query="INTERSECT",
            output=True,
        )
        triangle = found["primID"].astype(np.int64)
        hit = triangle >= 0
        normal = self.normal[triangle]
        slope = np.einsum("ij,ij->i", normal, direction)
        with np.errstate(divide="ignore", invalid="ignore"):
            exact = (self._offset[triangle] - np.einsum("ij,ij->i", normal, start)) / slope
        rough = found["tfar"].astype(np.float64)
        exact = np.where(np.abs(exact - rough) < 1e-3 * (1.0 + rough), exact, rough)
        return Cast(np.where(hit, exact, np.inf), np.where(hit, triangle, -1), np.where(hit, np.abs(slope), 0.0))

    def pass_glass(
        self, origin: NDArray[np.float64], direction: NDArray[np.float64], seen: Cast, luck: NDArray[np.float64] | None
    ) -> Cast:
        """First hits that send light back: a ray's ``luck`` (0..1) says if panes return it, lose it or let it through.

        A pane met head-on returns it always. Without ``luck`` all panes are passed.
        """
        if not self.glass.any():
            return seen
        distance, triangle, cosine = seen.distance.copy(), seen.triangle.copy(), seen.cos_incidence.copy()
        at = np.flatnonzero(self._goes_through(triangle, cosine, luck))
        if luck is not None:
            lost = at[luck[at] < GLASS_RETURN_SHARE + GLASS_LOST_SHARE]
            distance[lost], triangle[lost], cosine[lost] = np.inf, -1, 0.0
            at = np.setdiff1d(at, lost, assume_unique=True)
        start = np.broadcast_to(origin, direction.shape)
        for _ in range(SURFACES_THROUGH_GLASS):
            if not len(at):
                break
            gone = distance[at] + STEP_BEHIND_GLASS_M
            further = self.cast(start[at] + gone[:, None] * direction[at], direction[at])
            distance[at] = gone + further.distance
            triangle[at] = further.triangle
            cosine[at] = further.cos_incidence
            at = at[self._goes_through(triangle[at], cosine[at], None if luck is None else luck[at])]
        return Cast(distance, triangle, cosine)

    def _goes_through(
        self, triangle: NDArray[np.int64], cosine: NDArray[np.float64], luck: NDArray[np.float64] | None
    ) -> NDArray[np.bool_]:
        pane = (triangle >= 0) & self.glass[triangle]
        if luck is None:
            return pane
        return pane & (luck >= GLASS_RETURN_SHARE) & (cosine < GLASS_MIRROR_COS)


def build_scene(
    model: BuildingModel,
    edits: Mapping[int, Edit] | None = None,
    props: Sequence[Prop] = (),
    *,
    seed: int = 0,
    glass: Glass = "opaque",
    unevenness: Unevenness | None = None,
) -> Scene:
    """The model as it was built: elements removed, shifted or cut by ``edits`` (row -> edit), ``props`` added. Local frame.

    Reflectances are drawn per owner. ``Scene.names`` are the GlobalIds, then the names of the props.
    """
    edits = edits or {}
    moved = np.zeros((len(model.elements), 3))
    kept = np.ones(len(model.elements), dtype=np.bool_)
    for row, edit in edits.items():
        if edit.kind == "shift":
            moved[row] = edit.vector
        else:
            kept[row] = False
    owner = model.triangle_element
    corners = model.vertices[model.triangles] + moved[owner][:, None, :]
    stays = kept[owner]
    pane = glass_triangles(model) if glass == "clear" else np.zeros(len(owner), dtype=np.bool_)
    parts, owners, panes = [corners[stays]], [owner[stays]], [pane[stays]]
    added = [
        (row, cut_away(corners[owner == row], np.array(edit.direction), *edit.removed))
        for row, edit in edits.items() if edit.kind == "cut"
    ]
    added += [(len(model.elements) + index, prop.corners()) for index, prop in enumerate(props)]
    for number, shape in added:
        parts.append(shape)
        owners.append(np.full(len(shape), number, dtype=np.int32))
        panes.append(np.zeros(len(shape), dtype=np.bool_))
    names = [*(e.global_id for e in model.elements), *(p.name for p in props)]
    reflectance = np.random.default_rng((seed, len(names))).uniform(0.25, 0.9, len(names))
    lost = np.zeros(len(names))
    if glass == "lossy":
        lost[: len(model.elements)] = [LOSSY_WINDOW_SHARE * (e.ifc_class == "IfcWindow") for e in model.elements]
    scene = Scene(
        np.concatenate(parts), np.concatenate(owners), names,
        reflectance=reflectance, glass=np.concatenate(panes), lost_share=lost, unevenness=unevenness,
    )
    scene.pane_of_model = pane
    return scene


def thinnest_axis(corners: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """The face normal along which a body is thinnest, and its thickness [m].

    corners (T, 3, 3). The axis' largest component is positive. Only normals of the largest faces are looked at.
    """
    axes, _ = _face_normals(corners)
    along = corners.reshape(-1, 3) @ axes.T
    extent = along.max(axis=0) - along.min(axis=0)
    thinnest = int(np.argmin(np.round(extent, 6)))
    return axes[thinnest], float(extent[thinnest])


def face_axes(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """(K, 3) directions of a body's main faces, K = 1 ... 3, more than 45 degrees from each other, largest faces first.

    corners (T, 3, 3). A direction counts with at least a hundredth of the surface; the largest component is positive.
    """
    axes, area = _face_normals(corners)
    chosen: list[NDArray[np.float64]] = []
    for axis in axes[area >= 0.01 * area.sum()]:
        if len(chosen) < 3 and all(abs(float(axis @ other)) < math.sqrt(0.5) for other in chosen):
            chosen.append(axis)
    return np.array(chosen or axes[:1])


def _face_normals(corners: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Unit normals (K, 3) of up to 100 face directions, opposite ones taken as one, and their areas (K,), largest first."""
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(cross, axis=1)
    normal = cross / np.maximum(area[:, None], 1e-30)
    strongest = np.take_along_axis(normal, np.argmax(np.abs(normal), axis=1)[:, None], axis=1)
    normal = normal * np.where(strongest < 0, -1.0, 1.0)
    rounded = np.round(normal, 3) + 0.0
    inverse = np.unique(rounded, axis=0, return_inverse=True)[1].ravel()
    total = np.bincount(inverse, weights=area)
    largest = np.argsort(-total, kind="stable")[:100]
    first = np.array([np.flatnonzero(inverse == i)[np.argmax(area[inverse == i])] for i in largest])
    return normal[first], 0.5 * total[largest]


def glass_triangles(model: BuildingModel) -> NDArray[np.bool_]:
    """(T,) True on panes: separate thin and wide parts of windows and doors (see PANE_THICKEST_M)."""
    pane = np.zeros(len(model.triangles), dtype=np.bool_)
    start = model.triangle_start
    for row, element in enumerate(model.elements):
        if element.ifc_class not in GLAZED_CLASSES:
            continue
        part = slice(start[row], start[row + 1])
        shell = _shells(model.vertices, model.triangles[part])
        for index in range(shell.max(initial=-1) + 1):
            mine = np.flatnonzero(shell == index)
            corners = model.vertices[model.triangles[part][mine]]
            axis, thickness = thinnest_axis(corners)
            level = np.linalg.norm(np.cross(axis, [0.0, 0.0, 1.0]))
            across = np.cross(axis, [0.0, 0.0, 1.0] if level > 0.1 else [1.0, 0.0, 0.0])
            across /= np.linalg.norm(across)
            sides = np.ptp(corners.reshape(-1, 3) @ np.stack([across, np.cross(axis, across)], axis=1), axis=0)
            double_area = np.abs(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) @ axis).sum()
            filled = double_area / 4 / max(sides.prod(), 1e-12)
            if thickness < PANE_THICKEST_M and sides.min() > PANE_SMALLEST_M and filled > PANE_FILLED_SHARE:
                pane[part.start + mine] = True
    return pane


def _shells(vertices: NDArray[np.float64], triangles: NDArray[np.int32]) -> NDArray[np.int64]:
    """(T,) number of the connected part that each triangle belongs to; equal positions count as connected."""
    used, corner = np.unique(triangles, return_inverse=True)
    _, same = np.unique(np.round(vertices[used], 5), axis=0, return_inverse=True)
    corner = same.ravel()[corner.reshape(-1, 3)]
    edges = np.concatenate([corner[:, [0, 1]], corner[:, [1, 2]]])
    size = int(corner.max(initial=-1)) + 1
    graph = coo_array((np.ones(len(edges), dtype=np.int8), (edges[:, 0], edges[:, 1])), shape=(size, size))
    label = connected_components(graph, directed=False)[1][corner[:, 0]]
    return np.unique(label, return_inverse=True)[1].ravel().astype(np.int64)


def _prism(sides: int, bottom: float, top: float, radius: float, turn: float = 0.0) -> NDArray[np.float64]:
    """(T, 3, 3) an upright prism about the z axis, outward."""
    angle = turn + 2 * math.pi * np.arange(sides) / sides
    ring = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    low = np.column_stack([ring, np.full(sides, bottom)])
    high = np.column_stack([ring, np.full(sides, top)])
    after = np.roll(np.arange(sides), -1)
    ends = [np.array([0.0, 0.0, bottom]), np.array([0.0, 0.0, top])]
    return np.concatenate([
        np.stack([low, low[after], high[after]], axis=1),
        np.stack([low, high[after], high], axis=1),
        np.stack([low[after], low, np.broadcast_to(ends[0], low.shape)], axis=1),
        np.stack([high, high[after], np.broadcast_to(ends[1], high.shape)], axis=1),
    ])
