"""The XML section of an E57 file: scans, poses, point records."""

from __future__ import annotations

import math
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from .e57_pages import E57Pages
from .e57_records import Field, Records

_NAMESPACE = "{http://www.astm.org/COMMIT/E57/2010-e57-v1.0}"
_INT64 = (-(2**63), 2**63 - 1)
_GPS_EPOCH = datetime(1980, 1, 6, tzinfo=UTC)
_LEAP_SECONDS = tuple(
    datetime(year, month, 1, tzinfo=UTC)
    for year, month in (
        (1981, 7), (1982, 7), (1983, 7), (1985, 7), (1988, 1), (1990, 1), (1991, 1), (1992, 7), (1993, 7), (1994, 7),
        (1996, 1), (1997, 7), (1999, 1), (2006, 1), (2009, 1), (2012, 7), (2015, 7), (2017, 1),
    )
)
"""Dates since the GPS epoch from which UTC was one second further behind (IERS Bulletin C)."""


@dataclass(frozen=True)
class ScanHeader:
    """One scan of an E57 file."""

    name: str
    position: NDArray[np.float64]
    rotation: NDArray[np.float64]
    has_pose: bool
    sensor: str
    acquired: str
    index_bounds: tuple[int, int, int, int] | None
    """Row minimum, row maximum, column minimum, column maximum."""
    color_limits: tuple[tuple[float, float], ...] | None
    records: Records


def gps_to_iso(seconds: float) -> str:
    """UTC as ISO 8601 from seconds since 1980-01-06 on the GPS clock; empty for 0 and for nonsense."""
    if not math.isfinite(seconds) or not 0.0 < seconds < 1e10:
        return ""
    gps = _GPS_EPOCH + timedelta(seconds=seconds)
    leaps = sum(gps - timedelta(seconds=count) >= date for count, date in enumerate(_LEAP_SECONDS, 1))
    return (gps - timedelta(seconds=leaps)).isoformat(timespec="seconds").replace("+00:00", "Z")


def iso_to_gps(text: str) -> float:
    """Inverse of ``gps_to_iso``; 0 for an empty text. A time without a zone is taken as UTC."""
    if not text:
        return 0.0
    moment = datetime.fromisoformat(text)
    moment = moment.replace(tzinfo=UTC) if moment.tzinfo is None else moment.astimezone(UTC)
    return (moment - _GPS_EPOCH).total_seconds() + sum(moment >= date for date in _LEAP_SECONDS)


def quaternion_to_matrix(w: float, x: float, y: float, z: float) -> NDArray[np.float64]:
    """Rotation matrix of a quaternion of any length but 0."""
    n = w * w + x * x + y * y + z * z
    s = 2.0 / n
    return np.array(
        [
            [1 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w)],
            [s * (x * y + z * w), 1 - s * (x * x + z * z), s * (y * z - x * w)],
            [s * (x * z - y * w), s * (y * z + x * w), 1 - s * (x * x + y * y)],
        ]
    )


def read_headers(pages: E57Pages) -> list[ScanHeader]:
    """All scans in the file's order. Raises BimVerifyError when the XML section cannot be understood."""
    xml = pages.xml()
    if b"<!DOCTYPE" in xml or b"<!ENTITY" in xml:
        raise pages.damaged("its XML section defines entities, which E57 does not have")
    try:
        root = ElementTree.fromstring(xml)
    except ElementTree.ParseError as error:
        raise pages.damaged("its XML section is broken") from error
    scans = root.find(f"{_NAMESPACE}data3D")
    headers = []
    for number, scan in enumerate([] if scans is None else scans):
        try:
            headers.append(_scan_header(scan, number, pages))
        except (ValueError, OverflowError, ArithmeticError) as error:
            raise pages.damaged(f"the description of scan {number + 1} cannot be understood") from error
    return headers


