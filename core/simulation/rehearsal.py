"""The demo's kernels compiled ahead, in a process of its own, while the demo still simulates.

On a new machine numba compiles each kernel at its first call, one after the other on one core: about a minute of the demo.
Another process runs the same jobs on two boxes meanwhile and leaves the compiled kernels in numba's cache.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np


@contextmanager
def kernels_ahead() -> Iterator[None]:
    """Rehearse in another process while the body runs. Without such a process the kernels are compiled when needed."""
    try:
        process = subprocess.Popen(
            [sys.executable, "-m", __name__], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
    except OSError:
        yield
        return
    try:
        yield
    finally:
        process.kill()
        process.wait()


def rehearse() -> None:
    """Run what the demo runs, from the returns on, on a room of two boxes."""
    from ..jobs import change, verify
    from ..options import ChangeOptions, VerifyOptions
    from .box_building import box, building_model, scan

    planned = [
        box("floor", (0.0, 0.0, -0.2), (3.0, 3.0, 0.0)), box("wall", (0.0, 3.0, -0.2), (3.0, 3.2, 2.0)),
        box("chair", (1.0, 2.0, 0.0), (1.4, 2.4, 0.5)),
    ]
    model = building_model(planned)
    stations = np.array([[1.0, 1.0, 1.2], [2.0, 1.0, 1.2]])
    first = scan(building_model([planned[0], planned[1].moved(np.array([0.0, 0.05, 0.0]))]), stations, step_deg=1.0)
    later = scan(building_model([planned[0], box("crate", (2.0, 2.0, 0.0), (2.5, 2.5, 0.5))]), stations, step_deg=1.0)
    verify(model, first, VerifyOptions(sample_spacing=0.1, threads=1, cache=False))
    change(model, [later], first, ChangeOptions(voxel=0.05, sample_spacing=0.1, threads=1, cache=False))


if __name__ == "__main__":
    rehearse()
