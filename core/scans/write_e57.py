"""Write stations and their returns as an E57 file, through the E57 reference library."""

from __future__ import annotations

import contextlib
import hashlib
import math
import tempfile
import uuid
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import IO, Any

import numpy as np
import pye57
from numpy.typing import NDArray
from pye57 import libe57

from ..errors import BimVerifyError
from ..files import whole_file
from .campaign import ReturnBlock, Station
from .e57_header import iso_to_gps

_IN_MEMORY = 64 * 2**20
"""Bytes of one station kept in memory; more waits in a temporary file until the station is whole."""
ROWS = 262_144
"""Points handed to the library at a time."""
_NAMESPACE = uuid.UUID("5b0f2c0e-6b0b-5c3c-9a8a-0f4e57b1d0c5")
_COLORS = ("colorRed", "colorGreen", "colorBlue")
_AXES = ("cartesianX", "cartesianY", "cartesianZ")
_BUFFER_TYPES = {
    **dict.fromkeys(_COLORS, np.uint8), "intensity": np.float32, "rowIndex": np.longlong, "columnIndex": np.longlong,
}
"""The library takes a C long for 32 bits, so indices go through long long."""


class ScanRows:
    """The points of one scan of the file, and what is said of it."""

    guid = ""
    """Empty: made from the content."""
    description = ""
    groups: Sequence[tuple[int, int, int]] = ()
    """Consecutive points of one station: (row of the file's ``bv:stations``, first point, number of points)."""

    def __init__(self, station: Station) -> None:
        self.station = station
        """Name, and pose unless it is not ``known``."""
        self.dtype: np.dtype | None = None
        """A column for each field of the file, those of an extension as ``prefix:field``."""
        self.count = 0
        self.low: dict[str, float] = {}
        self.high: dict[str, float] = {}
        self.digest = hashlib.blake2b(digest_size=16)

    def read(self) -> Iterator[NDArray]:
        """Consecutive rows, at most ``ROWS`` at a time, that have at least the columns of ``dtype``."""
        raise NotImplementedError

    def measure(self, rows: NDArray) -> None:
        """Count rows, and take their bounds and their content into account."""
        for name in self.dtype.names or () if self.dtype is not None and len(rows) else ():
            self.low[name] = min(self.low.get(name, math.inf), float(rows[name].min()))
            self.high[name] = max(self.high.get(name, -math.inf), float(rows[name].max()))
        self.digest.update(rows.tobytes())
        self.count += len(rows)


class _Spool(ScanRows):
    """The returns of one station in the sensor frame, in the order in which they came."""

    def __init__(self, station: Station, file: IO[bytes]) -> None:
        super().__init__(station)
        self.file = file

    def add(self, block: ReturnBlock) -> None:
        xyz = block.offsets @ self.station.rotation
        if not self.station.known:
            xyz = xyz + self.station.position
        columns: dict[str, NDArray] = dict(zip(_AXES, xyz.T, strict=True))
        if block.intensity is not None:
            columns["intensity"] = block.intensity
        if block.color is not None:
            columns.update(zip(_COLORS, block.color.T, strict=True))
        if block.row is not None and block.column is not None:
            columns["rowIndex"], columns["columnIndex"] = block.row, block.column
        columns.update(block.extra or {})
        dtype = np.dtype([(name, values.dtype) for name, values in columns.items()])
        if self.dtype is None:
            self.dtype = dtype
        elif self.dtype != dtype:
            raise ValueError("all blocks of a station must have the same attributes")
        rows = np.empty(len(xyz), dtype)
        for name, values in columns.items():
            rows[name] = values
        self.measure(rows)
        self.file.write(rows.tobytes())

    def read(self) -> Iterator[NDArray]:
        self.file.seek(0)
        if self.dtype is not None:
            while data := self.file.read(ROWS * self.dtype.itemsize):
                yield np.frombuffer(data, self.dtype)


def write_e57(
    path: str | Path,
    stations: Sequence[Station],
    blocks: Iterable[ReturnBlock],
    *,
    scaled_integer_m: float | None = None,
) -> None:
    """Write one E57 scan per station, points in the sensor frame, with pose, and attributes that the blocks have.

    scaled_integer_m : resolution of the coordinates in metres, kept as integers; None keeps doubles.

    Blocks may come in any order of stations; those of one station must have the same attributes. A station that is not
    ``known`` is written without a pose and its points in the scan frame. GUIDs follow from the content: the same
    returns give the same file. Raises BimVerifyError when the place cannot be written.
    """
    with contextlib.ExitStack() as files:
        spools = [
            _Spool(station, files.enter_context(tempfile.SpooledTemporaryFile(max_size=_IN_MEMORY)))
            for station in stations
        ]
        for block in blocks:
            spools[block.station].add(block)
        write_scans(path, spools, scaled_integer_m=scaled_integer_m)


