"""Poses that a campaign could have in a model, voted for by surface orientation, height and place."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.fft import next_fast_len
from scipy.ndimage import gaussian_filter, gaussian_filter1d

from . import transform as se3

Array = NDArray[np.float64]

LEVEL_DEG = 10.0
"""How far from the vertical a normal may be to count as a floor's or ceiling's when the scan is levelled, degrees."""
LEVEL_STEPS_DEG = (10.0, 6.0, 3.0, 2.0)
UPRIGHT_COS = 0.2
"""Largest vertical part of a wall's normal (12 degrees)."""
YAW_STEP_DEG = 1.0
YAW_SMOOTH_DEG = 1.5
YAW_APART_DEG = 6.0
YAWS = 8
"""Headings that are followed: the four of a right-angled building, and four for a second grid at an angle."""
HEIGHT_STEP_M = 0.05
HEIGHT_APART_M = 0.3
HEIGHTS = 4
CELL_M = 0.2
"""Edge of the plan's raster, metres: about a wall, so that a heading one degree off still overlaps at 10 m."""
MOST_CELLS = 1024
"""Cells along an axis of the raster; beyond it the cells grow with the building."""
SECTORS = 8
"""Classes of wall orientation; a wall only meets walls that look the same way."""
PLACES = 12
PLACE_APART_CELLS = 3


def level(normal: Array) -> Array:
    """(3, 3) rotation that brings the mean of the nearly vertical normals (N, 3) to the vertical.

    Repeated with a narrowing cone, so that sloped faces drop out. The identity where there are too few such normals.
    """
    turn = np.eye(3)
    for cone in LEVEL_STEPS_DEG:
        turned = normal @ turn.T
        upright = turned[np.abs(turned[:, 2]) > np.cos(np.radians(cone))]
        if len(upright) < 50:
            return turn
        up = (upright * np.sign(upright[:, [2]])).mean(axis=0)
        up /= np.linalg.norm(up)
        axis = np.cross(up, [0.0, 0.0, 1.0])
        angle = np.arcsin(np.clip(np.linalg.norm(axis), 0.0, 1.0))
        unit = axis / max(float(np.linalg.norm(axis)), 1e-15)
        turn = se3.exp_about(np.concatenate([unit * angle, np.zeros(3)]), np.zeros(3))[:3, :3] @ turn
    return turn


def vote(scan: Array, scan_normal: Array, plan: Array, plan_normal: Array, plan_area: Array) -> Array:
    """(K, 4, 4) candidate poses of the levelled returns in the plan, each from one heading, height and place.

    ``scan`` and ``scan_normal`` (N, 3) are returns near the origin, normals turned to their station; ``plan`` (M, 3)
    are places on the planned surface with outward normals and areas [m2]. All metres.
    """
    heights = _heights(scan, scan_normal, plan, plan_normal, plan_area)
    wall, planned = np.abs(scan_normal[:, 2]) < UPRIGHT_COS, np.abs(plan_normal[:, 2]) < UPRIGHT_COS
    poses = []
    for yaw in _headings(scan_normal[wall], plan_normal[planned], plan_area[planned]):
        turn = se3.exp_about(np.array([0.0, 0.0, yaw, 0.0, 0.0, 0.0]), np.zeros(3))
        for place in _places(
            se3.apply(turn, scan[wall]), se3.rotate(turn, scan_normal[wall]), plan[planned], plan_normal[planned]
        ):
            for height in heights:
                poses.append(se3.translation(np.array([place[0], place[1], height])) @ turn)
    return np.array(poses).reshape(-1, 4, 4)


