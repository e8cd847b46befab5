"""Fixed-size binary records of a file, read in blocks; shared by PLY and PCD."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import BimVerifyError
from .scan_file import Columns

Table = NDArray | Mapping[str, NDArray]
"""A structured array, or columns by name."""
_INTENSITY = ("intensity", "scalar_intensity", "reflectance", "scalar_reflectance", "i")
_ORIGINS = tuple(
    (pattern.format("x"), pattern.format("y"), pattern.format("z"))
    for pattern in ("{}_origin", "origin_{}", "{}origin", "scanner_{}", "sensor_{}", "scalar_{}_origin")
)
"""As mobile scanners' files call the place of the scanner."""
_COLORS = (
    ("red", "green", "blue"), ("r", "g", "b"), ("diffuse_red", "diffuse_green", "diffuse_blue"),
)
_NORMALS = (("nx", "ny", "nz"), ("normal_x", "normal_y", "normal_z"))


@dataclass(frozen=True)
class NamedFields:
    """Which fields (in the spelling of the file) hold coordinates, intensity and colour."""

    xyz: tuple[str, str, str]
    intensity: str | None
    rgb: tuple[str, str, str] | None
    origin: tuple[str, str, str] | None = None
    """Where the scanner was when it measured the point."""
    normal: tuple[str, str, str] | None = None

    def columns(self, table: Table, attributes: bool) -> Columns:
        """Pick from a block of records: a structured array, or columns by name."""
        x, y, z = (table[name].astype(np.float64) for name in self.xyz)
        intensity = color = None
        if attributes and self.intensity:
            intensity = table[self.intensity].astype(np.float32)
        if attributes and self.rgb:
            color = np.column_stack([channel_bytes(table[name]) for name in self.rgb])
        origin = None
        if self.origin:
            origin = np.column_stack([table[name].astype(np.float64) for name in self.origin])
        normal = None
        if attributes and self.normal:
            normal = np.column_stack([table[name].astype(np.float32) for name in self.normal])
        return Columns(x, y, z, intensity=intensity, color=color, normal=normal, origin=origin)


def channel_bytes(values: NDArray) -> NDArray[np.uint8]:
    """One colour channel as 0 to 255: bytes as they are, 16-bit halved in bits, floats from 0 to 1."""
    kind = values.dtype
    if kind.kind == "f":
        return np.clip(np.round(np.nan_to_num(values) * 255.0), 0, 255).astype(np.uint8)
    if kind.itemsize == 2 and kind.kind == "u":
        return (values >> 8).astype(np.uint8)
    return np.clip(values, 0, 255).astype(np.uint8)


def find_fields(path: Path, names: list[str]) -> NamedFields:
    """Raises BimVerifyError without x, y and z."""
    spelled = {name.lower(): name for name in reversed(names)}
    if not {"x", "y", "z"} <= spelled.keys():
        raise BimVerifyError(f"{path} has no x, y and z. Export the points with coordinates.")
    rgb = next((tuple(spelled[c] for c in triple) for triple in _COLORS if set(triple) <= spelled.keys()), None)
    return NamedFields(
        (spelled["x"], spelled["y"], spelled["z"]),
        next((spelled[name] for name in _INTENSITY if name in spelled), None),
        rgb,  # type: ignore[arg-type]
        find_origin(names),
        next((tuple(spelled[c] for c in triple) for triple in _NORMALS if set(triple) <= spelled.keys()), None),  # type: ignore[arg-type]
    )


def find_origin(names: Sequence[str]) -> tuple[str, str, str] | None:
    """The fields (in their own spelling) that say where the scanner was; None where there are none."""
    spelled = {name.lower(): name for name in reversed(names)}
    for x, y, z in _ORIGINS:
        if {x, y, z} <= spelled.keys():
            return spelled[x], spelled[y], spelled[z]
    return None


def read_binary(
    path: Path, at: int, count: int, dtype: np.dtype, block_size: int
) -> Iterator[NDArray]:
    """Stream ``count`` records from byte ``at``. Raises BimVerifyError when the file ends before."""
    with path.open("rb") as file:
        file.seek(at)
        done = 0
        while done < count:
            block = np.fromfile(file, dtype, min(block_size, count - done))
            if len(block) == 0:
                raise cut_off(path, count, done)
            done += len(block)
            yield block


def check_size(path: Path, at: int, count: int, dtype: np.dtype) -> None:
    """Raise BimVerifyError when ``count`` records from byte ``at`` do not fit into the file."""
    room = (path.stat().st_size - at) // dtype.itemsize
    if room < count:
        raise cut_off(path, count, max(room, 0))


def cut_off(path: Path, declared: int, found: int) -> BimVerifyError:
    return BimVerifyError(
        f"{path} is cut off: it declares {declared:,} points and holds {found:,}. Copy or export it again."
    )
