"""Which parts of a model's edges a camera sees: hidden lines removed by rays on both sides of each edge."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..model.elements import BuildingModel
from ..model.raycast import RayScene
from .camera import Camera
from .edge_bearers import EdgeBearers, free_edges, meeting_of, together
from .meeting_edges import MeetingEdges
from .model_edges import ModelEdges

Vector = NDArray[np.float64]
NEAREST_M = 0.15
SPACING_PX = 4.0
MOST_SAMPLES = 256
ASIDE_PX = 3.0
ON_PLANE_M = 1.5e-3
SAME_NORMAL = 0.999
SHORTEST_PX = 25.0
BRIDGE = 3
"""So many hidden samples in a row do not end a visible part: something thin stands in front."""


@dataclass(frozen=True)
class VisibleEdges:
    """Visible parts of edges; ``line`` (N,) tells the model edges apart that they are parts of."""

    start: Vector
    """(N, 3) metres, local frame"""
    end: Vector
    bearers: EdgeBearers
    line: NDArray[np.int64]
    pixel: Vector
    """(N, 4) both ends in ideal pixels at the pose they were looked at from."""

    def __len__(self) -> int:
        return len(self.start)

    def rows(self, chosen: NDArray[np.int64]) -> VisibleEdges:
        """Only the chosen parts."""
        return VisibleEdges(
            self.start[chosen], self.end[chosen], self.bearers.rows(chosen), self.line[chosen], self.pixel[chosen]
        )

    @property
    def length_px(self) -> Vector:
        """(N,)"""
        return np.asarray(np.hypot(self.pixel[:, 2] - self.pixel[:, 0], self.pixel[:, 3] - self.pixel[:, 1]))


class EdgeViewer:
    """A model's edges and surfaces, to be looked at from any pose."""

    def __init__(self, model: BuildingModel, edges: ModelEdges, scene: RayScene | None = None) -> None:
        self.edges, self.scene = edges, scene or RayScene(model)
        self._corner = model.vertices[model.triangles[:, 0]]
        self._meeting = MeetingEdges(model, self.scene)
        self._kind = np.unique([e.ifc_class for e in model.elements], return_inverse=True)[1].ravel()

    def look(self, camera: Camera, margin: float = 0.0) -> VisibleEdges:
        """The parts seen by ``camera``, up to ``margin`` [px] outside its image, at least 25 pixels long."""
        edges = self.edges
        row, t0, t1 = self._in_view(camera, margin)
        a, b = edges.start[row], edges.end[row]
        ends = np.stack([a + t0[:, None] * (b - a), a + t1[:, None] * (b - a)], axis=1)
        pixel = np.stack([camera.project(ends[:, 0]), camera.project(ends[:, 1])], axis=1)
        size = np.linalg.norm(pixel[:, 1] - pixel[:, 0], axis=1)
        long_enough = size >= SHORTEST_PX
        row, ends, pixel, size = row[long_enough], ends[long_enough], pixel[long_enough], size[long_enough]
        count = np.clip((size / SPACING_PX).astype(np.int64), 5, MOST_SAMPLES)
        first = np.concatenate([[0], np.cumsum(count)])
        of = np.repeat(np.arange(len(row)), count)
        share = ((np.arange(first[-1]) - first[of]) + 0.5) / count[of]
        # even steps in the image are uneven ones along the edge
        depth = np.stack([camera.in_camera(ends[:, k])[:, 2] for k in (0, 1)], axis=1)[of]
        along = share * depth[:, 0] / (share * depth[:, 0] + (1.0 - share) * depth[:, 1])
        place = ends[of, 0] + along[:, None] * (ends[of, 1] - ends[of, 0])
        at = pixel[of, 0] + share[:, None] * (pixel[of, 1] - pixel[of, 0])
        aside = ((pixel[:, 1] - pixel[:, 0]) / size[:, None])[of][:, ::-1] * [-ASIDE_PX, ASIDE_PX]
        seen, beside, normal = self._seen(camera, place, at, aside)
        parts = _parts(seen, first)
        out_row, out_start, out_end, out_pixel, sample = [], [], [], [], []
        for k, low, high in parts:
            if (high - low) * size[k] / count[k] < SHORTEST_PX:
                continue
            i, j = first[k] + low, first[k] + high - 1
            out_row.append(k)
            out_start.append(place[i])
            out_end.append(place[j])
            out_pixel.append(np.concatenate([at[i], at[j]]))
            sample.append(_most_common(beside, np.arange(i, j + 1)[seen[i : j + 1]]))
        chosen = np.array(out_row, dtype=np.int64)
        begin, finish = np.array(out_start).reshape(-1, 3), np.array(out_end).reshape(-1, 3)
        more_begin, more_end, more_bearers = self._meeting.look(camera, (begin, finish), margin)
        more_pixel = np.column_stack([camera.project(more_begin), camera.project(more_end)])
        size = np.hypot(more_pixel[:, 2] - more_pixel[:, 0], more_pixel[:, 3] - more_pixel[:, 1])
        good = np.flatnonzero(size >= SHORTEST_PX)
        return VisibleEdges(
            np.concatenate([begin, more_begin[good]]), np.concatenate([finish, more_end[good]]),
            together([self._bearers(beside[sample], normal[sample], row[chosen]), more_bearers.rows(good)]),
            np.concatenate([row[chosen], len(edges) + good]),
            np.concatenate([np.array(out_pixel).reshape(-1, 4), more_pixel[good]]),
        )

    def _in_view(self, camera: Camera, margin: float) -> tuple[NDArray[np.int64], Vector, Vector]:
        """Edges that cross the view's pyramid, and the part of each inside it (shares of its length)."""
        inside = camera.interior
        a, b = camera.in_camera(self.edges.start), camera.in_camera(self.edges.end)
        low, high = inside.ideal_frame + np.array([[-margin], [margin]])
        left, top = (low - [inside.cx, inside.cy]) / [inside.fx, inside.fy]
        right, bottom = (high - [inside.cx, inside.cy]) / [inside.fx, inside.fy]
        planes = np.array([[1, 0, -left], [-1, 0, right], [0, 1, -top], [0, -1, bottom], [0, 0, 1]], dtype=np.float64)
        level = np.array([0.0, 0.0, 0.0, 0.0, NEAREST_M])
        t0, t1 = np.zeros(len(a)), np.ones(len(a))
        for plane, least in zip(planes, level, strict=True):
            va, vb = a @ plane - least, b @ plane - least
            with np.errstate(divide="ignore", invalid="ignore"):
                cut = va / (va - vb)
            t0 = np.where((va < 0) & (vb >= 0), np.maximum(t0, cut), t0)
            t1 = np.where((va >= 0) & (vb < 0), np.minimum(t1, cut), t1)
            t1 = np.where((va < 0) & (vb < 0), -1.0, t1)
        row = np.flatnonzero(t1 > t0)
        return row, t0[row], t1[row]

    def _seen(
        self, camera: Camera, place: Vector, at: Vector, aside: Vector
    ) -> tuple[NDArray[np.bool_], NDArray[np.int64], Vector]:
        """Whether one of the surfaces beside each place (S,) is the edge's own, and the two are not one plane of one kind of
        element (a rafter flush with the roof shows, a wall flush with a wall does not); the elements of these surfaces
        (S, 2), -1 for one that does not reach the edge, and their normals (S, 2, 3)."""
        inside = camera.interior
        beside, normals = [], []
        for sign in (1.0, -1.0):
            pixel = at + sign * aside
            ray = np.column_stack([(pixel - [inside.cx, inside.cy]) / [inside.fx, inside.fy], np.ones(len(pixel))])
            ray = ray @ camera.rotation
            ray /= np.linalg.norm(ray, axis=1, keepdims=True)
            reach, triangle = self.scene.first_hit(np.repeat(camera.position[None], len(ray), 0), ray)
            known = triangle >= 0
            normal = np.where(known[:, None], self.scene.normal[triangle], 0.0)
            off = np.abs(np.einsum("ni,ni->n", normal, place - self._corner[triangle]))
            hit = camera.position + ray * np.where(known, reach, 0.0)[:, None]
            distance = np.linalg.norm(place - camera.position, axis=1)
            near = np.linalg.norm(hit - place, axis=1) < 12.0 * ASIDE_PX / inside.fx * distance + 0.01
            beside.append(np.where(known & (off < ON_PLANE_M) & near, self.scene.element[triangle], -1))
            normals.append(normal)
        element, normal = np.stack(beside, axis=1).astype(np.int64), np.stack(normals, axis=1)
        joint = (element >= 0).all(axis=1) & _flat(normal) & (self._kind[element[:, 0]] == self._kind[element[:, 1]])
        return (element >= 0).any(axis=1) & ~joint, element, normal

    def _bearers(self, beside: NDArray[np.int64], normal: Vector, edge: NDArray[np.int64]) -> EdgeBearers:
        """Of edges (N,) with the elements ``beside`` (N, 2) them, -1 for none; a joint in a plane moves with its owner."""
        two, flat = (beside >= 0).all(axis=1), _flat(normal)
        owned = np.column_stack([self.edges.owned(edge, beside[:, k]) for k in (0, 1)])
        owner = np.where(owned[:, 0], beside[:, 0], beside[:, 1])
        found = free_edges(np.where(two & flat, owner, beside.max(axis=1, initial=-1)))
        two &= ~flat
        meeting = meeting_of(beside[two], normal[two], edge[two], owned[two])
        for name, value in vars(meeting).items():
            getattr(found, name)[two] = value
        return found


