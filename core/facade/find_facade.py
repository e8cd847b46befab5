"""The four corners of the facade that a photo shows, from the vanishing points of its lines; rougher than a person's."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..errors import BimVerifyError
from ..imagery.camera import Interior
from ..imagery.detect_lines import detect_lines
from .rectify import order_corners

Array = NDArray[np.float64]
TRIALS = 400
INLIER_DEG = 1.0
STEEP_DEG, FLAT_DEG = 25.0, 40.0
"""How far from upright the walls' vertical lines are in a photo, and from level their horizontal ones."""
LEAST_LINES = 8
LONG = 0.4
"""Of the height that all upright lines span: a corner of the building, or one above another."""
IN_LINE = 0.006
LONG_LEVEL = 0.4
"""Of the facade's width, that segments in line span: an eave, a cornice, the foot of the wall."""
AS_LONG = 0.85
EAVE_LONG, EAVE_GAP, EAVE_OVER = 0.8, 0.1, 0.012
"""Of the facade's width: the least length of an eave whose ends count, gaps in it, and how far it hangs over."""
CORNICE, FOOT = 0.08, 0.15
"""Of the facade's height, that a cornice or what stands before the foot may hide of its upright lines."""
WIDEST_PX = 1600


def find_corners(image: NDArray[np.uint8], name: str, seed: int = 0) -> Array:
    """(4, 2) pixels, left top, right top, right bottom, left bottom.

    Raises BimVerifyError when the photo has too few lines along two directions.
    """
    import cv2

    grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
    shrink = min(WIDEST_PX / max(grey.shape), 1.0)
    if shrink < 1:
        grey = cv2.resize(grey, None, fx=shrink, fy=shrink, interpolation=cv2.INTER_AREA)
    high, wide = grey.shape
    size = float(max(wide, high))
    centre = np.array([(wide - 1) / 2, (high - 1) / 2])
    lines = detect_lines(np.asarray(grey, dtype=np.uint8), Interior(wide, high, size, size, *centre), shortest=0.02 * size)
    a, b = (lines.start - centre) / size, (lines.end - centre) / size
    angle = np.degrees(np.arctan2(np.abs(b[:, 1] - a[:, 1]), np.abs(b[:, 0] - a[:, 0])))
    rng = np.random.default_rng((seed, 17))
    upright, level = angle > 90 - STEEP_DEG, angle < FLAT_DEG
    vertical, own_v = _vanishing(a[upright], b[upright], rng)
    horizontal, own_h = _vanishing(a[level], b[level], rng)
    if vertical is None or horizontal is None:
        raise BimVerifyError(f"{name}: too few straight lines run along the facade to find it; give its corners by --corners.")
    # a point is x times the horizontal vanishing point plus y times the vertical one plus the middle
    basis = np.column_stack([_toward(horizontal, 0), _toward(vertical, 1), [0.0, 0.0, 1.0]])
    to_wall = np.linalg.inv(basis)
    va, vb = (_apply(to_wall, p[upright][own_v]) for p in (a, b))
    ha, hb = (_apply(to_wall, p[level][own_h]) for p in (a, b))
    ends = np.concatenate([va, vb, ha, hb])
    if not np.isfinite(ends).all():
        raise BimVerifyError(f"{name}: the facade is seen too obliquely to find it; give its corners by --corners.")
    left, right, top, bottom = _extent(va, vb)
    top, bottom = _level_ends(ha, hb, left, right, top, bottom)
    left, right = _eave_ends(ha, hb, va, vb, (left, right, top, bottom))
    ring = np.array([[left, top], [right, top], [right, bottom], [left, bottom]])
    return order_corners((_apply(basis, ring) * size + centre) / shrink)


def _extent(a: Array, b: Array) -> tuple[float, float, float, float]:
    """Left, right, top, bottom in wall coordinates, from upright segments: the outermost long lines and their ends."""
    x, low, high = 0.5 * (a[:, 0] + b[:, 0]), np.minimum(a[:, 1], b[:, 1]), np.maximum(a[:, 1], b[:, 1])
    whole = np.quantile(high, 0.98) - np.quantile(low, 0.02)
    near = IN_LINE * np.ptp(x)
    order = np.argsort(x)
    reach = []
    for k in order:
        mates = np.abs(x - x[k]) < near
        reach.append((x[k], float((high[mates] - low[mates]).sum()), low[mates].min(), high[mates].max()))
    rows = np.array(reach)
    long = rows[rows[:, 1] > LONG * whole]
    if len(long) < 2:
        return float(x.min()), float(x.max()), float(low.min()), float(high.max())
    left, right = long[0], long[-1]
    between = (x > left[0] - near) & (x < right[0] + near)
    # things in the street reach below the foot of the wall, hardly anything above its top
    return float(left[0]), float(right[0]), float(low[between].min()), float(max(left[3], right[3]))


