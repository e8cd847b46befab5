"""A facade in a photo to its upright picture: four corners, and what they say about its height over its width."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from shapely import Polygon, box

from ..errors import BimVerifyError

Array = NDArray[np.float64]
FOCAL_RANGE = (0.45, 5.0)
"""Of cameras, in units of the image's longer side."""
FOCAL_SIGMA = 0.45
"""Of the logarithm of a focal length that is not known: from a telephone's wide lens to a small telephoto."""
KNOWN_FOCAL_SIGMA = 0.05
CORNER_SIGMA_PX = 1.5
CENTRE_SIGMA = 0.006
"""Of the principal point, in units of the image's longer side."""
LONGEST_PX = 1200
DRAWS = 64
LEAST_INSIDE = 0.5


def order_corners(corners: Array) -> Array:
    """(4, 2) as left top, right top, right bottom, left bottom, whatever the order given; raises BimVerifyError."""
    corners = np.asarray(corners, dtype=np.float64)
    middle = corners.mean(axis=0)
    turn = np.arctan2(*(corners - middle).T[::-1])
    ring = corners[np.argsort(turn)]
    ring = np.roll(ring, -int(np.argmin(ring.sum(axis=1))), axis=0)
    step = np.roll(ring, -1, axis=0) - ring
    after = np.roll(step, -1, axis=0)
    cross = step[:, 0] * after[:, 1] - step[:, 1] * after[:, 0]
    if not np.isfinite(corners).all() or cross.min() <= 4.0:
        raise BimVerifyError("The four corners of the facade are no convex four-sided figure; give them around it.")
    return np.asarray(ring)


def check_inside(ring: Array, size: tuple[int, int], name: str) -> None:
    """Raise BimVerifyError when less than half of the facade with these corners is in a photo of (width, height) pixels."""
    outline = Polygon(ring)
    if outline.intersection(box(0.0, 0.0, *size)).area < LEAST_INSIDE * outline.area:
        raise BimVerifyError(
            f"{name}: most of the facade with these corners lies outside the photo of {size[0]} x {size[1]} pixels; give its "
            "corners in pixels of this photo, x to the right and y down from its left top."
        )


def unit_homography(corners: Array) -> Array:
    """(3, 3) from the unit square (x right, y down) to the image."""
    import cv2

    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=np.float32)
    return np.asarray(cv2.getPerspectiveTransform(square, np.asarray(corners, dtype=np.float32)), dtype=np.float64)


def aspect_ratio(
    corners: Array, size: tuple[int, int], focal: float | None = None, seed: int = 0, corner_sigma: float = CORNER_SIGMA_PX
) -> tuple[float, float]:
    """Height over width of the rectangle with these corners, and its relative standard deviation.

    The picture of a rectangle and square pixels fix the focal length where the view is oblique; where it is not, the
    ratio hardly depends on it. Both are weighed: the likeliest focal length under what cameras have (or a known one, in
    pixels). The spread comes from draws of corners, principal point and focal length.
    """
    rng = np.random.default_rng((seed, 7))
    longest = float(max(size))
    centre = np.array([(size[0] - 1) / 2, (size[1] - 1) / 2])
    prior = focal / longest if focal else 1.0
    sigma = KNOWN_FOCAL_SIGMA if focal else FOCAL_SIGMA
    candidates = np.geomspace(FOCAL_RANGE[0], FOCAL_RANGE[1], 160)
    noise = rng.normal(0.0, corner_sigma, (DRAWS, 4, 2))
    centres = centre + rng.normal(0.0, CENTRE_SIGMA * longest, (DRAWS, 2))
    ratio = np.empty((DRAWS + 1, len(candidates)))
    cosine = np.empty_like(ratio)
    for k in range(DRAWS + 1):
        moved, middle = (corners, centre) if k == DRAWS else (corners + noise[k], centres[k])
        ratio[k], cosine[k] = _view(unit_homography((moved - middle) / longest), candidates)
    spread = np.maximum(cosine[:DRAWS].std(axis=0), 1e-6)
    cost = (cosine[DRAWS] / spread) ** 2 + 2 * np.log(spread) + (np.log(candidates / prior) / sigma) ** 2
    weight = np.exp(-0.5 * (cost - cost.min()))
    weight /= weight.sum()
    logs = np.log(ratio)
    best = float(weight @ logs[DRAWS])
    variance = float(weight @ (logs[DRAWS] - best) ** 2)
    variance += float(weight @ logs[:DRAWS].var(axis=0)) * 0.5
    return math.exp(best), math.sqrt(variance)


def _view(h: Array, focal: Array) -> tuple[Array, Array]:
    """Height over width, and the cosine of the angle between the sides, for each focal length."""
    a = np.stack([h[0, 0] / focal, h[1, 0] / focal, np.full_like(focal, h[2, 0])])
    b = np.stack([h[0, 1] / focal, h[1, 1] / focal, np.full_like(focal, h[2, 1])])
    la, lb = np.linalg.norm(a, axis=0), np.linalg.norm(b, axis=0)
    return lb / la, (a * b).sum(axis=0) / (la * lb)


def rectify(image: NDArray[np.uint8], corners: Array, aspect: float) -> NDArray[np.uint8]:
    """The facade alone (H, W, 3), upright, with square pixels of about the image's own size."""
    import cv2

    side = np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)
    wide = max(side[0], side[2], max(side[1], side[3]) / aspect)
    wide = min(wide, LONGEST_PX, LONGEST_PX / aspect)
    width, height = max(round(wide), 8), max(round(wide * aspect), 8)
    target = np.array([[0, 0], [width, 0], [width, height], [0, height]], dtype=np.float64) - 0.5
    warp = cv2.getPerspectiveTransform(corners.astype(np.float32), target.astype(np.float32))
    shrink = float(np.mean(side)) / float(np.mean([width, height]))
    source = cv2.GaussianBlur(image, (0, 0), 0.4 * shrink) if shrink > 1.5 else image
    return np.asarray(cv2.warpPerspective(source, warp, (width, height), flags=cv2.INTER_LINEAR), dtype=np.uint8)
