"""The outline that facades stand on: corners in order, or GeoJSON."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from shapely import Polygon
from shapely.errors import GEOSException
from shapely.geometry import shape
from shapely.geometry.polygon import orient

from ..errors import BimVerifyError
from ..json_in import read_json

Array = NDArray[np.float64]
LARGEST_FILE = 16 << 20
SHORTEST_M = 0.5
EARTH_M = 6378137.0
FAR_M = 1000.0
"""A footprint whose first corner lies farther from zero is in map coordinates; models are kept near zero."""
UNKNOWN_MAP = "unknown"


@dataclass(frozen=True)
class MapPlace:
    """Where the model's zero lies on the map."""

    easting: float
    northing: float
    """Metres."""
    crs: str
    """Name of the map's reference system, as ``EPSG:25832``."""


@dataclass(frozen=True)
class Footprint:
    """Corners near zero, (N, 2) in metres, counter-clockwise seen from above, and what a person should know of them."""

    corners: Array
    place: MapPlace | None
    notes: tuple[str, ...]

    def widths(self, images: int) -> list[float]:
        """Lengths of its first edges, one an image [m]; raises BimVerifyError where it has fewer."""
        if images > len(self.corners):
            raise BimVerifyError(f"The footprint has {len(self.corners)} edges, fewer than the {images} images.")
        sides = np.linalg.norm(np.roll(self.corners, -1, axis=0) - self.corners, axis=1)
        return [float(v) for v in sides[:images]]


def read_footprint(text: str, crs: str = "") -> Footprint:
    """The footprint of a GeoJSON file or of ``X,Y X,Y X,Y ...`` in metres.

    A file with degrees (every coordinate within their range, as GeoJSON has them) is laid flat around its first corner.
    Map coordinates are brought near zero by whole metres; ``crs`` names their map, where the file does not. Raises
    BimVerifyError.
    """
    if Path(text).suffix.lower() in (".geojson", ".json"):
        rows, holes, named = _of_file(Path(text))
    else:
        holes, named = 0, ""
        try:
            rows = np.array([[float(v) for v in pair.split(",")] for pair in text.replace(";", " ").split()], dtype=np.float64)
        except ValueError as error:
            raise BimVerifyError(f"--footprint takes corners X,Y X,Y X,Y or a .geojson file, not {text[:60]!r}.") from error
    if rows.ndim != 2 or rows.shape[1:] != (2,) or len(rows) < 3 or not np.isfinite(rows).all():
        raise BimVerifyError("The footprint needs at least three corners of two numbers each.")
    outline = Polygon(rows)
    if not outline.is_valid or outline.area < SHORTEST_M**2:
        raise BimVerifyError("The footprint crosses itself or has no area; give its corners once around it, in order.")
    first = rows[0]
    ring = np.array(orient(outline).exterior.coords)[:-1]
    ring = np.roll(ring, -int(np.argmin(np.linalg.norm(ring - first, axis=1))), axis=0)
    if np.linalg.norm(np.roll(ring, -1, axis=0) - ring, axis=1).min() < SHORTEST_M:
        raise BimVerifyError(f"An edge of the footprint is shorter than {SHORTEST_M} m; leave out corners that repeat.")
    notes = [f"Of the footprint {holes} courtyards are left out."] if holes else []
    if not outline.exterior.is_ccw:
        notes.append(
            "The footprint runs clockwise and was turned: the first photo is on the edge between its first and its last corner."
        )
    if not crs and np.abs(ring[0]).max() <= FAR_M:
        return Footprint(np.asarray(ring), None, tuple(notes))
    place = MapPlace(float(np.round(ring[0, 0])), float(np.round(ring[0, 1])), crs or named or UNKNOWN_MAP)
    if place.crs == UNKNOWN_MAP:
        notes.append(
            "The footprint is in map coordinates of a map that is not named; give --crs, so that other programs can place it."
        )
    return Footprint(np.asarray(ring) - [place.easting, place.northing], place, tuple(notes))


def _of_file(path: Path) -> tuple[Array, int, str]:
    """Corners, number of courtyards, name of the map; empty where none is named."""
    content: Any = read_json(path, "a footprint", LARGEST_FILE)
    try:
        features = content["features"] if content["type"] == "FeatureCollection" else [content]
        shapes: list[Any] = [shape(f["geometry"] if f["type"] == "Feature" else f) for f in features]
        found = [part for s in shapes for part in (s.geoms if s.geom_type == "MultiPolygon" else [s])]
        if len(found) > 1:
            raise BimVerifyError(f"{path} holds {len(found)} outlines; give the one of the building alone.")
        rows = np.array(found[0].exterior.coords, dtype=np.float64)[:-1, :2]
    except (KeyError, IndexError, TypeError, AttributeError, ValueError, GEOSException) as error:
        raise BimVerifyError(f"{path} holds no polygon that can be read; a footprint is a GeoJSON Polygon.") from error
    if len(rows) and np.abs(rows[:, 0]).max() <= 180 and np.abs(rows[:, 1]).max() <= 90 and np.ptp(rows, axis=0).max() < 0.05:
        rows = np.radians(rows - rows[0]) * EARTH_M * [math.cos(math.radians(float(rows[0, 1]))), 1.0]
    return np.asarray(rows), len(found[0].interiors), _map_name(content)


def _map_name(content: Any) -> str:
    """Of the ``crs`` that files in map coordinates have; ``urn:ogc:def:crs:EPSG::25832`` is EPSG:25832."""
    try:
        name = str(content["crs"]["properties"]["name"])
    except (KeyError, TypeError):
        return ""
    return f"EPSG:{name.rsplit(':', 1)[1]}" if "EPSG:" in name.upper() else name
