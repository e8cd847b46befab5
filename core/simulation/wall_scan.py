"""A scanner that shoots only the window of directions in which a wall stands, line by line.

Each vertical line starts at a phase of its own within one step, as the lines of scanners do whose mirror runs freely; with
``locked`` all lines share their elevations, as on an ideal grid.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .scanner import Scanner, edge_cells, straddling
from .scene import Scene

Array = NDArray[np.float64]
EDGE_STEP_M = 0.002
LINES_PER_BAND = 128


def scan_window(
    scene: Scene,
    position: Array,
    low: Array,
    high: Array,
    scanner: Scanner,
    *,
    seed: int = 0,
    locked: bool = False,
) -> Array:
    """(N, 3) returns minus ``position`` (3,) [m, scene frame] of the beams whose directions meet the box ``low``..``high``.

    The same arguments give the same returns.
    """
    corners = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
    away = corners - position
    middle = math.atan2(*(0.5 * (low + high) - position)[[1, 0]])
    azimuth = (np.arctan2(away[:, 1], away[:, 0]) - middle + math.pi) % (2 * math.pi) - math.pi
    elevation = np.arctan2(away[:, 2], np.hypot(away[:, 0], away[:, 1]))
    step = scanner.angular_step
    lines = max(int(np.ptp(azimuth) / step), 1)
    rows = max(int(np.ptp(elevation) / step), 1)
    random = np.random.default_rng(seed)
    phase = np.full(lines, 0.5) if locked else random.random(lines)
    first = middle + azimuth.min() + random.random() * step
    found = []
    for begin in range(0, lines, LINES_PER_BAND):
        band = np.arange(begin, min(begin + LINES_PER_BAND, lines))
        az = np.broadcast_to((first + band * step)[:, None], (len(band), rows))
        el = elevation.min() + (np.arange(rows)[None, :] + phase[band][:, None]) * step
        found.append(_shoot(scene, position, az, el, scanner, np.random.default_rng((seed, begin))))
    return np.concatenate(found)


def _shoot(
    scene: Scene, position: Array, azimuth: Array, elevation: Array, scanner: Scanner, random: np.random.Generator
) -> Array:
    lines, rows = azimuth.shape
    az, el = azimuth.ravel(), elevation.ravel()
    direction = np.column_stack([np.cos(el) * np.cos(az), np.cos(el) * np.sin(az), np.sin(el)])
    seen = scene.cast(position, direction)
    hit = np.isfinite(seen.distance)
    distance = np.where(hit, seen.distance, 0.0)
    owner = np.where(hit, scene.owner[seen.triangle], -1).astype(np.int64)
    power = np.where(hit, scanner.power(distance, seen.cos_incidence, scene.reflectance[owner]), 0.0)
    edge = edge_cells(direction, seen.distance, seen.triangle, scene.normal, lines, rows, EDGE_STEP_M)
    at = np.flatnonzero(edge)
    if len(at):
        distance[at], owner[at], power[at], _, _ = straddling(
            scene, position, direction[at], scanner, np.zeros(len(at))
        )
    if scene.unevenness is not None:
        smooth = np.flatnonzero((owner >= 0) & ~edge)
        bump = scene.unevenness.height(position + distance[smooth, None] * direction[smooth], owner[smooth])
        distance[smooth] -= bump / np.maximum(seen.cos_incidence[smooth], 0.2)
    kept = np.flatnonzero((owner >= 0) & (distance > scanner.range_min) & (power > scanner.weakest_power))
    noise = random.standard_normal((3, len(kept)))
    measured = distance[kept] + scanner.sigma(power[kept]) * noise[0]
    el = el[kept] + scanner.sigma_angle * noise[1]
    az = az[kept] + scanner.sigma_angle * noise[2] / np.maximum(np.cos(el), 1e-3)
    return measured[:, None] * np.column_stack([np.cos(el) * np.cos(az), np.cos(el) * np.sin(az), np.sin(el)])
