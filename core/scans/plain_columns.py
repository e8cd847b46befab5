"""Which columns of a table without names, or with them, hold coordinates, intensity and colour."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .scan_file import Columns

_NAMES = {
    "x": "x", "y": "y", "z": "z", "easting": "x", "northing": "y", "elevation": "z", "height": "z",
    "i": "intensity", "intensity": "intensity", "scalar_intensity": "intensity", "reflectance": "intensity",
    "r": "red", "g": "green", "b": "blue", "red": "red", "green": "green", "blue": "blue",
    "diffuse_red": "red", "diffuse_green": "green", "diffuse_blue": "blue", "rf": "red", "gf": "green", "bf": "blue",
}


@dataclass(frozen=True)
class ColumnUse:
    """Column numbers."""

    xyz: tuple[int, int, int] = (0, 1, 2)
    intensity: int | None = None
    rgb: tuple[int, int, int] | None = None

    @property
    def last(self) -> int:
        return max(*self.xyz, *(() if self.intensity is None else (self.intensity,)), *(self.rgb or ()))

    def columns(self, table: NDArray[np.float64], attributes: bool, unit_colors: bool = False) -> Columns:
        """Columns of a (N, C) table. ``unit_colors``: colours go from 0 to 1."""
        x, y, z = (table[:, k] for k in self.xyz)
        intensity = color = None
        if attributes and self.intensity is not None:
            intensity = table[:, self.intensity].astype(np.float32)
        if attributes and self.rgb is not None:
            color = as_bytes(table[:, self.rgb], 1.0 if unit_colors else 255.0)
        return Columns(x, y, z, intensity=intensity, color=color)


def as_bytes(color: NDArray, full: float) -> NDArray[np.uint8]:
    """Colours from 0 to ``full`` as 0 to 255; what is not finite becomes 0."""
    values = color if full == 255.0 else np.asarray(color, np.float64) * (255.0 / full)
    return np.clip(np.round(np.nan_to_num(values)), 0, 255).astype(np.uint8)


def by_name(names: Sequence[str]) -> ColumnUse | None:
    """From column names of any case; None without x, y and z."""
    found: dict[str, int] = {}
    for number, name in enumerate(names):
        meaning = _NAMES.get(name.strip().strip("\"'").split("[")[0].split("(")[0].strip().lower())
        if meaning:
            found.setdefault(meaning, number)
    if not {"x", "y", "z"} <= found.keys():
        return None
    rgb = (found["red"], found["green"], found["blue"]) if {"red", "green", "blue"} <= found.keys() else None
    return ColumnUse((found["x"], found["y"], found["z"]), found.get("intensity"), rgb)


def by_content(sample: NDArray[np.float64]) -> ColumnUse:
    """x y z [intensity] [red green blue] from the first rows (N, C) of a table without names.

    Three neighbouring columns of whole numbers from 0 to 255, not all alike, are colours; other columns after an
    intensity (normals, labels) are left alone.
    """
    columns = sample.shape[1]
    is_byte = (sample >= 0).all(axis=0) & (sample <= 255).all(axis=0) & (sample == np.round(sample)).all(axis=0)
    if columns >= 7 and is_byte[4:7].all():
        return ColumnUse(intensity=3, rgb=(4, 5, 6))
    if columns >= 6 and is_byte[3:6].all():
        return ColumnUse(rgb=(3, 4, 5), intensity=6 if columns == 7 else None)
    return ColumnUse(intensity=3 if columns in (4, 7) else None)