def write_scans(
    path: str | Path, scans: Sequence[ScanRows], *, scaled_integer_m: float | None = None, stations: Sequence[Station] = ()
) -> None:
    """Write one E57 scan for each of ``scans``; ``scaled_integer_m`` as in ``write_e57``.

    stations : set-ups that are not scans of the file, kept in ``bv:stations`` (name, translation, rotation) at its root.

    Raises BimVerifyError when the place cannot be written.
    """
    if scaled_integer_m is not None and not 1e-9 <= scaled_integer_m <= 1.0:
        raise ValueError("scaled_integer_m must be between 1e-9 and 1 metre")
    with whole_file(path) as temporary:
        try:
            _write(temporary, scans, scaled_integer_m, stations)
        except libe57.E57Exception as error:
            why = str(error).splitlines()[0]
            raise BimVerifyError(f"Cannot write {path}: {why}. Choose another place or free some space.") from error


def _write(
    path: Path, spools: Sequence[ScanRows], scaled_integer_m: float | None, stations: Sequence[Station]
) -> None:
    image = libe57.ImageFile(str(path), "w")
    try:
        root = image.root()
        image.extensionsAdd("", libe57.E57_V1_0_URI)
        used = {n.partition(":")[0] for s in spools if s.dtype for n in s.dtype.names or () if ":" in n}
        for prefix in sorted(used | ({"bv"} if stations else set())):
            image.extensionsAdd(prefix, extension_uri(prefix))
        whole = hashlib.blake2b(digest_size=16)
        for spool in spools:
            whole.update(spool.digest.digest())
        scans = libe57.VectorNode(image, True)
        root.set("formatName", libe57.StringNode(image, "ASTM E57 3D Imaging Data File"))
        root.set("guid", _guid(image, "file", whole))
        root.set("versionMajor", libe57.IntegerNode(image, libe57.E57_FORMAT_MAJOR))
        root.set("versionMinor", libe57.IntegerNode(image, libe57.E57_FORMAT_MINOR))
        root.set("e57LibraryVersion", libe57.StringNode(image, f"pye57 {pye57.__version__.__version__}"))
        root.set("data3D", scans)
        root.set("images2D", libe57.VectorNode(image, True))
        for number, spool in enumerate(spools):
            _write_scan(image, scans, number, spool, scaled_integer_m)
        if stations:
            _write_stations(image, root, stations)
    finally:
        image.close()


def _guid(image: Any, what: str, digest: Any) -> Any:
    return libe57.StringNode(image, "{" + str(uuid.uuid5(_NAMESPACE, what + digest.hexdigest())).upper() + "}")


def _string(image: Any, text: str) -> Any:
    """Text without control characters, which XML cannot hold."""
    return libe57.StringNode(image, "".join(c if c.isprintable() else " " for c in text))


def _structure(image: Any, values: dict[str, float | int]) -> Any:
    node = libe57.StructureNode(image)
    for name, value in values.items():
        kind = libe57.IntegerNode if isinstance(value, int) else libe57.FloatNode
        node.set(name, kind(image, value))
    return node


def _write_scan(image: Any, scans: Any, number: int, spool: ScanRows, scaled_integer_m: float | None) -> None:
    station, names = spool.station, (spool.dtype.names or ()) if spool.dtype is not None else _AXES
    scan = libe57.StructureNode(image)
    scans.append(scan)
    what = f"{number} {station.name} {station.position} {station.rotation}"
    scan.set("guid", _string(image, spool.guid) if spool.guid else _guid(image, what, spool.digest))
    scan.set("name", _string(image, station.name))
    if spool.description:
        scan.set("description", _string(image, spool.description))
    if spool.groups:
        kept = libe57.VectorNode(image, True)
        scan.set("bv:groups", kept)
        for number, first, count in spool.groups:
            kept.append(_structure(image, {"station": number, "first": first, "count": count}))
    if station.sensor:
        scan.set("sensorModel", _string(image, station.sensor))
    if station.acquired:
        moment = _structure(image, {"dateTimeValue": iso_to_gps(station.acquired), "isAtomicClockReferenced": 0})
        scan.set("acquisitionStart", moment)
    if station.known:
        pose = libe57.StructureNode(image)
        _set_pose(image, pose, station)
        scan.set("pose", pose)
    low, high = spool.low, spool.high
    if low:
        axes = zip("xyz", _AXES, strict=True)
        bounds = {f"{a}{end}": edge[n] for a, n in axes for end, edge in (("Minimum", low), ("Maximum", high))}
        scan.set("cartesianBounds", _structure(image, bounds))
    if "intensity" in low:
        limits = {"intensityMinimum": low["intensity"], "intensityMaximum": high["intensity"]}
        scan.set("intensityLimits", _structure(image, limits))
    if "colorRed" in names:
        limits = {f"{name}{end}": value for name in _COLORS for end, value in (("Minimum", 0), ("Maximum", 255))}
        scan.set("colorLimits", _structure(image, limits))
    if "rowIndex" in low:
        rows = (0, station.grid.rows - 1) if station.grid else (int(low["rowIndex"]), int(high["rowIndex"]))
        columns = (0, station.grid.columns - 1) if station.grid else (int(low["columnIndex"]), int(high["columnIndex"]))
        scan.set("indexBounds", _structure(image, {
            "rowMinimum": rows[0], "rowMaximum": rows[1], "columnMinimum": columns[0], "columnMaximum": columns[1],
            "returnMinimum": 0, "returnMaximum": 0,
        }))
    _write_points(image, scan, spool, names, scaled_integer_m)


