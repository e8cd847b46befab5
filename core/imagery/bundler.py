"""Cameras and tie points of a Bundler file (``bundle.out``, version 0.3), which Metashape and others export.

Bundler's camera looks along -z with y up; its pixels count from the middle of the image, to the right and up. It holds no
size of the images: it is stated, or taken so large that all observations lie inside.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import BimVerifyError
from .bundle_problem import BundleProblem, ImageObservations
from .camera import PHOTOGRAMMETRIC, Camera, Interior
from .cameras_file import LARGEST_FILE, check_lens, proper_rotation

MARK = "# Bundle file v"
CAMERA_ROWS = 5
Floats = NDArray[np.float64]


def read_bundler(path: str | Path, sigma: float, size: Floats | None = None) -> BundleProblem:
    """The bundle problem in a Bundler file; observations of ``sigma`` pixels, images of ``size`` (2,) pixels.

    Images are named by ``list.txt`` beside it, one a line, where there is one. Raises BimVerifyError.
    """
    source = Path(path)
    try:
        if source.stat().st_size > LARGEST_FILE:
            raise BimVerifyError(f"{source} is larger than {LARGEST_FILE >> 30} GB; split the block.")
        lines = source.read_text(encoding="ascii", errors="replace").splitlines()
    except OSError as error:
        raise BimVerifyError(f"Cannot read {source}: {error.strerror or error}. Check the path.") from error
    if not lines or not lines[0].startswith(MARK):
        raise BimVerifyError(f"{source} is no Bundler file; its first line must begin with {MARK!r}.")
    try:
        return _problem(lines[1:], sigma, size, _names(source), source.name)
    except (ValueError, IndexError, OverflowError) as error:
        raise BimVerifyError(f"{source} is cut off or damaged ({error}); export it again.") from error


def _names(source: Path) -> list[str]:
    try:
        rows = (source.parent / "list.txt").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return []
    return [Path(row.split()[0]).name[:1000] for row in rows if row.strip()]


def _problem(lines: list[str], sigma: float, size: Floats | None, names: list[str], where: str) -> BundleProblem:
    images, count = (int(word) for word in lines[0].split())
    if images < 1 or count < 1 or CAMERA_ROWS * images + 3 * count > len(lines):
        raise ValueError("it announces more than it holds")
    table = [np.array(row.split(), dtype=np.float64) for row in lines[1 : 1 + CAMERA_ROWS * images]]
    points, camera, point, pixel = np.empty((count, 3)), [], [], []
    for k in range(count):
        at = 1 + CAMERA_ROWS * images + 3 * k
        points[k] = np.array(lines[at].split(), dtype=np.float64)
        track = np.array(lines[at + 2].split(), dtype=np.float64)
        rows = track[1:].reshape(int(track[0]), 4)
        camera.append(rows[:, 0].astype(np.int64))
        point.append(np.full(len(rows), k))
        pixel.append(rows[:, 2:] * [1.0, -1.0])
    seen, xy = np.concatenate(camera), np.concatenate(pixel)
    if len(seen) and (seen.min() < 0 or seen.max() >= images):
        raise ValueError("an observation names a camera that is not there")
    half = np.abs(xy).max(axis=0, initial=1.0) if size is None else size / 2.0
    width, height = (int(np.ceil(2 * h)) for h in half)
    middle = np.array([(width - 1) / 2.0, (height - 1) / 2.0])
    cameras, used = [], []
    for k in range(images):
        (f, k1, k2), *turns, shift = table[CAMERA_ROWS * k : CAMERA_ROWS * (k + 1)]
        used.append(f != 0)
        if f == 0:
            continue  # not aligned
        lens = Interior(width, height, f, f, middle[0], middle[1], (k1, k2, 0.0, 0.0, 0.0))
        name = names[k] if k < len(names) else f"image {k}"
        check_lens(lens, f"{where}, camera {k}")
        turn = proper_rotation(np.array(turns).reshape(3, 3), f"{where}, camera {k}")
        cameras.append(Camera(name, lens, PHOTOGRAMMETRIC @ turn, -turn.T @ shift))
    renumbered = np.cumsum(used) - 1
    kept = np.array(used)[seen]
    number = np.concatenate(point)[kept]
    rows_of = np.bincount(number, minlength=count)
    enough = rows_of >= 2
    fine = enough[number]
    lenses = tuple(dict.fromkeys(c.interior for c in cameras))
    observed = ImageObservations(
        renumbered[seen[kept][fine]], (np.cumsum(enough) - 1)[number[fine]], xy[kept][fine] + middle,
        np.full(int(fine.sum()), sigma),
    )
    return BundleProblem(
        tuple(cameras), lenses, np.array([lenses.index(c.interior) for c in cameras], dtype=np.int64), points[enough], observed
    )
