"""A column's faces from the returns about it: where they are, how it is turned, how thick it is, and what is hidden."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from shapely import Point, Polygon

from ..planes.fit import Plane

Array = NDArray[np.float64]
Rows = NDArray[np.int64]
FitFace = Callable[[Rows], Plane]
"""The plane through some of the returns."""

SIDES = ("left", "right", "front", "back")
"""Of a column: low and high end along its first direction (at ``turn``), then along the one left of it."""
WIDEST_M = 1.3
NARROWEST_M = 0.08
TURN_STEP = np.radians(0.5)
BIN_M = 0.004
THIN_M = (0.02, 0.02, 0.05)
"""One return of each such cell is used to find the sides, so that no side counts more for being near a scanner."""
EDGE_M = 0.02
"""Returns this close to a corner are mixed with those of the next face."""
LEAST_FACE = 40
LEAST_WIDTH = 0.4
"""A face is seen where its returns reach over this share of its width."""
LEAST_ON = 0.6
"""Less of the returns on the outline found: no column."""
SAME_RAY = 2e-4
"""Rays closer together than this are in one line of the scan [rad]."""


@dataclass(frozen=True)
class ColumnShape:
    """A column in plan."""

    footprint: Polygon
    radius: float
    """Above 0: a circle about the footprint's middle, metres."""
    residual_mean: float
    """Mean absolute distance of its returns from its faces [m]."""
    residual_sigma: float
    """Their standard deviation [m]."""
    seen: float
    """Share of its outline that was seen, 0..1."""
    position_sigma: float
    """Standard deviation of its middle, in the direction that is known worse [m]."""
    hidden: tuple[str, ...]
    """Sides that no scanner saw (``SIDES``): their place follows from where the faces beside them end."""
    on: float
    """Share of the returns about it that lie on its outline."""
    returns: int


@dataclass(frozen=True)
class _Side:
    """One of four: place along its axis and standard deviation [m]; its plane where it was seen."""

    place: float
    sigma: float
    plane: Plane | None = None


def fit_column(
    points: Array, stations: Array, band: float, fit: FitFace, pose_sigma: float = 0.0
) -> ColumnShape | None:
    """A rectangle or circle through (N, 3) returns, each seen from its row of (N, 3) ``stations``; None if neither is there.

    Returns belong to a face within ``band`` of it. ``fit`` is given rows of ``points``; its planes count the stations' poses,
    whose ``pose_sigma`` [m] is for sides that were not seen.
    """
    thin = _thinned(points)
    if len(thin) < LEAST_FACE:
        return None
    square = _rectangle(points, stations, thin, band, fit, pose_sigma)
    circle = _circle(points, band)
    if square is None or (circle is not None and circle.on > square.on):
        square = circle
    return square if square is not None and square.on >= LEAST_ON else None


def _thinned(points: Array) -> Rows:
    cell = np.floor((points - points.min(axis=0)) / THIN_M).astype(np.int64)
    key = (cell[:, 0] * 4096 + cell[:, 1]) * 4096 + cell[:, 2]
    return np.unique(key, return_index=True)[1].astype(np.int64)


def _axes(turn: float) -> Array:
    return np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])


def _turn(xy: Array) -> float:
    """The turn in which the places fall into the sharpest lines along two directions at right angles."""

    def sharpness(turn: float) -> float:
        total = 0.0
        for at in (xy @ _axes(turn).T).T:
            count = np.bincount(((at - at.min()) / BIN_M).astype(np.int64))
            total += float((np.convolve(count, (1.0, 2.0, 1.0)) ** 2).sum())
        return total

    turns = np.arange(0.0, np.pi / 2, TURN_STEP)
    return float(turns[int(np.argmax([sharpness(float(t)) for t in turns]))])