def _headings(scan_normal: Array, plan_normal: Array, area: Array) -> Array:
    bins = round(360.0 / YAW_STEP_DEG)
    spectra = []
    for normal, weight in ((scan_normal, None), (plan_normal, area)):
        angle = np.degrees(np.arctan2(normal[:, 1], normal[:, 0])) % 360.0
        count = np.bincount((angle / YAW_STEP_DEG).astype(np.int64) % bins, weights=weight, minlength=bins)
        smooth = gaussian_filter1d(count.astype(np.float64), YAW_SMOOTH_DEG / YAW_STEP_DEG, mode="wrap")
        spectra.append(np.fft.rfft(smooth))
    match = np.fft.irfft(np.conj(spectra[0]) * spectra[1], bins)
    chosen: list[int] = []
    for k in np.argsort(-match, kind="stable"):
        if all(abs((k - c + bins // 2) % bins - bins // 2) * YAW_STEP_DEG >= YAW_APART_DEG for c in chosen):
            chosen.append(int(k))
        if len(chosen) == YAWS:
            break
    return np.radians(np.array(chosen) * YAW_STEP_DEG)


def _heights(scan: Array, scan_normal: Array, plan: Array, plan_normal: Array, area: Array) -> list[float]:
    vertical = np.cos(np.radians(LEVEL_DEG))
    low = min(scan[:, 2].min(), plan[:, 2].min())
    top = max(scan[:, 2].max(), plan[:, 2].max())
    size = int((top - low) / HEIGHT_STEP_M) + 2
    length = next_fast_len(2 * size, real=True)
    match = np.zeros(length)
    for side in (1.0, -1.0):
        spectra = []
        for z, normal, weight in ((scan[:, 2], scan_normal, None), (plan[:, 2], plan_normal, area)):
            facing = side * normal[:, 2] > vertical
            count = np.bincount(
                ((z[facing] - low) / HEIGHT_STEP_M).astype(np.int64),
                weights=None if weight is None else weight[facing],
                minlength=size,
            )
            spectra.append(np.fft.rfft(gaussian_filter1d(np.sqrt(count.astype(np.float64)), 1.0), length))
        match += np.fft.irfft(np.conj(spectra[0]) * spectra[1], length)
    chosen: list[float] = []
    for k in np.argsort(-match, kind="stable")[: 50 * HEIGHTS]:
        shift = (k if k < length // 2 else k - length) * HEIGHT_STEP_M
        if all(abs(shift - c) >= HEIGHT_APART_M for c in chosen):
            chosen.append(float(shift))
        if len(chosen) == HEIGHTS:
            break
    return chosen


def _places(scan: Array, scan_normal: Array, plan: Array, plan_normal: Array) -> Array:
    """(K, 2) shifts in plan, best first, from the correlation of wall rasters per orientation."""
    low = np.minimum(scan[:, :2].min(axis=0), plan[:, :2].min(axis=0))
    span = (np.maximum(scan[:, :2].max(axis=0), plan[:, :2].max(axis=0)) - low).max()
    cell = max(CELL_M, span / MOST_CELLS)
    size = int(span / cell) + 2
    length = next_fast_len(2 * size, real=True)
    match = np.zeros((length, length))
    for sector in range(SECTORS):
        spectra = [
            np.fft.rfft2(_raster(xyz, normal, sector, low, cell, size), (length, length))
            for xyz, normal in ((scan, scan_normal), (plan, plan_normal))
        ]
        match += np.fft.irfft2(np.conj(spectra[0]) * spectra[1], (length, length))
    order = np.argpartition(-match.ravel(), 60 * PLACES)[: 60 * PLACES]
    order = order[np.lexsort((order, -match.ravel()[order]))]
    index = np.stack(np.unravel_index(order, match.shape), axis=1)
    shift = np.where(index < length // 2, index, index - length)
    chosen: list[NDArray[np.int64]] = []
    for s in shift:
        if all(np.abs(s - c).max() >= PLACE_APART_CELLS for c in chosen):
            chosen.append(s)
        if len(chosen) == PLACES:
            break
    return np.array(chosen) * cell


def _raster(xyz: Array, normal: Array, sector: int, low: Array, cell: float, size: int) -> Array:
    """Which cells hold a wall of the sector (1 or 0), slightly blurred; sectors are centred on the axes and
    diagonals."""
    turn = np.arctan2(normal[:, 1], normal[:, 0]) / (2.0 * np.pi) * SECTORS
    own = np.round(turn).astype(np.int64) % SECTORS == sector
    grid = ((xyz[own, :2] - low) / cell).astype(np.int64)
    raster = np.zeros((size, size))
    raster[grid[:, 0], grid[:, 1]] = 1.0
    return gaussian_filter(raster, 0.7, mode="constant")
