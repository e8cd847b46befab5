"""Cameras and tie points of a COLMAP model, text or binary.

COLMAP counts pixels from the corner of the image, this project from the middle of its first pixel: half a pixel less.
"""

from __future__ import annotations

import io
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import BimVerifyError
from .bundle_problem import BundleProblem, ImageObservations
from .camera import Camera, Interior
from .cameras_file import check_lens, rotation_of_quaternion

HALF_PIXEL = 0.5
LARGEST_FILE = 4 * 2**30
MODELS = {
    0: ("SIMPLE_PINHOLE", 3), 1: ("PINHOLE", 4), 2: ("SIMPLE_RADIAL", 4), 3: ("RADIAL", 5), 4: ("OPENCV", 8),
    5: ("OPENCV_FISHEYE", 8), 6: ("FULL_OPENCV", 12),
}
MOST_IMAGES = 1_000_000
Floats = NDArray[np.float64]


@dataclass(frozen=True)
class _Image:
    name: str
    camera: int
    rotation: Floats
    position: Floats
    pixel: Floats
    point: NDArray[np.int64]


def read_colmap(folder: str | Path, sigma: float) -> BundleProblem:
    """The model in ``folder`` (cameras, images, points3D; .bin or .txt) as a bundle problem; observations of ``sigma`` pixels.

    Raises BimVerifyError when a file is missing, cut off, or uses a camera model that is not supported.
    """
    place = Path(folder)
    binary = (place / "cameras.bin").exists()
    suffix = ".bin" if binary else ".txt"
    data = {name: _content(place / f"{name}{suffix}") for name in ("cameras", "images", "points3D")}
    try:
        if binary:
            lenses = dict(_cameras_binary(io.BytesIO(data["cameras"])))
            images = list(_images_binary(io.BytesIO(data["images"])))
            ids, points = _points_binary(io.BytesIO(data["points3D"]))
        else:
            lenses = dict(_cameras_text(_lines(data["cameras"])))
            images = list(_images_text(_lines(data["images"], keep_empty=True)))
            ids, points = _points_text(_lines(data["points3D"]))
    except (struct.error, ValueError, IndexError, OverflowError, UnicodeDecodeError) as error:
        raise BimVerifyError(f"{place} is no COLMAP model that can be read ({str(error)[:80]}); export it again.") from error
    if not images or not len(points):
        raise BimVerifyError(f"{place} holds no images or no points; there is nothing to adjust.")
    unknown = {i.camera for i in images} - set(lenses)
    if unknown:
        raise BimVerifyError(f"{place}: an image names the camera {min(unknown)}, which is not there.")
    images.sort(key=lambda i: i.name)
    for key, lens in lenses.items():
        check_lens(lens, f"Camera {key} of {place.name}")
    keys = sorted(lenses)
    row = {key: k for k, key in enumerate(keys)}
    order = np.argsort(ids)
    camera, point, pixel = [], [], []
    for k, image in enumerate(images):
        at = np.searchsorted(ids[order], image.point)
        known = (image.point >= 0) & (at < len(ids))
        known[known] &= ids[order][at[known]] == image.point[known]
        camera.append(np.full(int(known.sum()), k))
        point.append(order[at[known]])
        pixel.append(image.pixel[known] - HALF_PIXEL)
    where = np.concatenate(point)
    enough = np.bincount(where, minlength=len(points)) >= 2
    new = np.cumsum(enough) - 1
    kept = enough[where]
    cameras = tuple(Camera(i.name, lenses[i.camera], i.rotation, i.position) for i in images)
    observed = ImageObservations(
        np.concatenate(camera)[kept].astype(np.int64), new[where[kept]].astype(np.int64), np.concatenate(pixel)[kept],
        np.full(int(kept.sum()), sigma),
    )
    return BundleProblem(
        cameras, tuple(lenses[key] for key in keys), np.array([row[i.camera] for i in images], dtype=np.int64), points[enough],
        observed,
    )


def _content(path: Path) -> bytes:
    try:
        if path.stat().st_size > LARGEST_FILE:
            raise BimVerifyError(f"{path} is larger than {LARGEST_FILE >> 30} GB; split the block.")
        return path.read_bytes()
    except OSError as error:
        raise BimVerifyError(
            f"Cannot read {path}: {error.strerror or error}. A COLMAP model has cameras, images and points3D."
        ) from error


