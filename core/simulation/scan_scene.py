"""Scan any scene of triangles, from anywhere (a model or not): an E57 with poses and the truth of every return."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import BimVerifyError
from ..files import check_writable, whole_file
from ..progress import Progress
from ..scans.campaign import ReturnBlock, Station
from ..scans.write_e57 import write_e57
from .campaign import ACQUIRED, FILE_RESOLUTION_M, set_up
from .return_truth import truth_columns
from .scanner import Scanner, scan_bands
from .scene import Scene


@dataclass(frozen=True)
class SceneStation:
    """A levelled set-up; position (3,) [m, scene frame]."""

    name: str
    position: NDArray[np.float64]


@dataclass(frozen=True)
class WrittenScan:
    """What was written."""

    path: Path
    returns: int
    hits: dict[str, int]
    """Name of an object -> its returns."""


def scan_scene(
    scene: Scene, stations: Sequence[SceneStation], scanner: Scanner, path: str | Path, *,
    origin: NDArray[np.float64] | None = None, seed: int = 0, truth: str | Path | None = None,
    progress: Progress | None = None,
) -> WrittenScan:
    """Scan and write the E57; ``origin`` (3,) [m] is added to all positions. ``truth``: a JSON of the names of the owners.

    Raises BimVerifyError when nothing comes back, or a file cannot be written.
    """
    progress = progress or Progress()
    base = np.zeros(3) if origin is None else np.asarray(origin, dtype=np.float64)
    for target in (path, truth):
        if target is not None:
            check_writable(target)
    hits = np.zeros(len(scene.names), dtype=np.int64)
    setups = [set_up(s.name, s.position, seed, k) for k, s in enumerate(stations)]
    written = [
        Station(
            name=s.name, position=s.position + base, rotation=s.rotation, grid=scanner.grid,
            sensor=f"bim_verify simulated scanner ({scanner.name})", acquired=ACQUIRED,
        )
        for s in setups
    ]

    def blocks() -> Iterator[ReturnBlock]:
        for index, s in enumerate(setups):
            own = int(np.random.default_rng((seed, 5, index)).integers(2**31))
            for band in scan_bands(scene, s.position, s.rotation, scanner, own):
                if not len(band):
                    continue
                hits[:] += np.bincount(band.owner, minlength=len(hits))
                progress.update((index + int(band.row[-1]) / scanner.grid.rows) / len(setups), f"Scanning from {s.name}")
                yield ReturnBlock(
                    station=index, offsets=band.offset @ s.rotation.T, intensity=band.intensity, row=band.row,
                    column=band.column, extra=truth_columns(band),
                )
        if not hits.any():
            raise BimVerifyError("No station sees anything of the scene; positions are metres in the scene's own frame.")

    write_e57(path, written, blocks(), scaled_integer_m=FILE_RESOLUTION_M)
    found = {name: int(n) for name, n in zip(scene.names, hits, strict=True) if n}
    if truth is not None:
        content = {
            "owners": list(scene.names), "hits": found, "scanner": scanner.name,
            "step_deg": math.degrees(scanner.angular_step), "stations": [(s.position + base).tolist() for s in setups],
        }
        with whole_file(truth) as temporary:
            temporary.write_text(json.dumps(content, indent=1), encoding="utf-8")
    return WrittenScan(Path(path), int(hits.sum()), found)
