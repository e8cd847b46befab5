"""What a scan campaign is to this library: stations, and a stream of returns that each know their station."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Grid:
    """The regular grid of an organised scan: which directions were shot, whether or not a return came back."""

    rows: int
    columns: int


@dataclass(frozen=True)
class Station:
    """One set-up of a scanner.

    ``position`` and ``rotation`` are the pose: scan frame = rotation @ sensor frame + position.
    """

    name: str
    position: NDArray[np.float64]
    """(3,) metres, scan frame."""
    rotation: NDArray[np.float64] = field(default_factory=lambda: np.eye(3))
    """(3, 3)"""
    known: bool = True
    """False: the file names no scanner position, so ``position`` is no more than a place-holder and no ray is known."""
    grid: Grid | None = None
    sensor: str = ""
    acquired: str = ""
    """ISO 8601 date and time, or empty."""
    block: str = ""
    """Of a camera: the block of photos that it was adjusted with. All cameras of a block have one registration."""


@dataclass(frozen=True)
class ReturnBlock:
    """Consecutive returns of one station. Arrays that the file does not have are None."""

    station: int
    """Index into the source's ``stations``."""
    offsets: NDArray[np.float64]
    """(N, 3) metres: return minus station position, axes of the scan frame (rotation applied)."""
    intensity: NDArray[np.float32] | None = None
    """(N,) as in the file, not scaled."""
    color: NDArray[np.uint8] | None = None
    """(N, 3)"""
    row: NDArray[np.int32] | None = None
    column: NDArray[np.int32] | None = None
    normal: NDArray[np.float32] | None = None
    """(N, 3) unit normals that the file gives, axes of the scan frame; only where attributes are asked for."""
    photo: NDArray[np.float64] | None = None
    """(N, 3) of tie points: standard deviation along the ray, the part of it that neighbours share [m], and the point's
    number. Always given."""
    extra: Mapping[str, NDArray] | None = None
    """Columns of an extension, to be written (int32 or float32): name ``prefix:field`` -> (N,). Readers give none."""


@dataclass
class DropCount:
    """Points that were read and are no returns."""

    invalid: int = 0
    """Marked invalid by the file (E57 invalid state, LAS withheld flag)."""
    zero: int = 0
    """At the scanner's own centre (0, 0, 0 in the sensor frame, as some exporters write a missing return)."""
    not_finite: int = 0

    @property
    def total(self) -> int:
        return self.invalid + self.zero + self.not_finite


class ScanSource(Protocol):
    """One opened scan file (or several, chained)."""

    @property
    def paths(self) -> tuple[str, ...]: ...

    @property
    def stations(self) -> tuple[Station, ...]: ...

    @property
    def point_count(self) -> int:
        """Points in the file, before any is dropped."""
        ...

    @property
    def dropped(self) -> DropCount:
        """Filled while ``blocks`` is read to its end; each full read starts it anew."""
        ...

    def blocks(self, block_size: int = 262_144, *, attributes: bool = False) -> Iterator[ReturnBlock]:
        """Stream all returns, at most ``block_size`` at a time, in the file's order; may be called again.

        Only offsets are read unless ``attributes`` asks for intensity, colour, row and column too.
        """
        ...