def _scan_header(scan: ElementTree.Element, number: int, pages: E57Pages) -> ScanHeader:
    points = _child(scan, "points")
    if points is None or points.get("type") != "CompressedVector":
        raise pages.damaged(f"scan {number + 1} has no points section")
    codecs = _child(points, "codecs")
    if codecs is not None and len(codecs):
        raise pages.damaged("it uses a codec other than bit packing")
    prototype = _child(points, "prototype")
    fields = tuple(_fields(prototype)) if prototype is not None else ()
    records = Records(int(points.get("recordCount", "0")), int(points.get("fileOffset", "0")), fields)
    if records.count < 0:
        raise ValueError("negative count")
    quaternion = [_number(scan, f"pose/rotation/{axis}", float(axis == "w")) for axis in "wxyz"]
    position = np.array([_number(scan, f"pose/translation/{axis}", 0.0) for axis in "xyz"])
    length = math.hypot(*quaternion)
    if not np.isfinite(position).all() or not 0.5 < length < 2.0:
        raise ValueError("pose")
    words = [_text(scan, key) for key in ("sensorVendor", "sensorModel", "sensorSerialNumber")]
    if words[0] and words[1].lower().startswith(words[0].lower()):
        words[0] = ""
    return ScanHeader(
        name=_text(scan, "name") or f"scan {number + 1}",
        position=position,
        rotation=quaternion_to_matrix(*quaternion),
        has_pose=_child(scan, "pose") is not None,
        sensor=" ".join(word for word in words if word),
        acquired=gps_to_iso(_number(scan, "acquisitionStart/dateTimeValue", 0.0)),
        index_bounds=_index_bounds(scan),
        color_limits=_color_limits(scan),
        records=records,
    )


def _child(node: ElementTree.Element, path: str) -> ElementTree.Element | None:
    return node.find("/".join(_NAMESPACE + part for part in path.split("/")))


def _text(node: ElementTree.Element, path: str) -> str:
    found = _child(node, path)
    return (found.text or "").strip() if found is not None else ""


def _number(node: ElementTree.Element, path: str, default: float) -> float:
    """Value of a number; an element without text is 0."""
    found = _child(node, path)
    if found is None:
        return default
    value = float((found.text or "").strip() or 0.0)
    if found.get("type") == "ScaledInteger":
        value = value * float(found.get("scale", "1")) + float(found.get("offset", "0"))
    return value


def _index_bounds(scan: ElementTree.Element) -> tuple[int, int, int, int] | None:
    if _child(scan, "indexBounds") is None:
        return None
    low_row, high_row, low_column, high_column = (
        int(_number(scan, f"indexBounds/{axis}{end}", 0.0))
        for axis in ("row", "column")
        for end in ("Minimum", "Maximum")
    )
    return low_row, high_row, low_column, high_column


def _color_limits(scan: ElementTree.Element) -> tuple[tuple[float, float], ...] | None:
    if _child(scan, "colorLimits") is None:
        return None
    return tuple(
        (_number(scan, f"colorLimits/color{name}Minimum", 0.0), _number(scan, f"colorLimits/color{name}Maximum", 255.0))
        for name in ("Red", "Green", "Blue")
    )


def _fields(prototype: ElementTree.Element) -> list[Field]:
    """Leaves of the prototype in the order of their streams."""
    fields: list[Field] = []
    for node in prototype:
        kind = node.get("type")
        name = node.tag.removeprefix(_NAMESPACE)
        if kind in ("Structure", "Vector"):
            fields += _fields(node)
        elif kind == "Float":
            fields.append(Field(name, "float", 32 if node.get("precision", "double") == "single" else 64))
        elif kind in ("Integer", "ScaledInteger"):
            low = int(node.get("minimum", str(_INT64[0])))
            high = int(node.get("maximum", str(_INT64[1])))
            if not _INT64[0] <= low <= high <= _INT64[1]:
                raise ValueError(name)
            scale, offset = 1.0, 0.0
            if kind == "ScaledInteger":
                scale, offset = float(node.get("scale", "1")), float(node.get("offset", "0"))
            fields.append(Field(name, "integer", (high - low).bit_length(), low, high, scale, offset))
        elif kind == "String":
            fields.append(Field(name, "string", 0))
        else:
            raise ValueError(f"field type {kind}")
    return fields
