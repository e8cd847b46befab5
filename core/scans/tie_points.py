"""Tie points of an adjusted bundle as returns: every camera that observes a point has a ray to it.

The projection centre stands for the scanner, as in Meyer (2023) 5.1.2: one body of evidence per observing camera.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from .campaign import Station
from .scan_file import Columns, ScanFile, scan_frame_setup

MARK = b"bim_verify.bundle"
"""What the head of a bundle project holds."""


class TiePointFile(ScanFile):
    """A bundle project (see ``imagery.bundle_project``); observations that the adjustment took out give no ray."""

    format = "bundle"

    def __init__(self, path: Path) -> None:
        from ..imagery.bundle_project import kept_observations, read_project

        problem = read_project(path)
        camera, point = kept_observations(path, problem)
        order = np.lexsort((point, camera))
        self._point = point[order]
        count = np.bincount(camera, minlength=len(problem.cameras))
        self._first = np.concatenate([[0], np.cumsum(count)])
        self._points = problem.points
        setups = [
            scan_frame_setup(Station(c.name, np.asarray(c.position), c.rotation.T, sensor="camera")) for c in problem.cameras
        ]
        super().__init__(path, setups, [int(n) for n in count])

    def columns(self, station: int, block_size: int, attributes: bool) -> Iterator[Columns]:
        for start in range(int(self._first[station]), int(self._first[station + 1]), block_size):
            rows = self._point[start : min(start + block_size, int(self._first[station + 1]))]
            x, y, z = self._points[rows].T
            yield Columns(x, y, z)
