# ruff: noqa: NPY002  (compiled code has no generators that threads could own)
"""Expected error of the as-built model of a component, from the spacing and the noise of its returns.

For each class of component and size a table over 35 spacings and 10 noise levels is made once, by scattering points over
the component, adding noise (normal on the surface, a generalised Gaussian near its edges) and modelling it again; it is
kept in the user's cache and interpolated.
"""

from __future__ import annotations

import contextlib
import hashlib
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from ..files import whole_file
from ..model import tessellation_cache
from .faces import Face
from .remodel import GATE_NOISES, remodel

Array = NDArray[np.float64]
ComponentClass = Literal["surface", "outline"]
SPACINGS_M: Array = np.concatenate([np.arange(5, 101, 5), np.arange(110, 251, 10)]) / 1000.0
NOISES_M: Array = np.array([0.1, 0.5, 1, 2, 4, 6, 8, 10, 20, 30]) / 1000.0
EDGE_SHAPES: Array = np.array([2, 1.75, 1.5, 1.25, 1, 0.75, 0.5, 0.5, 0.5, 0.5])
"""Shape of the noise near edges at each level: normal at the smallest, beyond Laplace at the largest."""
EDGE_NOISE = 1.5
"""Standard deviation near edges against that on the surface."""
EDGE_ZONE_M = 0.01
SIDES_M = (0.05, 0.1, 0.2, 0.4, 0.8, 1.6, 3.2)
"""Sizes of the tables; beyond the largest, more surface changes little."""
POINTS_PER_CELL = 400_000
RUNS = (3, 32)
"""Least and most scatters of a cell."""
VERSION = 5
MEAN_OF_NORMAL = math.sqrt(2.0 / math.pi)
"""E|x| of a standard normal variable."""
BOUNDED_BY_NEIGHBOURS = (
    "IfcWall", "IfcWallStandardCase", "IfcWallElementedCase", "IfcSlab", "IfcSlabStandardCase", "IfcRoof", "IfcCovering",
    "IfcCurtainWall", "IfcFooting", "IfcRamp", "IfcRampFlight", "IfcPavement", "IfcCourse", "IfcEarthworksElement",
)
"""Modelled as planes that end where the next one begins; all others are drawn by their outline."""


def component_class(ifc_class: str) -> ComponentClass:
    """``surface``: what counts is the plane (T3's walls); ``outline``: the sides as well (its openings)."""
    return "surface" if ifc_class in BOUNDED_BY_NEIGHBOURS else "outline"


@dataclass(frozen=True)
class ErrorTable:
    """Expected errors (35, 10) [m] over ``SPACINGS_M`` and ``NOISES_M``; NaN where no model can be made."""

    surface: Array
    outline: Array

    def expected(self, kind: ComponentClass, spacing: float, noise: float, across: Sequence[float] = ()) -> float:
        """Mean error [m] of a component: of its plane, or of its corners (plane and two sides). NaN where unknown.

        ``across``: distances between returns across the sides that are drawn; without them, the spacing. Bilinear in the
        spacing and the noise; beyond the ends of the table the end holds, below the smallest spacing it goes on in
        proportion.
        """
        if not (math.isfinite(spacing) and math.isfinite(noise)):
            return math.nan
        surface = _interpolate(self.surface, spacing, noise)
        if kind == "surface":
            return surface
        sides = [min(s / SPACINGS_M[0], 1.0) * _interpolate(self.outline, s, noise) for s in across or (spacing,)]
        return math.hypot(surface, math.sqrt(2.0) * sum(sides) / len(sides))


def with_registration(error: float, registration: float, stations: float | None, place: float = 0.0) -> float:
    """The error with what the registration of the stations adds to it: they share none, so their mean is better; they share
    the sigma of their ``place`` [m]."""
    return math.hypot(error, MEAN_OF_NORMAL * registration / math.sqrt(max(stations or 1.0, 1.0)), MEAN_OF_NORMAL * place)


def table_for(face: Face, *, cache: bool = True) -> ErrorTable:
    """The table of a component's size, made if it is not in the cache."""
    short, long = sorted((face.width, face.height))
    return _table(_nearest_side(short), _nearest_side(long), cache)


_made: dict[tuple[float, float], ErrorTable] = {}


def _table(short: float, long: float, cache: bool) -> ErrorTable:
    key = (short, long)
    if key not in _made:
        found = _read(key) if cache else None
        if found is None:
            found = make_table(short, long)
            if cache:
                _write(key, found)
        _made[key] = found
    return _made[key]


def make_table(width: float, height: float, seed: int = 0) -> ErrorTable:
    """Simulate and model a component of this size [m] at all spacings and noise levels."""
    surface, outline = _simulate(width, height, SPACINGS_M, NOISES_M, EDGE_SHAPES, EDGE_NOISE, EDGE_ZONE_M, seed)
    return ErrorTable(surface, outline)