def _flat(normal: Vector) -> NDArray[np.bool_]:
    """Whether two faces with the normals (N, 2, 3) lie in one plane, where they meet at all."""
    return np.asarray(np.abs(np.einsum("ni,ni->n", normal[:, 0], normal[:, 1])) > SAME_NORMAL)


def _most_common(beside: NDArray[np.int64], samples: NDArray[np.int64]) -> int:
    """The first of the ``samples`` that has what most of them have beside them."""
    _, first, count = np.unique(beside[samples], axis=0, return_index=True, return_counts=True)
    return int(samples[first[count.argmax()]])


def _parts(seen: NDArray[np.bool_], first: NDArray[np.int64]) -> list[tuple[int, int, int]]:
    """(edge, first sample, last sample + 1) of every run of seen samples; short gaps are bridged."""
    out = []
    for k in range(len(first) - 1):
        rows = np.flatnonzero(seen[first[k] : first[k + 1]])
        if len(rows) < 2:
            continue
        breaks = np.flatnonzero(np.diff(rows) > BRIDGE + 1)
        for i, j in zip(np.concatenate([[0], breaks + 1]), np.concatenate([breaks, [len(rows) - 1]]), strict=True):
            out.append((k, int(rows[i]), int(rows[j]) + 1))
    return out
