"""Planes of walls, floors and ceilings from their returns, once it is known how well the stations agree."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from shapely import Point, Polygon

from ..evidence.blocks import Blocks
from ..evidence.registration import FALLBACK_M, LEAST_FREEDOM, LEVER_M, Registration, estimate_agreement
from ..planes.cloud import Cloud
from ..planes.conformity import flatness
from ..planes.fit import Plane, fit_plane
from ..planes.noise import PointNoise
from ..planes.stations import Poses, face_blocks, levelled
from ..planes.unevenness import with_unevenness
from .building import FittedFace, RoomFace

Array = NDArray[np.float64]
Rows = NDArray[np.int64]

FIT_POINTS = 20_000
LEAST_FIT = 30
ON_FACE_M = 0.03
"""A side of a room this close to a face is the face's."""
MOST_STATIONS = 60
"""More are places along a path: one body, of which nothing but its own frame is known."""


@dataclass(frozen=True)
class FaceReturns:
    """Returns on one face: (N, 3) places, local frame, metres; rows of the cloud's stations."""

    points: Array
    station: Rows
    kind: str
    """Row of DIN 18202's table of flatness."""
    plane: Plane
    """Through them, turned to those who saw it."""


@dataclass(frozen=True)
class Survey:
    """The stations, what is known of a return's error, and of theirs."""

    stations: Array
    noise: PointNoise
    poses: Poses


def face_returns(cloud: Cloud, rows: Rows, kind: str, noise: PointNoise) -> FaceReturns:
    """Of the rows of a cloud, thinned where they are many."""
    rows = rows[:: max(1, len(rows) // FIT_POINTS)]
    points, station = cloud.points[rows].astype(np.float64), cloud.station[rows].astype(np.int64)
    return returns_on(points, station, cloud.stations, kind, noise)


def returns_on(points: Array, station: Rows, stations: Array, kind: str, noise: PointNoise) -> FaceReturns:
    """Of places (N, 3) and the rows of the stations (S, 3) that saw them."""
    plane = fit_plane(points, stations[station], noise).facing(stations[station[0]])
    return FaceReturns(points, station, kind, plane)


def fitted_face(face: FaceReturns, survey: Survey) -> FittedFace:
    """Its plane with all that is unknown of it, its unevenness and its tests of flatness."""
    seen_from = survey.stations[face.station]
    if len(survey.stations) > MOST_STATIONS:
        used, station = seen_from.mean(axis=0)[None], np.zeros(len(face.points), dtype=np.int64)
    else:
        rows, station = np.unique(face.station, return_inverse=True)
        used = survey.stations[rows]
    points, errors = levelled(face.plane, face.points, station, used, survey.poses)
    plane, bumps = with_unevenness(fit_plane(points, seen_from, survey.noise), points)
    plane = plane.replaced(covariance=plane.covariance + errors.of_plane(plane, points, station))
    tests = tuple(flatness(plane, points, face.kind, unit_errors=errors.unit_errors(points, station)))
    return FittedFace(plane.facing(seen_from[0]), bumps, tests)


def room_faces(
    outline: Polygon, walls: Iterable[list[tuple[FaceReturns, FittedFace]]], survey: Survey
) -> tuple[RoomFace, ...]:
    """What a room shows of each wall's faces: its own stretch of them."""
    out = []
    for k, faces in enumerate(walls):
        for returns, whole in faces:
            sides = sides_on(outline, returns.plane)
            if not len(sides):
                continue
            along = np.array([-returns.plane.normal[1], returns.plane.normal[0]])
            at, ends = returns.points[:, :2] @ along, np.sort(sides @ along, axis=1)
            own = ((at[:, None] > ends[:, 0]) & (at[:, None] < ends[:, 1])).any(axis=1)
            face = whole
            if own.sum() < LEAST_FIT:
                continue
            if not own.all():
                points, station = returns.points[own], returns.station[own]
                plane = fit_plane(points, survey.stations[station], survey.noise).facing(survey.stations[station[0]])
                face = fitted_face(FaceReturns(points, station, returns.kind, plane), survey)
            seen = returns.points[own, :2]
            first, last = seen[int(np.argmin(at[own]))], seen[int(np.argmax(at[own]))]
            out.append(RoomFace(k, face, (first, last)))
    return tuple(out)


def sides_on(outline: Polygon, plane: Plane) -> Array:
    """(K, 2, 2) ends of the sides of a room's outline that lie on the face, which looks into the room [m]."""
    sides = []
    for start, end in pairwise(np.array(outline.exterior.coords)):
        ends = np.column_stack([np.stack([start, end]), np.full(2, plane.centroid[2])])
        before = 0.5 * (start + end) + 2 * ON_FACE_M * plane.normal[:2]
        if np.abs(plane.distance(ends)).max() <= ON_FACE_M and outline.contains(Point(*before)):
            sides.append((start, end))
    return np.array(sides).reshape(-1, 2, 2)


def agreement(faces: Iterable[FaceReturns], stations: int, stated: float | None) -> Poses:
    """How far stations' poses are off: as ``stated`` [m], else from what several saw of the same faces.

    One station is right by itself. A stated position goes with a turn of as much over LEVER_M.
    """
    if stated is not None:
        return Poses(stated, stated / LEVER_M)
    if stations < 2:
        return Poses()
    shift = turn = Registration(FALLBACK_M, LEAST_FREEDOM)
    if stations <= MOST_STATIONS:
        shift, turn = estimate_agreement((_blocks(f) for f in faces), stations)
    # where few faces are shared, turns look like faults of the faces and their estimate goes to nothing
    sigma = shift.sigma * shift.widening
    return Poses(sigma, max(turn.sigma * turn.widening, sigma) / LEVER_M)


def _blocks(face: FaceReturns) -> Blocks:
    own = face_blocks(face.plane, face.points, face.station)
    return Blocks(
        own.residual, np.tile(face.plane.normal, (len(own.count), 1)), face.plane.centroid + own.at @ face.plane.axes,
        own.station, own.within / own.count, own.count, np.zeros(len(own.count), dtype=np.int64), own.cell,
    )