def _set_pose(image: Any, node: Any, station: Station) -> None:
    quaternion = matrix_to_quaternion(station.rotation)
    node.set("rotation", _structure(image, dict(zip("wxyz", quaternion, strict=True))))
    node.set("translation", _structure(image, {axis: float(station.position[k]) for k, axis in enumerate("xyz")}))


def _write_stations(image: Any, root: Any, stations: Sequence[Station]) -> None:
    kept = libe57.VectorNode(image, True)
    root.set("bv:stations", kept)
    for station in stations:
        node = libe57.StructureNode(image)
        kept.append(node)
        node.set("name", _string(image, station.name))
        _set_pose(image, node, station)


def _prototype(image: Any, spool: ScanRows, names: Sequence[str], scaled_integer_m: float | None) -> Any:
    prototype = libe57.StructureNode(image)
    for name in names:
        low, high = spool.low.get(name, 0.0), spool.high.get(name, 0.0)
        if name in _AXES and scaled_integer_m is not None:
            least = min(0, math.floor(low / scaled_integer_m))
            most = max(1, math.ceil(high / scaled_integer_m))
            node = libe57.ScaledIntegerNode(image, 0, least, most, scaled_integer_m, 0.0)
        elif name in (*_AXES, "timeStamp"):
            node = libe57.FloatNode(image, 0.0, libe57.E57_DOUBLE)
        elif name == "intensity" or (":" in name and spool.dtype is not None and spool.dtype[name].kind == "f"):
            node = libe57.FloatNode(image, 0.0, libe57.E57_SINGLE)
        elif name in _COLORS:
            node = libe57.IntegerNode(image, 0, 0, 255)
        else:
            node = libe57.IntegerNode(image, 0, min(0, int(low)), max(0, int(high)))
        prototype.set(name, node)
    return prototype


def _write_points(image: Any, scan: Any, spool: ScanRows, names: Sequence[str], scaled_integer_m: float | None) -> None:
    prototype = _prototype(image, spool, names, scaled_integer_m)
    points = libe57.CompressedVectorNode(image, prototype, libe57.VectorNode(image, True))
    scan.set("points", points)
    size = min(ROWS, max(spool.count, 1))
    buffers = libe57.VectorSourceDestBuffer()
    arrays = {}
    for name in names:
        arrays[name] = np.zeros(size, _buffer_type(name, spool))
        buffers.append(libe57.SourceDestBuffer(image, name, arrays[name], size, True, True))
    writer = points.writer(buffers)
    for rows in spool.read():
        for name in names:
            arrays[name][: len(rows)] = rows[name]
        writer.write(len(rows))
    writer.close()


def _buffer_type(name: str, spool: ScanRows) -> Any:
    if ":" in name and spool.dtype is not None:
        return np.float32 if spool.dtype[name].kind == "f" else np.longlong
    return _BUFFER_TYPES.get(name, np.float64)


def extension_uri(prefix: str) -> str:
    """The name that an extension of ours has in E57 files; readers give its fields as ``{uri}field``."""
    return f"urn:bim-verify:e57:{prefix}"


def matrix_to_quaternion(matrix: NDArray[np.float64]) -> tuple[float, float, float, float]:
    """(w, x, y, z) of length 1, w not negative, of a rotation matrix (Bar-Itzhack 2000, doi:10.2514/2.4654)."""
    m = matrix
    k = np.array(
        [
            [m[0, 0] - m[1, 1] - m[2, 2], 0.0, 0.0, 0.0],
            [m[0, 1] + m[1, 0], m[1, 1] - m[0, 0] - m[2, 2], 0.0, 0.0],
            [m[0, 2] + m[2, 0], m[1, 2] + m[2, 1], m[2, 2] - m[0, 0] - m[1, 1], 0.0],
            [m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1], m[0, 0] + m[1, 1] + m[2, 2]],
        ]
    )
    x, y, z, w = (float(v) for v in np.linalg.eigh(k)[1][:, -1])
    return (w, x, y, z) if w >= 0 else (-w, -x, -y, -z)
