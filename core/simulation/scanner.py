"""A terrestrial laser scanner: which directions it shoots, what comes back, and with which error.

A beam is a cone around its centre ray. Where the cone meets one smooth surface, its return is the centre's range plus
noise. Where it meets an edge, sub-rays over the cone's cross-section each return power and the scanner reports one
range for them: the mixed pixel, which lies between the surfaces when it cannot tell them apart.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, fields

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ..scans.campaign import Grid
from .scene import Cast, Scene

REFERENCE_RANGE_M = 10.0
REFERENCE_REFLECTANCE = 0.5
"""Received power is counted in units of that from a 50 % grey surface at 10 m under normal incidence."""
ROWS_PER_BAND = 64
"""Rows that are shot together; fixed, because each band has its own random stream."""
EDGE_STEP_M = 0.002
"""A neighbour's hit this far off the own surface's plane makes the beam one that may straddle an edge."""
SUB_RAY_RINGS = ((0.0, 1), (0.5, 6), (1.0, 12))
"""Radius, in beam radii (1/e^2), and number of the sub-rays."""
MIXED_SPREAD_M = 0.003
"""A return from an edge counts as mixed when its sub-rays leave a gap in range larger than this."""


@dataclass(frozen=True)
class Scanner:
    """What a scanner can do. Angles in radians, lengths in metres.

    The range noise follows the received power P = reflectance * cos(incidence) / range^2, as that of an intensity-based
    model: sigma^2 = sigma_range^2 + sigma_signal^2 / P, with P in units of a 50 % grey surface at 10 m.
    """

    name: str
    angular_step: float
    """Between neighbouring rows and columns."""
    sigma_range: float
    """Noise that no amount of light removes."""
    sigma_signal: float = 0.0005
    """Noise of a return with the reference power, beside ``sigma_range``; it falls with the root of the power."""
    sigma_angle: float = 4e-5
    """Of the recorded horizontal and vertical direction, each."""
    range_min: float = 0.4
    range_max: float = 80.0
    beam_exit_diameter: float = 0.004
    """1/e^2 diameter where the beam leaves the scanner."""
    beam_divergence: float = 3e-4
    """Full angle."""
    range_resolution: float = 0.5
    """Surfaces in one beam closer than this along the ray melt into one range; else the stronger one is reported."""
    weakest_power: float = 0.004
    """Power at which half the returns are lost; well below it (far, dark, grazing) all are."""
    elevation_min: float = math.radians(-60.0)
    """Lowest direction: the cone below it is blind."""
    elevation_max: float = math.radians(90.0)

    @property
    def grid(self) -> Grid:
        """Rows from the lowest elevation up, columns counter-clockwise from the sensor's x axis."""
        rows = round((self.elevation_max - self.elevation_min) / self.angular_step)
        return Grid(rows=rows, columns=round(2 * math.pi / self.angular_step))

    def directions(self, first_row: int, last_row: int) -> NDArray[np.float64]:
        """(last - first, columns, 3) unit vectors of the beams' centres, sensor frame."""
        elevation, azimuth = self.angles(first_row, last_row)
        return _unit(elevation[:, None], azimuth[None, :])

    def angles(self, first_row: int, last_row: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Elevations of the rows and azimuths of the columns [rad]."""
        grid = self.grid
        row_step = (self.elevation_max - self.elevation_min) / grid.rows
        elevation = self.elevation_min + (np.arange(first_row, last_row) + 0.5) * row_step
        azimuth = (np.arange(grid.columns) + 0.5) * (2 * math.pi / grid.columns)
        return elevation, azimuth

    def beam(self, row: NDArray[np.int64], column: NDArray[np.int64]) -> NDArray[np.float64]:
        """(N, 3) unit vectors of the beams' centres, sensor frame."""
        grid = self.grid
        elevation = self.elevation_min + (row + 0.5) * (self.elevation_max - self.elevation_min) / grid.rows
        return _unit(elevation, (column + 0.5) * (2 * math.pi / grid.columns))

    def cell(self, direction: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Row and column of the beam nearest to each (N, 3) direction (sensor frame); row -1 where none is shot."""
        grid = self.grid
        elevation = np.arctan2(direction[:, 2], np.hypot(direction[:, 0], direction[:, 1]))
        azimuth = np.arctan2(direction[:, 1], direction[:, 0]) % (2 * math.pi)
        row_step = (self.elevation_max - self.elevation_min) / grid.rows
        row = np.floor((elevation - self.elevation_min) / row_step).astype(np.int64)
        row = np.where((row >= 0) & (row < grid.rows), row, -1)
        return row, np.floor(azimuth / (2 * math.pi) * grid.columns).astype(np.int64) % grid.columns

    def power(
        self,
        distance: NDArray[np.float64],
        cos_incidence: NDArray[np.float64],
        reflectance: NDArray[np.float64] | NDArray[np.float32],
    ) -> NDArray[np.float64]:
        """Received power of a surface that fills the beam, relative to the reference (see REFERENCE_RANGE_M)."""
        near = np.maximum(distance, self.range_min)
        return reflectance / REFERENCE_REFLECTANCE * cos_incidence * (REFERENCE_RANGE_M / near) ** 2

    def sigma(self, power: NDArray[np.float64]) -> NDArray[np.float64]:
        """Standard deviation of the range [m] at a received power."""
        return np.sqrt(self.sigma_range**2 + self.sigma_signal**2 / np.maximum(power, 1e-9))

    def beam_radius(self, distance: NDArray[np.float64]) -> NDArray[np.float64]:
        """1/e^2 radius [m] of the beam's footprint across the ray."""
        return 0.5 * (self.beam_exit_diameter + self.beam_divergence * distance)


PRESETS: dict[str, Scanner] = {
    "fast": Scanner("fast", math.radians(0.18), sigma_range=0.0020, sigma_signal=0.0010, beam_exit_diameter=0.006),
    "medium": Scanner("medium", math.radians(0.09), sigma_range=0.0012, sigma_signal=0.0006),
    "fine": Scanner("fine", math.radians(0.045), sigma_range=0.0006, sigma_signal=0.0004, beam_divergence=2e-4),
}


@dataclass(frozen=True)
class SimulatedReturns:
    """Returns of one station with their truth, by row, then column; directions without a return are left out."""

    row: NDArray[np.int32]
    column: NDArray[np.int32]
    offset: NDArray[np.float64]
    """(N, 3) metres, sensor frame: what the scanner reports."""
    intensity: NDArray[np.float32]
    """(N,) 0..1: reflectance * cos(incidence), and the share of the beam that it fills."""
    owner: NDArray[np.int32]
    """(N,) rows of ``scene.names``: what the beam met (of a mixed pixel: what gave most of its power)."""
    mixed: NDArray[np.bool_]
    """(N,) the range mixes surfaces at different distances."""
    true_range: NDArray[np.float64]
    """(N,) metres along the beam's centre, before noise."""
    sigma: NDArray[np.float64]
    """(N,) metres, of the range noise that was drawn."""

    def __len__(self) -> int:
        return len(self.row)


def scan_station(
    scene: Scene, position: NDArray[np.float64], rotation: NDArray[np.float64], scanner: Scanner, seed: int
) -> SimulatedReturns:
    """All returns of a set-up at ``position`` (3,) [m, scene frame] with ``rotation`` (3, 3) sensor to scene.

    The same arguments give the same returns, bit for bit.
    """
    bands = list(scan_bands(scene, position, rotation, scanner, seed))
    return SimulatedReturns(*(np.concatenate([getattr(b, f.name) for b in bands]) for f in fields(SimulatedReturns)))


def scan_bands(
    scene: Scene, position: NDArray[np.float64], rotation: NDArray[np.float64], scanner: Scanner, seed: int
) -> Iterator[SimulatedReturns]:
    """As ``scan_station``, in bands of rows, so that memory does not grow with the resolution."""
    for band, first in enumerate(range(0, scanner.grid.rows, ROWS_PER_BAND)):
        last = min(first + ROWS_PER_BAND, scanner.grid.rows)
        random = np.random.default_rng((seed, band))
        yield _scan_band(scene, position, rotation, scanner, random, first, last)


def _scan_band(
    scene: Scene,
    position: NDArray[np.float64],
    rotation: NDArray[np.float64],
    scanner: Scanner,
    random: np.random.Generator,
    first: int,
    last: int,
) -> SimulatedReturns:
    columns = scanner.grid.columns
    shape = (last - first, columns)
    luck = random.random(shape).ravel()
    pane_luck = random.random(shape).ravel()
    noise = random.standard_normal((3, *shape)).reshape(3, -1)

    low, high = max(first - 1, 0), min(last + 1, scanner.grid.rows)
    halo = np.ascontiguousarray(scanner.directions(low, high).reshape(-1, 3) @ rotation.T)
    seen = scene.cast(position, halo)
    edge = edge_cells(
        halo, seen.distance, seen.triangle, scene.normal, high - low, columns, EDGE_STEP_M
    ).reshape(-1, columns)[first - low : last - low].ravel()
    own = slice((first - low) * columns, (last - low) * columns)
    direction = halo[own]
    centre = scene.pass_glass(
        position, direction, Cast(seen.distance[own], seen.triangle[own], seen.cos_incidence[own]), pane_luck
    )

    hit = np.isfinite(centre.distance)
    distance = np.where(hit, centre.distance, 0.0)
    triangle = np.where(hit, centre.triangle, 0)
    owner = np.where(hit, scene.owner[triangle], -1)
    reflectance = scene.reflectance[owner]
    power = np.where(hit, scanner.power(distance, centre.cos_incidence, reflectance), 0.0)
    intensity = np.where(hit, reflectance * centre.cos_incidence, 0.0)
    mixed = np.zeros(len(owner), dtype=np.bool_)
    at = np.flatnonzero(edge)
    if len(at):
        distance[at], owner[at], power[at], intensity[at], mixed[at] = straddling(
            scene, position, direction[at], scanner, pane_luck[at]
        )
    if scene.unevenness is not None:
        smooth = np.flatnonzero((owner >= 0) & ~mixed & ~edge)
        bump = scene.unevenness.height(position + distance[smooth, None] * direction[smooth], owner[smooth])
        distance[smooth] -= bump / np.maximum(centre.cos_incidence[smooth], 0.2)

    returned = (owner >= 0) & (pane_luck >= scene.lost_share[owner])
    returned &= luck < 1.0 / (1.0 + (scanner.weakest_power / np.maximum(power, 1e-12)) ** 4)
    returned &= (distance >= scanner.range_min) & (distance <= scanner.range_max)
    kept = np.flatnonzero(returned)
    row = (kept // columns).astype(np.int32)
    column = (kept % columns).astype(np.int32)
    sigma = scanner.sigma(power[kept])
    elevation, azimuth = scanner.angles(first, last)
    elevation = elevation[row] + scanner.sigma_angle * noise[1, kept]
    # a horizontal angle's error shrinks towards the zenith, where the meridians meet; the direction's does not
    azimuth = azimuth[column] + scanner.sigma_angle * noise[2, kept] / np.maximum(np.cos(elevation), 1e-3)
    measured = distance[kept] + sigma * noise[0, kept]
    return SimulatedReturns(
        row=row + np.int32(first),
        column=column,
        offset=measured[:, None] * _unit(elevation, azimuth),
        intensity=np.clip(intensity[kept], 0.0, 1.0).astype(np.float32),
        owner=owner[kept].astype(np.int32),
        mixed=mixed[kept],
        true_range=distance[kept],
        sigma=sigma,
    )


def straddling(
    scene: Scene,
    position: NDArray[np.float64],
    direction: NDArray[np.float64],
    scanner: Scanner,
    pane_luck: NDArray[np.float64],
) -> tuple[
    NDArray[np.float64], NDArray[np.int64], NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]
]:
    """Range, owner (-1: no return), power, intensity and mixed of beams near edges, from sub-rays over them."""
    section, weight = _sub_rays()
    count, rays = len(direction), len(weight)
    helper = np.where(np.abs(direction[:, [2]]) < 0.9, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])
    side = np.cross(direction, helper)
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    up = np.cross(side, direction)
    across = section[None, :, :1] * side[:, None, :] + section[None, :, 1:] * up[:, None, :]
    start = position + 0.5 * scanner.beam_exit_diameter * across
    ray = direction[:, None, :] + 0.5 * scanner.beam_divergence * across
    ray /= np.linalg.norm(ray, axis=2, keepdims=True)
    start, ray = start.reshape(-1, 3), ray.reshape(-1, 3)
    seen = scene.pass_glass(start, ray, scene.cast(start, ray), np.repeat(pane_luck, rays))

    hit = np.isfinite(seen.distance).reshape(count, rays)
    distance = np.where(hit, seen.distance.reshape(count, rays), np.inf)
    owner = np.where(hit, scene.owner[seen.triangle.reshape(count, rays)], -1)
    shade = np.where(hit, scene.reflectance[owner] * seen.cos_incidence.reshape(count, rays), 0.0)
    share = np.where(
        hit,
        weight * scanner.power(np.where(hit, distance, 1.0), np.where(hit, 1.0, 0.0), shade),
        0.0,
    )
    order = np.argsort(distance, axis=1, kind="stable")
    return _one_range(
        np.take_along_axis(distance, order, 1), np.take_along_axis(owner, order, 1),
        np.take_along_axis(share, order, 1), np.take_along_axis(shade * weight, order, 1), scanner.range_resolution,
        MIXED_SPREAD_M,
    )


@njit(cache=True, nogil=True)
def _one_range(distance, owner, share, shade, resolution, spread):  # type: ignore[no-untyped-def]
    """The range that the scanner reports for sub-returns sorted by distance: the mean of its strongest group."""
    count, rays = distance.shape
    out = np.zeros(count)
    out_owner = np.full(count, -1, dtype=np.int64)
    out_power = np.zeros(count)
    out_shade = np.zeros(count)
    mixed = np.zeros(count, dtype=np.bool_)
    for i in range(count):
        k = 0
        while k < rays and np.isfinite(distance[i, k]):
            total = 0.0
            mean = 0.0
            grey = 0.0
            first = k
            while k < rays and np.isfinite(distance[i, k]) and (
                k == first or distance[i, k] - distance[i, k - 1] <= resolution
            ):
                total += share[i, k]
                mean += share[i, k] * distance[i, k]
                grey += shade[i, k]
                k += 1
            if total > out_power[i]:
                out_power[i] = total
                out[i] = mean / total
                out_shade[i] = grey
                best = 0.0
                largest_gap = 0.0
                for j in range(first, k):
                    if j > first:
                        largest_gap = max(largest_gap, distance[i, j] - distance[i, j - 1])
                    power = 0.0
                    for m in range(first, k):
                        if owner[i, m] == owner[i, j]:
                            power += share[i, m]
                    if power > best:
                        best = power
                        out_owner[i] = owner[i, j]
                mixed[i] = largest_gap > spread
    return out, out_owner, out_power, out_shade, mixed


@njit(cache=True, nogil=True)
def edge_cells(direction, distance, triangle, normal, rows, columns, step):  # type: ignore[no-untyped-def]
    """Which beams have a neighbour (of eight, around the circle) whose hit is off their own surface's plane."""
    edge = np.zeros(rows * columns, dtype=np.bool_)
    for r in range(rows):
        for c in range(columns):
            i = r * columns + c
            for dr in range(-1, 2):
                if r + dr < 0 or r + dr >= rows:
                    continue
                for dc in range(-1, 2):
                    j = (r + dr) * columns + (c + dc) % columns
                    if triangle[i] == triangle[j]:
                        continue
                    if triangle[i] < 0 or triangle[j] < 0:
                        edge[i] = True
                        continue
                    off = 0.0
                    for k in range(3):
                        off += normal[triangle[i], k] * (
                            distance[j] * direction[j, k] - distance[i] * direction[i, k]
                        )
                    if abs(off) > step:
                        edge[i] = True
    return edge


def _sub_rays() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Positions in the beam's cross-section [beam radii], and their shares of a Gaussian beam's power (adding to 1)."""
    places, shares = [], []
    for ring, (radius, count) in enumerate(SUB_RAY_RINGS):
        turn = 2 * math.pi * (np.arange(count) + 0.25 * ring) / count
        places.append(radius * np.stack([np.cos(turn), np.sin(turn)], axis=1))
        inner = max(radius - 0.25, 0.0)
        ring_power = math.exp(-2 * inner**2) - math.exp(-2 * (radius + 0.25) ** 2)
        shares.append(np.full(count, ring_power / count))
    share = np.concatenate(shares)
    return np.concatenate(places), share / share.sum()


def _unit(elevation: NDArray[np.float64], azimuth: NDArray[np.float64]) -> NDArray[np.float64]:
    level = np.cos(elevation)
    return np.stack(
        np.broadcast_arrays(level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)), axis=-1
    )
