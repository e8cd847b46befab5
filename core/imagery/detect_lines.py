"""Straight lines in an image: found by a detector, measured to a fraction of a pixel, with their covariance.

The detector (LSD, or Canny and the probabilistic Hough transform) only says where to look. Along each of its segments the
place of the steepest grey value change is measured across it; those places are freed from lens distortion and a line is
fitted to them. The image itself is never resampled.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from ..errors import BimVerifyError
from .camera import Interior

Vector = NDArray[np.float64]
Detector = Literal["lsd", "hough"]
DETECTORS: tuple[Detector, ...] = ("lsd", "hough")
SHORTEST_PX = 20.0
BLUR_PX = 1.0
HALF_WIDTH_PX = 3.0
"""How far from the detector's segment its edge is looked for."""
STEP_PX = 0.5
LEAST_SUPPORT = 12
SYSTEMATIC_PX = 0.2
"""What no residual shows: light, gamma and the rest of the lens move a whole edge by about this much."""
OUTLIER = 3.0
CANNY_LOW, CANNY_HIGH = 50.0, 150.0
HOUGH_VOTES = 50


@dataclass(frozen=True)
class ImageLines:
    """Lines of one image in ideal pixels (distortion taken out), the longest first."""

    start: Vector
    """(N, 2)"""
    end: Vector
    """(N, 2)"""
    offset_sigma: Vector
    """(N,) across the line at its middle, pixels."""
    angle_sigma: Vector
    """(N,) radians."""
    strength: Vector
    """(N,) mean grey value change per pixel across the line, 0 to 255."""
    weight: Vector
    """(N,) of length and strength (Meyer 2021 eq. 3.3), 0 to 1."""

    def __len__(self) -> int:
        return len(self.start)

    @property
    def length(self) -> Vector:
        """(N,) pixels."""
        return np.asarray(np.linalg.norm(self.end - self.start, axis=1))

    def uncertain(self, rows: NDArray[np.int64], apart: Vector) -> tuple[Vector, Vector]:
        """Lines (R, 3) with a^2 + b^2 = 1, and their covariances (R, 3, 3); ``apart`` (R,) [px] is what each may lie off, as a
        whole and at its ends, on top of its own sigmas."""
        return line_with_covariance(
            self.start[rows], self.end[rows], np.hypot(self.offset_sigma[rows], apart),
            np.hypot(self.angle_sigma[rows], np.sqrt(2.0) * apart / self.length[rows]),
        )


def line_with_covariance(start: Vector, end: Vector, offset_sigma: Vector, angle_sigma: Vector) -> tuple[Vector, Vector]:
    """Lines (N, 3) through pairs of points, uncertain across their middle [px] and in their direction [rad]."""
    middle = 0.5 * (start + end)
    along = end - start
    along = along / np.linalg.norm(along, axis=1, keepdims=True)
    normal = np.column_stack([-along[:, 1], along[:, 0]])
    line = np.column_stack([normal, -np.einsum("ni,ni->n", normal, middle)])
    turn = np.column_stack([-along, np.einsum("ni,ni->n", along, middle)])
    shift = np.zeros_like(turn)
    shift[:, 2] = -1.0
    cov = (
        angle_sigma[:, None, None] ** 2 * turn[:, :, None] * turn[:, None, :]
        + offset_sigma[:, None, None] ** 2 * shift[:, :, None] * shift[:, None, :]
    )
    return line, cov


def detect_lines(
    image: NDArray[np.uint8], interior: Interior, detector: Detector = "lsd", shortest: float = SHORTEST_PX
) -> ImageLines:
    """Lines of a grey image (H, W); raises BimVerifyError when its size is not the interior orientation's."""
    import cv2

    if image.shape != (interior.height, interior.width):
        raise BimVerifyError(
            f"The image has {image.shape[1]} x {image.shape[0]} pixels, its interior orientation is for "
            f"{interior.width} x {interior.height}; give the image as it was taken, or scale the interior orientation."
        )
    segments = _segments(image, detector)
    long_enough = np.linalg.norm(segments[:, 2:] - segments[:, :2], axis=1) >= shortest
    segments = np.ascontiguousarray(segments[long_enough])
    smooth = cv2.GaussianBlur(image.astype(np.float32), (0, 0), BLUR_PX)
    gx, gy = cv2.Scharr(smooth, cv2.CV_32F, 1, 0) / 32.0, cv2.Scharr(smooth, cv2.CV_32F, 0, 1) / 32.0
    first = np.concatenate([[0], np.cumsum(_samples(segments))]).astype(np.int64)
    place, slope = _support(gx, gy, segments, first)
    seen = np.isfinite(place[:, 0])
    ideal = np.full_like(place, np.nan)
    ideal[seen] = interior.undistort(place[seen])
    fitted = _fit_all(ideal, slope, first)
    diagonal = float(np.hypot(interior.width, interior.height))
    good = np.isfinite(fitted[:, 0]) & (np.hypot(fitted[:, 2] - fitted[:, 0], fitted[:, 3] - fitted[:, 1]) >= 0.7 * shortest)
    fitted = fitted[good]
    length = np.hypot(fitted[:, 2] - fitted[:, 0], fitted[:, 3] - fitted[:, 1])
    weight = 0.5 * (length / diagonal + np.minimum(fitted[:, 6], 255.0) / 255.0)
    order = np.argsort(-length, kind="stable")
    f = fitted[order]
    return ImageLines(f[:, 0:2], f[:, 2:4], f[:, 4], f[:, 5], f[:, 6], weight[order])


