"""Cameras of a Metashape XML export.

Metashape counts pixels from the corner of the image and the principal point from its middle; its p1 and p2 are the other way
round. Its export holds no tie points.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from ..errors import BimVerifyError
from .camera import Camera, Interior
from .cameras_file import LARGEST_FILE, check_lens, numbers, proper_rotation

LARGEST_SHEAR_PX = 0.05


def read_metashape_cameras(path: str | Path) -> tuple[Camera, ...]:
    """Every aligned camera, in the frame that the export is in (metres). Raises BimVerifyError."""
    source = Path(path)
    try:
        if source.stat().st_size > LARGEST_FILE:
            raise BimVerifyError(f"{source} is too large for a Metashape camera export.")
        text = source.read_bytes()
    except OSError as error:
        raise BimVerifyError(f"Cannot read {source}: {error.strerror or error}. Check the path.") from error
    if b"<!DOCTYPE" in text or b"<!ENTITY" in text:
        raise BimVerifyError(f"{source} declares entities, which a Metashape export does not; it is not read.")
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise BimVerifyError(f"{source} is no XML file that can be read ({error}). Export the cameras again.") from error
    chunk = root.find("chunk") if root.tag == "document" else root
    if chunk is None or chunk.find("cameras") is None:
        raise BimVerifyError(f"{source} holds no cameras; export them from Metashape as Agisoft XML.")
    lenses = {s.get("id"): s for s in chunk.iterfind("sensors/sensor")}
    scale, turn, shift = _frame(chunk, source.name)
    cameras = []
    for entry in chunk.iterfind("cameras//camera"):
        name = str(entry.get("label") or "")[:1000]
        where = f"{source.name}, camera {name[:80]!r}"
        matrix = _numbers(entry.find("transform"), (4, 4), where)
        if matrix is None:
            continue
        sensor = lenses.get(entry.get("sensor_id"))
        if sensor is None:
            raise BimVerifyError(f"{source}: the camera {name[:80]!r} has no sensor; export the cameras again.")
        rotation = (turn @ proper_rotation(matrix[:3, :3], where)).T
        position = scale * turn @ matrix[:3, 3] + shift
        cameras.append(Camera(name, _lens(sensor, f"{source.name}, sensor of {name[:80]!r}"), rotation, position))
    if not cameras:
        raise BimVerifyError(f"{source} holds no aligned cameras.")
    return tuple(cameras)


def _frame(chunk: ElementTree.Element, where: str) -> tuple[float, np.ndarray, np.ndarray]:
    """From the chunk to the world: scale, rotation (3, 3), translation (3,)."""
    rotation = _numbers(chunk.find("transform/rotation"), (3, 3), where)
    translation = _numbers(chunk.find("transform/translation"), (3,), where)
    scale = _numbers(chunk.find("transform/scale"), (1,), where)
    if scale is not None and scale[0] <= 0:
        raise BimVerifyError(f"{where} has a scale that is not larger than zero; export the cameras again.")
    return (
        1.0 if scale is None else float(scale[0]), np.eye(3) if rotation is None else proper_rotation(rotation, where),
        np.zeros(3) if translation is None else translation,
    )


def _numbers(element: ElementTree.Element | None, shape: tuple[int, ...], where: str) -> Any:
    """What an element holds, None where there is none; BimVerifyError where it cannot be read."""
    if element is None or not element.text or not element.text.strip():
        return None
    flat = numbers(element.text.split(), (int(np.prod(shape)),))
    if flat is None:
        raise BimVerifyError(f"{where} has a {element.tag} that cannot be read ({element.text[:40]!r}); export it again.")
    return flat.reshape(shape)


def _lens(sensor: ElementTree.Element, where: str) -> Interior:
    calibration = next(
        (c for c in sensor.iterfind("calibration") if c.get("class") == "adjusted"), sensor.find("calibration")
    )
    size = sensor.find("resolution")
    if calibration is None or size is None:
        raise BimVerifyError(f"{where} has no calibration; export the cameras again.")
    if calibration.get("type", "frame") != "frame":
        raise BimVerifyError(f"{where} is no frame camera; only those are supported.")

    def value(name: str) -> float:
        found = _numbers(calibration.find(name), (1,), where)
        return 0.0 if found is None else float(found[0])

    try:
        width, height = int(size.get("width", "")), int(size.get("height", ""))
    except ValueError as error:
        raise BimVerifyError(f"{where} has no resolution in pixels.") from error
    f = value("f")
    if abs(value("b2")) > LARGEST_SHEAR_PX or value("k4") or value("p3") or value("p4"):
        raise BimVerifyError(f"{where} uses b2, k4, p3 or p4, which are not supported; calibrate without them.")
    lens = Interior(
        width, height, f + value("b1"), f, width / 2 + value("cx") - 0.5, height / 2 + value("cy") - 0.5,
        (value("k1"), value("k2"), value("p2"), value("p1"), value("k3")),
    )
    check_lens(lens, where)
    return lens