def _lens(model: str, width: int, height: int, p: Floats) -> Interior:
    h = HALF_PIXEL
    if model == "SIMPLE_PINHOLE":
        return Interior(width, height, p[0], p[0], p[1] - h, p[2] - h)
    if model == "PINHOLE":
        return Interior(width, height, p[0], p[1], p[2] - h, p[3] - h)
    if model == "SIMPLE_RADIAL":
        return Interior(width, height, p[0], p[0], p[1] - h, p[2] - h, (p[3], 0.0, 0.0, 0.0, 0.0))
    if model == "RADIAL":
        return Interior(width, height, p[0], p[0], p[1] - h, p[2] - h, (p[3], p[4], 0.0, 0.0, 0.0))
    if model == "OPENCV":
        return Interior(width, height, p[0], p[1], p[2] - h, p[3] - h, (p[4], p[5], p[6], p[7], 0.0))
    if model == "FULL_OPENCV" and not np.any(p[9:12]):
        return Interior(width, height, p[0], p[1], p[2] - h, p[3] - h, (p[4], p[5], p[6], p[7], p[8]))
    raise BimVerifyError(f"COLMAP's camera model {model[:40]} is not supported; use OPENCV, RADIAL or PINHOLE.")


def _lines(data: bytes, keep_empty: bool = False) -> list[str]:
    lines = [line.strip() for line in data.decode("utf-8").splitlines()]
    return [line for line in lines if not line.startswith("#") and (line or keep_empty)]


def _cameras_text(lines: list[str]) -> Iterator[tuple[int, Interior]]:
    for line in lines:
        key, model, width, height, *p = line.split()
        yield int(key), _lens(model, int(width), int(height), np.array(p, dtype=np.float64))


def _images_text(lines: list[str]) -> Iterator[_Image]:
    for k in range(0, len(lines) - 1, 2):
        if not lines[k]:
            continue
        head = lines[k].split(maxsplit=9)
        rows = np.array(lines[k + 1].split(), dtype=np.float64).reshape(-1, 3)
        q, t = np.array(head[1:5], dtype=np.float64), np.array(head[5:8], dtype=np.float64)
        yield _image(head[9], int(head[8]), q, t, rows[:, :2], rows[:, 2].astype(np.int64))


def _points_text(lines: list[str]) -> tuple[NDArray[np.int64], Floats]:
    parts = [line.split(maxsplit=4)[:4] for line in lines]
    rows = np.array([[float(v) for v in p[1:]] for p in parts]).reshape(-1, 3)
    return np.array([int(p[0]) for p in parts], dtype=np.int64), rows


def _image(name: str, camera: int, q: Floats, t: Floats, pixel: Floats, point: NDArray[np.int64]) -> _Image:
    rotation = rotation_of_quaternion(q)
    return _Image(name, camera, rotation, -rotation.T @ t, pixel, point)


def _unpack(stream: io.BytesIO, form: str) -> tuple[Any, ...]:
    size = struct.calcsize("<" + form)
    return struct.unpack("<" + form, stream.read(size))


def _count(stream: io.BytesIO, least_bytes: int) -> int:
    """A count that the rest of the file can hold."""
    (count,) = _unpack(stream, "Q")
    if count * least_bytes > len(stream.getbuffer()) - stream.tell():
        raise ValueError("a count is larger than the file")
    return int(count)


def _cameras_binary(stream: io.BytesIO) -> Iterator[tuple[int, Interior]]:
    for _ in range(_count(stream, 24)):
        key, model, width, height = _unpack(stream, "iiQQ")
        name, count = MODELS.get(model, (f"number {model}", 0))
        yield key, _lens(name, width, height, np.array(_unpack(stream, f"{count}d")))


def _images_binary(stream: io.BytesIO) -> Iterator[_Image]:
    for _ in range(_count(stream, 73)):
        _, *pose, camera = _unpack(stream, "I7dI")
        name = bytearray()
        while (letter := stream.read(1)) not in (b"\0", b""):
            name += letter
        count = _count(stream, 24)
        rows = np.frombuffer(stream.read(24 * count), dtype=[("xy", "<f8", 2), ("point", "<i8")])
        yield _image(
            name.decode("utf-8"), camera, np.array(pose[:4]), np.array(pose[4:]), rows["xy"].copy(), rows["point"].copy()
        )


def _points_binary(stream: io.BytesIO) -> tuple[NDArray[np.int64], Floats]:
    ids, points = [], []
    for _ in range(_count(stream, 51)):
        key, x, y, z, *_ = _unpack(stream, "Q3d3Bd")
        (track,) = _unpack(stream, "Q")
        stream.seek(8 * track, io.SEEK_CUR)
        ids.append(key)
        points.append((x, y, z))
    return np.array(ids, dtype=np.int64), np.array(points).reshape(-1, 3)