def _level_ends(a: Array, b: Array, left: float, right: float, top: float, bottom: float) -> tuple[float, float]:
    """Top and bottom set to long level segments near them: uprights end under cornices, and behind plants at the foot."""
    first, last = np.minimum(a[:, 0], b[:, 0]), np.maximum(a[:, 0], b[:, 0])
    z = 0.5 * (a[:, 1] + b[:, 1])
    shown = np.clip(np.minimum(last, right) - np.maximum(first, left), 0.0, None)
    high = bottom - top
    near = IN_LINE * high
    share = np.array([shown[np.abs(z - v) < near].sum() for v in z]) / max(right - left, 1e-12)
    long = z[share > LONG_LEVEL]
    upper = (z > top - CORNICE * high) & (z < top + near) & (share > LONG_LEVEL)
    # a roof's ridge lies farther back and looks shorter than the eave before it
    above = z[upper & (share > AS_LONG * share[upper].max(initial=0.0))]
    below = long[(long < bottom + FOOT * high) & (long > bottom - near)]
    return float(above.min()) if len(above) else top, float(below.min()) if len(below) else bottom


def _eave_ends(ha: Array, hb: Array, va: Array, vb: Array, box: tuple[float, float, float, float]) -> tuple[float, float]:
    """Left and right set to where the topmost level line ends, where the corners' own lines are hidden or not the longest."""
    left, right, top, bottom = box
    z, wide, high = 0.5 * (ha[:, 1] + hb[:, 1]), right - left, bottom - top
    own = np.abs(z - top) < IN_LINE * high
    first, last = np.minimum(ha[own, 0], hb[own, 0]), np.maximum(ha[own, 0], hb[own, 0])
    runs: list[list[float]] = []
    for a, b in sorted(zip(first.tolist(), last.tolist(), strict=True)):
        if runs and a - runs[-1][1] < EAVE_GAP * wide:
            runs[-1][1] = max(runs[-1][1], b)
        else:
            runs.append([a, b])
    if not runs:
        return left, right
    start, end = max(runs, key=lambda r: r[1] - r[0])
    if end - start < EAVE_LONG * wide:
        return left, right
    x = 0.5 * (va[:, 0] + vb[:, 0])

    def corner(at: float) -> float:
        """The upright line at the end of the eave, which hangs over a little."""
        near = np.abs(x - at) < EAVE_OVER * wide
        return float(np.average(x[near], weights=np.abs(vb - va)[near, 1])) if near.any() else at

    return corner(start), corner(end)


def _vanishing(a: Array, b: Array, rng: np.random.Generator) -> tuple[Array | None, NDArray[np.bool_]]:
    """Homogeneous point that most length of the segments runs to, and which do."""
    if len(a) < LEAST_LINES:
        return None, np.zeros(len(a), dtype=np.bool_)
    one = np.ones((len(a), 1))
    line = np.cross(np.hstack([a, one]), np.hstack([b, one]))
    line /= np.linalg.norm(line[:, :2], axis=1, keepdims=True)
    length = np.linalg.norm(b - a, axis=1)
    middle, along = 0.5 * (a + b), (b - a) / length[:, None]
    limit = np.sin(np.radians(INLIER_DEG))
    share = length / length.sum()
    best, point = -1.0, np.array([1.0, 0.0, 0.0])
    for _ in range(TRIALS):
        i, j = rng.choice(len(a), 2, replace=False, p=share)
        guess = np.cross(line[i], line[j])
        if np.linalg.norm(guess) < 1e-9:
            continue
        support = float(length[_off(guess, middle, along) < limit].sum())
        if support > best:
            best, point = support, guess
    for _ in range(5):
        own = _off(point, middle, along) < limit
        if own.sum() < LEAST_LINES // 2:
            return None, own
        weighted = line[own] * length[own, None]
        point = np.linalg.svd(weighted)[2][-1]
    return point, _off(point, middle, along) < limit


def _off(point: Array, middle: Array, along: Array) -> Array:
    """Sine of the angle between each segment and the way from its middle to the point."""
    way = point[:2] - point[2] * middle
    way = way / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-12)
    return np.asarray(np.abs(way[:, 0] * along[:, 1] - way[:, 1] * along[:, 0]))


def _toward(point: Array, axis: int) -> Array:
    """The same point with the sign that makes the axis grow to the right (0) or down (1), of unit length."""
    return point / np.linalg.norm(point) * (1.0 if point[axis] > 0 else -1.0)


def _apply(matrix: Array, points: Array) -> Array:
    mapped = np.hstack([points, np.ones((len(points), 1))]) @ matrix.T
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.where(mapped[:, 2:] > 1e-9, mapped[:, :2] / mapped[:, 2:], np.nan))