def _segments(image: NDArray[np.uint8], detector: Detector) -> Vector:
    """(N, 4) start and end, pixels of the image as it is."""
    import cv2

    if detector == "lsd":
        found = cv2.createLineSegmentDetector(cv2.LSD_REFINE_STD).detect(image)[0]
    elif detector == "hough":
        edges = cv2.Canny(image, CANNY_LOW, CANNY_HIGH)
        found = cv2.HoughLinesP(edges, 1.0, np.pi / 720, HOUGH_VOTES, minLineLength=SHORTEST_PX, maxLineGap=4)
    else:
        raise BimVerifyError(f"There is no line detector {detector!r}; choose {' or '.join(DETECTORS)}.")
    return np.zeros((0, 4)) if found is None else np.asarray(found, dtype=np.float64).reshape(-1, 4)


def _samples(segments: Vector) -> NDArray[np.int64]:
    return np.floor(np.linalg.norm(segments[:, 2:] - segments[:, :2], axis=1)).astype(np.int64) + 1


@njit(cache=True, nogil=True, inline="always")
def _bilinear(image: NDArray[np.float32], x: float, y: float) -> float:
    i, j = int(y), int(x)
    fy, fx = y - i, x - j
    above = image[i, j] * (1.0 - fx) + image[i, j + 1] * fx
    below = image[i + 1, j] * (1.0 - fx) + image[i + 1, j + 1] * fx
    return float(above * (1.0 - fy) + below * fy)


@njit(cache=True, nogil=True, parallel=True)
def _support(
    gx: NDArray[np.float32], gy: NDArray[np.float32], segments: Vector, first: NDArray[np.int64]
) -> tuple[Vector, Vector]:
    """Places (S, 2) [px] of the steepest change across each segment, one a pixel along it, and the slope there (S,)."""
    place = np.full((first[-1], 2), np.nan)
    slope = np.zeros(first[-1])
    height, width = gx.shape
    steps = int(2 * HALF_WIDTH_PX / STEP_PX) + 1
    for s in prange(len(segments)):
        x0, y0, x1, y1 = segments[s]
        count = first[s + 1] - first[s]
        length = np.hypot(x1 - x0, y1 - y0)
        tx, ty = (x1 - x0) / length, (y1 - y0) / length
        nx, ny = -ty, tx
        profile = np.empty((count, steps))
        total = 0.0
        for k in range(count):
            for m in range(steps):
                off = m * STEP_PX - HALF_WIDTH_PX
                x, y = x0 + k * tx + off * nx, y0 + k * ty + off * ny
                if 0.0 <= x < width - 1.001 and 0.0 <= y < height - 1.001:
                    profile[k, m] = _bilinear(gx, x, y) * nx + _bilinear(gy, x, y) * ny
                else:
                    profile[k, m] = 0.0
                if abs(off) <= 1.0:
                    total += profile[k, m]
        sign = 1.0 if total >= 0.0 else -1.0
        for k in range(count):
            best, at = 0.0, -1
            for m in range(1, steps - 1):
                value = sign * profile[k, m]
                if value > best and value >= sign * profile[k, m - 1] and value >= sign * profile[k, m + 1]:
                    best, at = value, m
            if at < 0:
                continue
            left, right = sign * profile[k, at - 1], sign * profile[k, at + 1]
            bend = left - 2.0 * best + right
            fine = 0.5 * (left - right) / bend if bend < 0.0 else 0.0
            off = (at + fine) * STEP_PX - HALF_WIDTH_PX
            place[first[s] + k, 0] = x0 + k * tx + off * nx
            place[first[s] + k, 1] = y0 + k * ty + off * ny
            slope[first[s] + k] = best
    return place, slope


def _fit_all(place: Vector, slope: Vector, first: NDArray[np.int64]) -> Vector:
    """(N, 7) start, end, sigma across [px], sigma of the direction [rad], strength; NaN where there is no line."""
    out = np.full((len(first) - 1, 7), np.nan)
    for row in range(len(out)):
        span = slice(first[row], first[row + 1])
        if (fitted := _fit(place[span], slope[span])) is not None:
            out[row] = fitted
    return out


def _fit(xy: Vector, slope: Vector) -> Vector | None:
    """A line by orthogonal least squares; places off it by more than three robust sigmas, or with little slope, are left."""
    seen = np.isfinite(xy[:, 0])
    if seen.sum() < LEAST_SUPPORT:
        return None
    seen &= slope > 0.3 * np.median(slope[seen])
    use = seen
    for _ in range(6):
        x, y = xy[use].T
        middle = np.array([x.mean(), y.mean()])
        x, y = x - middle[0], y - middle[1]
        angle = 0.5 * np.arctan2(2.0 * (x @ y), x @ x - y @ y)
        along = np.array([np.cos(angle), np.sin(angle)])
        away = (xy - middle) @ [-along[1], along[0]]
        spread = max(1.4826 * float(np.median(np.abs(away[use]))), 0.02)
        kept = seen & (np.abs(away) <= OUTLIER * spread)
        if kept.sum() < LEAST_SUPPORT or (kept == use).all():
            break
        use = kept
    rows = np.flatnonzero(use)
    if len(rows) < max(LEAST_SUPPORT, 0.4 * len(xy)):
        return None
    t, off = (xy[rows] - middle) @ along, away[rows]
    variance = float(off @ off) / max(len(rows) - 2, 1)
    neighbours = np.diff(rows) == 1
    rho = float((off[:-1] * off[1:])[neighbours].mean()) / max(variance, 1e-12) if neighbours.any() else 0.0
    rho = min(max(rho, 0.0), 0.95)
    own = max(len(rows) * (1.0 - rho) / (1.0 + rho), 2.0)
    error = variance / own + SYSTEMATIC_PX**2
    ends = middle + np.outer([t.min(), t.max()], along)
    return np.array([*ends.ravel(), np.sqrt(error), np.sqrt(error / (t @ t / len(t))), slope[rows].mean()])
