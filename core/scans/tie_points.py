"""Tie points of an adjusted bundle as returns: every camera that observes a point has a ray to it.

The projection centre stands for the scanner, as in Meyer (2023) 5.1.2: one body of evidence per observing camera. Each return
knows its point's own standard deviation.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ..imagery.block_points import BlockPoints, read_block
from ..results import CAMERA_SENSOR
from .campaign import Station
from .scan_file import Columns, ScanFile, scan_frame_setup

SMALLEST_SIGMA_M = 1e-5


class TiePointFile(ScanFile):
    """A bundle project, COLMAP folder or Bundler file (see ``imagery.block_points``); observations that the adjustment took
    out give no ray."""

    format = "bundle"
    block: BlockPoints

    def __init__(self, path: Path) -> None:
        self.block = read_block(path)
        order = np.lexsort((self.block.point, self.block.camera))
        self._camera, self._point = self.block.camera[order], self.block.point[order]
        count = np.bincount(self._camera, minlength=len(self.block.cameras))
        self._first = np.concatenate([[0], np.cumsum(count)])
        block = str(path.resolve())
        setups = [
            scan_frame_setup(Station(c.name, np.asarray(c.position), c.rotation.T, sensor=CAMERA_SENSOR, block=block))
            for c in self.block.cameras
        ]
        super().__init__(path, setups, [int(n) for n in count])

    def columns(self, station: int, block_size: int, attributes: bool) -> Iterator[Columns]:
        centre = self.block.cameras[station].position
        for start in range(int(self._first[station]), int(self._first[station + 1]), block_size):
            rows = self._point[start : min(start + block_size, int(self._first[station + 1]))]
            point = self.block.points[rows]
            ray = point - centre
            ray /= np.maximum(np.linalg.norm(ray, axis=1, keepdims=True), 1e-12)
            along = np.sqrt(np.einsum("pi,pij,pj->p", ray, self.block.covariance[rows], ray))
            photo = np.column_stack([np.maximum(along, SMALLEST_SIGMA_M), self.block.shared_sigma[rows], rows])
            x, y, z = point.T
            yield Columns(x, y, z, photo=photo)
