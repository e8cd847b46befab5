"""How wide and how high the holes of walls are on the walls' faces: edges as a reconstruction finds them, at planned openings.

An edge is placed by each station on its own. What a station's pose is off by is common to both edges that it saw, so that it
leaves their distance as it is; where different stations saw them it counts.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..planes.cloud import Cloud
from ..planes.derived import Estimate
from ..reconstruction.crossings import Crossings, cross
from ..reconstruction.opening_edges import SIDES, EdgePlace, Returns, edge_near, gathered
from ..reconstruction.openings import Opening, face_raster, find_openings
from ..results import CAMERA_SENSOR, VerificationResult
from .opening_faces import Box, OpeningFace, PlannedHole, face_band

Array = NDArray[np.float64]

SAME_SHARE = 0.6
"""A hole is the planned one where they share this much of both their sides."""
LEAST_ON_FACE = 50
NEVER_A_DOOR_M = 10.0
"""What is above a floor so far below is no door: its sill is then looked for like the other edges."""


@dataclass(frozen=True)
class HoleOnFace:
    """Places on a wall's face [m] by the stations that saw them."""

    edges: dict[str, list[tuple[int, EdgePlace]]]
    """Name of the edge -> station and place; no entry where it was not seen."""
    pose_sigma: float
    """Of a station's position [m]."""

    def place(self, name: str) -> Estimate | None:
        """Of one edge; counts the pose."""
        own = self.edges.get(name, [])
        return None if not own else self._solved([(0, *edge) for edge in own], np.ones(1))

    def distance(self, first: str, second: str) -> Estimate | None:
        """From one edge to the other."""
        if first not in self.edges or second not in self.edges:
            return None
        seen = [(k, *edge) for k, name in enumerate((first, second)) for edge in self.edges[name]]
        return self._solved(seen, np.array([-1.0, 1.0]))

    def _solved(self, seen: list[tuple[int, int, EdgePlace]], wanted: Array) -> Estimate:
        edge, station = np.array([(k, s) for k, s, _ in seen]).T
        at, sigma = np.array([(e.at, e.sigma) for _, _, e in seen]).T
        covariance = np.diag(sigma**2) + self.pose_sigma**2 * (station[:, None] == station)
        weight = np.linalg.inv(covariance)
        design = np.eye(len(wanted))[edge]
        solved = np.linalg.inv(design.T @ weight @ design)
        found = solved @ design.T @ weight @ at
        off = at - design @ found
        freedom = len(at) - len(wanted)
        # stations that disagree by more than they should know less
        factor = max(1.0, float(off @ weight @ off) / freedom) if freedom else 1.0
        return Estimate(float(wanted @ found), float(np.sqrt(factor * wanted @ solved @ wanted)))


def scanner_rays(cloud: Cloud, result: VerificationResult) -> Cloud:
    """The cloud in the model's local frame, without what cameras saw: that is too sparse to show an edge."""
    shift = cloud.origin - result.model.origin
    scanned = np.array([s.sensor != CAMERA_SENSOR for s in result.stations], dtype=np.bool_)[cloud.station]
    points = (cloud.points[scanned] + shift).astype(np.float32)
    return Cloud(points, cloud.station[scanned], cloud.stations + shift, result.model.origin, cloud.total)


def hole_on_face(hole: PlannedHole, cloud: Cloud, sigma: float, pose_sigma: float) -> HoleOnFace | None:
    """The edges that were seen of a planned hole; None where no such hole was found.

    ``cloud`` is in the model's local frame, ``sigma`` that of a return [m].
    """
    band = face_band(sigma)
    sides = [side for face in hole.faces if (side := _side(face, cloud, band)) is not None]
    if not sides:
        return None
    u, z = ((min(f.reach[k] for f in hole.faces), max(f.reach[k + 1] for f in hole.faces)) for k in (0, 2))
    raster = face_raster(sides, u, z, band)
    found = _planned_one(
        find_openings(raster, sides, z[0] - NEVER_A_DOOR_M, hole.thickness, band, len(hole.faces) < 2), hole.box
    )
    if found is None:
        return None
    rays = gathered(sides, band)
    station = cloud.station[np.concatenate([s.row for s in sides])]
    box = found.u0, found.u1, found.z0, found.z1
    edges = {}
    for k, name in enumerate(SIDES):
        if name not in found.hidden and (own := _by_station(rays, station, k, box, raster.cell, hole.thickness, band)):
            edges[name] = own
    return HoleOnFace(edges, pose_sigma)


def _side(face: OpeningFace, cloud: Cloud, band: float) -> Crossings | None:
    """Rays at a face, moved to the middle of the returns on it."""
    u0, u1, z0, z1 = face.reach
    side = cross(cloud, face.normal, face.offset, face.along, (u0, u1), (z0, z1), band)
    on = side.on_face(band)
    if on.sum() < LEAST_ON_FACE:
        return None
    return replace(side, depth=side.depth - float(np.median(side.depth[on])))


def _planned_one(found: list[Opening], box: Box) -> Opening | None:
    """The only one of the openings that can be the planned one."""
    u0, u1, z0, z1 = box
    same = [
        o for o in found
        if min(o.u1, u1) - max(o.u0, u0) > SAME_SHARE * max(o.width, u1 - u0)
        and min(o.z1, z1) - max(o.z0, z0) > SAME_SHARE * max(o.height, z1 - z0)
    ]  # fmt: skip
    return same[0] if len(same) == 1 else None


def _by_station(
    rays: Returns, station: NDArray[np.int32], k: int, box: Box, cell: float, thickness: float, band: float
) -> list[tuple[int, EdgePlace]]:
    out = []
    for s in np.unique(station):
        place = edge_near(rays, station == s, k, box, cell, thickness, band)
        if place is not None:
            out.append((int(s), place))
    return out