def _nearest_side(side: float) -> float:
    return min(SIDES_M, key=lambda s: abs(math.log(max(side, 1e-6) / s)))


def _interpolate(table: Array, spacing: float, noise: float) -> float:
    i, x = _place(SPACINGS_M, spacing)
    j, y = _place(NOISES_M, noise)
    rows = (1 - x) * table[i] + (x * table[i + 1] if x > 0 else 0.0)
    return float((1 - y) * rows[j] + (y * rows[j + 1] if y > 0 else 0.0))


def _place(values: Array, value: float) -> tuple[int, float]:
    i = int(np.clip(np.searchsorted(values, value) - 1, 0, len(values) - 2))
    return i, float(np.clip((value - values[i]) / (values[i + 1] - values[i]), 0.0, 1.0))


@njit(cache=True, nogil=True, parallel=True)
def _simulate(width, height, spacings, noises, shapes, edge_noise, edge_zone, seed):  # type: ignore[no-untyped-def]
    cells = len(spacings) * len(noises)
    surface = np.full((len(spacings), len(noises)), np.nan)
    outline = np.full((len(spacings), len(noises)), np.nan)
    for cell in prange(cells):
        i, j = cell // len(noises), cell % len(noises)
        np.random.seed(seed * 1000 + cell)
        s = spacings[i]
        apart = np.full(4, s)
        size = int(width / s + 2) * int(height / s + 2)
        runs = min(max(POINTS_PER_CELL // size, RUNS[0]), RUNS[1])
        total_surface, total_outline, good = 0.0, 0.0, 0
        turn = np.random.randint(0, runs)
        for run in range(runs):
            first = s * (run + np.random.random()) / runs, s * ((run + turn) % runs + np.random.random()) / runs
            u, v, w = _scatter(width, height, s, first, noises[j], shapes[j], edge_noise, edge_zone)
            if len(u) < 4:
                continue
            e_surface, sides = remodel(u, v, w, width, height, apart, apart, GATE_NOISES * noises[j])
            e_outline = sides.mean()
            if np.isfinite(e_surface) and np.isfinite(e_outline):
                total_surface += e_surface
                total_outline += e_outline
                good += 1
        if 2 * good >= runs:
            surface[i, j] = total_surface / good
            outline[i, j] = total_outline / good
    return surface, outline


@njit(cache=True, nogil=True)
def _scatter(width, height, s, first, noise, shape, edge_noise, edge_zone):  # type: ignore[no-untyped-def]
    """Points of a scan of a rectangle: columns run along one side, rows are slanted, as a scanner's are."""
    slant = np.random.uniform(-0.3, 0.3)
    first_u, first_v = first
    columns = int((width - first_u) / s) + 1
    rows = int(height / s) + 2
    u, v, w = np.empty(columns * rows), np.empty(columns * rows), np.empty(columns * rows)
    alpha = edge_noise * noise * np.sqrt(_gamma(1.0 / shape) / _gamma(3.0 / shape))
    count = 0
    for c in range(columns):
        x = first_u + c * s
        shift = (first_v + slant * c * s) % s
        for r in range(rows):
            y = shift + r * s
            if x > width or y > height:
                continue
            if min(min(x, width - x), min(y, height - y)) < edge_zone:
                size = alpha * np.random.gamma(1.0 / shape, 1.0) ** (1.0 / shape)
                z = size if np.random.random() < 0.5 else -size
            else:
                z = noise * np.random.standard_normal()
            u[count], v[count], w[count] = x, y, z
            count += 1
    return u[:count], v[:count], w[:count]


@njit(cache=True, nogil=True)
def _gamma(x):  # type: ignore[no-untyped-def]
    return math.gamma(x)


def _path(key: tuple[float, float]) -> Path:
    text = f"{VERSION}|{key}|{SPACINGS_M.tolist()}|{NOISES_M.tolist()}|{EDGE_SHAPES.tolist()}|{EDGE_NOISE}|{EDGE_ZONE_M}"
    name = hashlib.sha256(text.encode()).hexdigest()[:24]
    return tessellation_cache.folder().parent / "prediction" / f"{name}.npz"


def _read(key: tuple[float, float]) -> ErrorTable | None:
    shape = (len(SPACINGS_M), len(NOISES_M))
    with contextlib.suppress(Exception), np.load(_path(key), allow_pickle=False) as stored:
        table = ErrorTable(stored["surface"], stored["outline"])
        if table.surface.shape == shape and table.outline.shape == shape:
            return table
    return None


def _write(key: tuple[float, float], table: ErrorTable) -> None:
    with contextlib.suppress(Exception):
        path = _path(key)
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(path) as temporary:
            np.savez(temporary, surface=table.surface, outline=table.outline)
