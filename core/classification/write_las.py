"""The classified cloud as LAS or LAZ: a classification code a return, and the element and station in fields of their own."""

from __future__ import annotations

import json
from pathlib import Path

import laspy
import numpy as np
from laspy.vlrs.vlrlist import VLRList
from numpy.typing import NDArray

from ..errors import BimVerifyError
from ..files import whole_file
from ..progress import Progress
from .codes import UNCLASSIFIED, las_code
from .results import Classification
from .sort import AXES, COLORS, DEVIATION, STATION, SortedReturns

ELEMENT = "element"
RESOLUTION_M = 1e-4
FARTHEST_M = RESOLUTION_M * (2**31 - 1)
"""LAS counts steps of the resolution in 32 bits."""
CHUNK = 1_000_000
MOST_STATIONS = 65_535
RECORD_USER, RECORD_ID = "bim_verify", 1
"""Of the extended record that says what the numbers stand for (JSON)."""
_FULL = 65_535.0


def write_classified_las(
    path: str | Path, result: Classification, memory_gb: float, progress: Progress | None = None
) -> None:
    """Write every return of the source as LAS 1.4, compressed if the name ends with ``.laz``.

    ``classification`` is the code of the element's IFC class (``codes.py``), ``point_source_id`` the station, counted from
    1, ``element`` (uint32) the number of the element, counted from 1, 0 for none, and ``deviation`` (float32, metres) how
    far the return lies from its surface. An extended record (bim_verify, 1) lists the elements' GlobalIds and the
    stations with their positions. Raises BimVerifyError when the place cannot be written.
    """
    progress = progress or Progress()
    if len(result.stations) > MOST_STATIONS:
        raise BimVerifyError(f"LAS can name {MOST_STATIONS:,} stations, and the scans have more. Write an E57 file.")
    with SortedReturns(result, memory_gb, progress.part(0.0, 0.5)) as returns, whole_file(path) as temporary:
        _refuse_far(result, returns)
        header = _header(result, returns)
        low, gain = _intensity_range(returns)
        edge = returns.start[:: len(result.stations)]
        codes = np.array([las_code(e.ifc_class) for e in result.model.elements] + [UNCLASSIFIED], np.uint8)
        total = len(returns.rows)
        with laspy.open(str(temporary), mode="w", header=header, do_compress=Path(path).suffix.lower() == ".laz") as writer:
            for begin in range(0, total, CHUNK):
                rows = returns.rows[begin : begin + CHUNK]
                element = np.searchsorted(edge, np.arange(begin, begin + len(rows)), side="right") - 1
                points = laspy.ScaleAwarePointRecord.zeros(len(rows), header=header)
                points.x, points.y, points.z = (rows[axis] for axis in AXES)
                points["classification"] = codes[element]
                points["point_source_id"] = (rows[STATION] + 1).astype(np.uint16)
                points["return_number"] = points["number_of_returns"] = np.ones(len(rows), np.uint8)
                points[ELEMENT] = np.where(element < len(result.model.elements), element + 1, 0).astype(np.uint32)
                points["deviation"] = rows[DEVIATION]
                if returns.has_intensity:
                    points["intensity"] = np.round((rows["intensity"] - low) * gain).astype(np.uint16)
                if returns.has_color:
                    for name, column in zip(("red", "green", "blue"), COLORS, strict=True):
                        points[name] = rows[column].astype(np.uint16) * 257
                writer.write_points(points)
                progress.update(0.5 + 0.5 * begin / max(total, 1), "Writing the classified cloud")
            writer.write_evlrs(VLRList([laspy.VLR(RECORD_USER, RECORD_ID, "elements and stations", _legend(result))]))


def _refuse_far(result: Classification, returns: SortedReturns) -> None:
    far = np.zeros(len(returns.rows), dtype=np.bool_)
    for axis, middle in zip(AXES, result.model.origin, strict=True):
        far |= np.abs(returns.rows[axis] - middle) > FARTHEST_M
    if far.any():
        raise BimVerifyError(
            f"{int(far.sum()):,} returns lie farther than {FARTHEST_M / 1000:.0f} km from the model, which LAS cannot hold at "
            f"{1000 * RESOLUTION_M:g} mm; remove them from the scans, or write an E57 file."
        )


def _header(result: Classification, returns: SortedReturns) -> laspy.LasHeader:
    header = laspy.LasHeader(point_format=7 if returns.has_color else 6, version="1.4")
    header.scales = np.full(3, RESOLUTION_M)
    header.offsets = np.asarray(result.model.origin, dtype=np.float64)
    header.add_extra_dims(
        [laspy.ExtraBytesParams(ELEMENT, np.uint32, "row of the element, from 1"),
         laspy.ExtraBytesParams("deviation", np.float32, "m from the planned surface")]
    )  # fmt: skip
    header.generating_software = "bim_verify"
    header.global_encoding.wkt = True  # LAS 1.4 asks for it with point formats from 6 on
    return header


def _intensity_range(returns: SortedReturns) -> tuple[float, float]:
    """What to take off an intensity, and what to multiply it with, to fit 16 bits; as in the file where that fits."""
    if not returns.has_intensity or not len(returns.rows):
        return 0.0, 1.0
    values: NDArray = returns.rows["intensity"]
    low, high = float(values.min()), float(values.max())
    if low >= 0 and 1 < high <= _FULL:
        return 0.0, 1.0
    if low >= 0 and high <= 1:
        return 0.0, _FULL
    return low, _FULL / max(high - low, 1e-12)


def _legend(result: Classification) -> bytes:
    return json.dumps(
        {
            "stations": [
                {"point_source_id": k + 1, "name": s.name, "position": [float(v) for v in s.position]}
                for k, s in enumerate(result.stations)
            ],
            "elements": [
                {"element": k + 1, "global_id": e.global_id, "class": e.ifc_class, "name": e.name,
                 "code": las_code(e.ifc_class)}
                for k, e in enumerate(result.model.elements)
            ],
        }
    ).encode()  # fmt: skip