def _rectangle(
    points: Array, stations: Array, thin: Rows, band: float, fit: FitFace, pose_sigma: float
) -> ColumnShape | None:
    turn = _turn(points[thin, :2])
    planes: list[Plane | None] = [None] * 4
    for _ in range(3):
        places = _places(points[thin, :2] @ _axes(turn).T, (stations - points)[thin, :2] @ _axes(turn).T, band)
        planes = _planes(points, stations, turn, places, band, fit)
        known = [(k, p) for k, p in enumerate(planes) if p is not None]
        if not known:
            return None
        turn = _common_turn(turn, known)
    if all(p is None for p in planes[:2]) or all(p is None for p in planes[2:]):
        return None  # one face, or two that face each other, are a board
    axes = _axes(turn)
    at = points[:, :2] @ axes.T
    sides = [_Side(float(axes[k // 2] @ p.centroid[:2]), p.position_sigma, p) if p else None for k, p in enumerate(planes)]
    ends = [s if s is not None else _end(k, points, stations, axes, sides, band) for k, s in enumerate(sides)]
    if any(e is None for e in ends):
        return None
    low_x, high_x, low_y, high_y = (e for e in ends if e is not None)
    size = np.array([high_x.place - low_x.place, high_y.place - low_y.place])
    if size.max() > WIDEST_M or size.min() < NARROWEST_M:
        return None
    corners = np.array([
        [x.place, y.place] for x, y in ((low_x, low_y), (high_x, low_y), (high_x, high_y), (low_x, high_y))
    ])  # fmt: skip
    off = _from_outline(at, corners[0], corners[2])
    found = [p for p in planes if p is not None]
    counts = np.array([p.count for p in found], dtype=np.float64)
    mean = float(counts @ [p.residual_mean for p in found] / counts.sum())
    sigma = float(np.sqrt(counts @ np.square([p.residual_sigma for p in found]) / counts.sum()))
    middle = max(np.hypot(low_x.sigma, high_x.sigma), np.hypot(low_y.sigma, high_y.sigma)) / 2
    hidden = tuple(name for name, p in zip(SIDES, planes, strict=True) if p is None)
    if hidden:  # the station that saw the side opposite may have placed them as well, and its error is then that of both
        middle = np.hypot(middle, pose_sigma)
    width = np.repeat(size[::-1], 2)
    seen = float(sum(w for w, p in zip(width, planes, strict=True) if p is not None) / width.sum())
    return ColumnShape(
        Polygon(corners @ axes), 0.0, mean, sigma, seen, float(middle), hidden,
        float((np.abs(off[thin]) < 2 * band).mean()), int(counts.sum()),
    )


def _places(at: Array, towards: Array, band: float) -> list[float | None]:
    """Where most returns of each of four sides lie along its axis: those that were seen from there."""
    out: list[float | None] = []
    for k in range(4):
        axis, sign = k // 2, (-1.0, 1.0)[k % 2]
        own = np.sort(at[sign * towards[:, axis] > 0.0, axis])
        if len(own) < LEAST_FACE / 4:
            out.append(None)
            continue
        count = np.searchsorted(own, own + 2 * band) - np.arange(len(own))
        best = int(np.argmax(count))
        # a slanted view of the faces beside it spreads evenly
        even = len(own) * 2 * band / max(float(np.ptp(at[:, axis])), 4 * band)
        out.append(float(np.median(own[best : best + count[best]])) if count[best] > 2 * even else None)
    return out


def _planes(
    points: Array, stations: Array, turn: float, places: list[float | None], band: float, fit: FitFace
) -> list[Plane | None]:
    axes = _axes(turn)
    at, towards = points[:, :2] @ axes.T, (stations - points)[:, :2] @ axes.T
    out: list[Plane | None] = []
    for k, place in enumerate(places):
        axis, sign = k // 2, (-1.0, 1.0)[k % 2]
        if place is None:
            out.append(None)
            continue
        low, high = _extent(at[:, 1 - axis], places[2 - 2 * axis : 4 - 2 * axis])
        other = at[:, 1 - axis]
        near = (np.abs(at[:, axis] - place) < band) & (sign * towards[:, axis] > 0.0)
        near &= (other > low + EDGE_M) & (other < high - EDGE_M)
        rows = np.flatnonzero(near)
        if len(rows) < LEAST_FACE or np.ptp(other[rows]) < LEAST_WIDTH * (high - low - 2 * EDGE_M):
            out.append(None)
            continue
        plane = fit(rows)
        out.append(plane.facing(stations[rows[0]]))
    return out


def _extent(other: Array, ends: list[float | None]) -> tuple[float, float]:
    """From where to where a face reaches: to its neighbours, or as far as there are returns."""
    low, high = ends
    return (float(other.min()) if low is None else low), (float(other.max()) if high is None else high)


def _common_turn(turn: float, known: list[tuple[int, Plane]]) -> float:
    """Mean of the faces' turns, modulo right angles, weighted by what is known of each."""
    off, weight = [], []
    for _, plane in known:
        level = np.array([-plane.normal[1], plane.normal[0], 0.0])
        level /= np.linalg.norm(level)
        angle = float(np.arctan2(plane.normal[1], plane.normal[0])) - turn
        off.append((angle + np.pi / 4) % (np.pi / 2) - np.pi / 4)
        row = plane.axes @ level
        weight.append(1.0 / max(float(row @ plane.covariance[:2, :2] @ row), 1e-12))
    return turn + float(np.average(off, weights=weight))


def _end(
    k: int, points: Array, stations: Array, axes: Array, sides: list[_Side | None], band: float
) -> _Side | None:
    """A side that nobody saw: between the last returns on the faces beside it and the scanners' next rays."""
    axis, sign = k // 2, (-1.0, 1.0)[k % 2]
    at = points[:, :2] @ axes.T
    last, following = -np.inf, np.inf
    for j in (2 - 2 * axis, 3 - 2 * axis):
        face = sides[j]
        if face is None:
            continue
        turned = (-1.0, 1.0)[j % 2] * ((stations - points)[:, :2] @ axes[1 - axis]) > 0.0
        own = (np.abs(at[:, 1 - axis] - face.place) < band) & turned
        for station in np.unique(stations[own], axis=0):
            rows = np.flatnonzero(own & (stations == station).all(axis=1))
            u = sign * at[rows, axis]
            end, beyond = _last_ray(u, face.place - axes[1 - axis] @ station[:2], sign * float(axes[axis] @ station[:2]))
            last, following = max(last, end), min(following, beyond)
    if not np.isfinite(last):
        return None
    following = max(following, last)
    # the last column of returns is off along the face by part of the range's error
    sigma = float(np.hypot((following - last) / np.sqrt(12.0), band / 4))
    return _Side(sign * 0.5 * (last + following), sigma)


def _last_ray(u: Array, depth: float, foot: float) -> tuple[float, float]:
    """The farthest place of returns along a face, and where the scanner's next column of rays meets it.

    ``depth`` is the face's distance from the scanner, ``foot`` the scanner's place along it.
    """
    angle = np.sort(np.arctan2(u - foot, abs(depth)))
    gaps = np.diff(angle)
    step = float(np.median(gaps[gaps > SAME_RAY])) if (gaps > SAME_RAY).any() else SAME_RAY
    outer = min(float(np.quantile(angle, 0.995)) + step, 1.55)
    return float(np.quantile(u, 0.995)), foot + abs(depth) * float(np.tan(outer))


def _from_outline(at: Array, low: Array, high: Array) -> Array:
    """(N,) distance from a rectangle's outline, negative inside [m]."""
    beyond = np.maximum(low - at, at - high)
    outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=1)
    return np.asarray(np.where(outside > 0, outside, beyond.max(axis=1)))


def _circle(points: Array, band: float) -> ColumnShape | None:
    """A circle by least squares of the distances, returns beyond the band left out step by step."""
    xy = points[:, :2]
    middle = xy.mean(axis=0)
    q = xy - middle
    a, b, c = np.linalg.lstsq(np.column_stack([2 * q, np.ones(len(q))]), (q**2).sum(axis=1), rcond=None)[0]
    found = np.array([a, b, np.sqrt(max(c + a * a + b * b, 0.0))])
    own = np.ones(len(q), dtype=np.bool_)
    for _ in range(20):
        ray = q - found[:2]
        distance = np.maximum(np.linalg.norm(ray, axis=1), 1e-9)
        off = distance - found[2]
        own = np.abs(off) < max(2 * band, 2.5 * float(np.median(np.abs(off))))
        design = np.column_stack([ray / distance[:, None], np.ones(len(q))])[own]
        found = found + np.linalg.lstsq(design, off[own], rcond=None)[0]
        if not NARROWEST_M / 2 < found[2] < WIDEST_M / 2:
            return None
    ray = q - found[:2]
    off = np.linalg.norm(ray, axis=1) - found[2]
    own = np.abs(off) < 2 * band
    if own.sum() < LEAST_FACE:
        return None
    angle = np.arctan2(ray[own, 1], ray[own, 0])
    sector = np.floor(angle / np.radians(15)).astype(np.int64)
    sigma = _circle_sigma(sector, points[own, 2], off[own], angle)
    residual = off[own]
    return ColumnShape(
        Point(middle + found[:2]).buffer(float(found[2]), 32), float(found[2]), float(np.abs(residual).mean()),
        float(residual.std()), len(np.unique(sector)) / 24, sigma, (), float((np.abs(off[_thinned(points)]) < 2 * band).mean()),
        int(own.sum()),
    )


def _circle_sigma(sector: Rows, z: Array, off: Array, angle: Array) -> float:
    """Of the middle, from the means in cells of 15 degrees and 0.3 m: neighbouring returns share their errors [m]."""
    key = (sector - sector.min()) * 4096 + np.floor((z - z.min()) / 0.3).astype(np.int64)
    _, index = np.unique(key, return_inverse=True)
    count = np.bincount(index.ravel())
    mean, at = np.bincount(index.ravel(), off) / count, np.bincount(index.ravel(), angle) / count
    design = np.column_stack([np.cos(at), np.sin(at), np.ones(len(at))])
    covariance = np.linalg.pinv(design.T @ design) * float((mean**2).sum() / max(len(at) - 3, 1))
    return float(np.sqrt(max(covariance[0, 0], covariance[1, 1])))
