"""What a scan file holds, for people and for programs."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .open import open_scan_file


@dataclass
class _Tally:
    returns: int = 0
    low: NDArray[np.float64] = field(default_factory=lambda: np.full(3, np.inf))
    high: NDArray[np.float64] = field(default_factory=lambda: np.full(3, -np.inf))
    farthest: float = 0.0
    intensity: bool = False
    color: bool = False


def describe(path: str | Path) -> dict[str, Any]:
    """Read a scan file to its end and say what it holds; lengths in metres, scan frame. The result fits into JSON.

    Raises BimVerifyError when the file is missing, of no known format, damaged or empty.
    """
    file = open_scan_file(path)
    tallies = [_Tally() for _ in file.stations]
    for block in file.blocks(attributes=True):
        tally = tallies[block.station]
        tally.returns += len(block.offsets)
        tally.low = np.minimum(tally.low, block.offsets.min(axis=0))
        tally.high = np.maximum(tally.high, block.offsets.max(axis=0))
        tally.farthest = max(tally.farthest, float(np.sqrt(np.einsum("ij,ij->i", block.offsets, block.offsets).max())))
        tally.intensity |= block.intensity is not None
        tally.color |= block.color is not None
    stations = []
    lows, highs = [], []
    for station, tally, points in zip(file.stations, tallies, file.points_per_station, strict=True):
        bounds = None
        if tally.returns:
            lows.append(tally.low + station.position)
            highs.append(tally.high + station.position)
            bounds = [lows[-1].tolist(), highs[-1].tolist()]
        stations.append(
            {
                "name": station.name,
                "position": station.position.tolist() if station.known else None,
                "rotation": station.rotation.tolist() if station.known else None,
                "grid": [station.grid.rows, station.grid.columns] if station.grid else None,
                "points": points,
                "returns": tally.returns,
                "bounds": bounds,
                "farthest": tally.farthest if station.known else None,
                "intensity": tally.intensity,
                "color": tally.color,
                "sensor": station.sensor,
                "acquired": station.acquired,
            }
        )
    dropped = file.dropped
    return {
        "path": str(path),
        "format": file.format,
        "points": file.point_count,
        "returns": sum(tally.returns for tally in tallies),
        "dropped": {"invalid": dropped.invalid, "zero": dropped.zero, "not_finite": dropped.not_finite},
        "bounds": [np.min(lows, axis=0).tolist(), np.max(highs, axis=0).tolist()],
        "stations": stations,
    }


def format_description(description: dict[str, Any]) -> str:
    """Lines for people, of what ``describe`` found."""
    dropped = description["dropped"]
    stations = description["stations"]
    low, high = description["bounds"]
    lost = ", ".join(f"{count:,} {name.replace('_', ' ')}" for name, count in dropped.items() if count) or "none"
    lines = [
        f"{description['path']}: {description['format']}, {_count(len(stations), 'station')}, "
        f"{description['returns']:,} returns of {_count(description['points'], 'point')} (dropped: {lost})",
        f"  x {low[0]:z.3f} to {high[0]:z.3f}, y {low[1]:z.3f} to {high[1]:z.3f}, z {low[2]:z.3f} to {high[2]:z.3f} m",
    ]
    for station in stations:
        parts = [f"{station['returns']:,} returns"]
        if station["position"] is None:
            parts.append("scanner position unknown")
        else:
            parts.append("at " + ", ".join(f"{value:z.3f}" for value in station["position"]) + " m")
            parts.append(f"up to {station['farthest']:.1f} m away")
        if station["grid"]:
            parts.append(f"grid of {station['grid'][0]} rows and {station['grid'][1]} columns")
        parts += [word for word, key in (("intensity", "intensity"), ("colour", "color")) if station[key]]
        parts += [station[key] for key in ("sensor", "acquired") if station[key]]
        lines.append(f"  {_printable(station['name'])}: " + ", ".join(_printable(part) for part in parts))
    return "\n".join(lines)


def _count(number: int, noun: str) -> str:
    return f"{number:,} {noun}" + ("" if number == 1 else "s")


def _printable(text: str) -> str:
    """Names from a file, without what a terminal would act upon."""
    return "".join(character if character.isprintable() else "?" for character in text)
