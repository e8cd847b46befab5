"""What a building model is to this library: elements and their triangles, in metres, near a local origin."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Element:
    """One physical product of the IFC file that has a body."""

    global_id: str
    step_id: int
    ifc_class: str
    name: str
    storey: str
    type_name: str = ""


@dataclass(frozen=True)
class MapConversion:
    """IfcMapConversion, model frame (metres) to map frame (metres): map = scale * Rz(angle) * model + offset."""

    offset: NDArray[np.float64]
    """(3,) eastings, northings, orthogonal height, metres."""
    angle: float
    """Radians, counter-clockwise from the map's east axis to the model's x axis."""
    scale: float
    name: str = ""

    def to_map(self, xyz: NDArray[np.float64]) -> NDArray[np.float64]:
        """(N, 3) model frame to (N, 3) map frame."""
        return self.scale * (xyz @ self._rotation().T) + self.offset

    def to_model(self, xyz: NDArray[np.float64]) -> NDArray[np.float64]:
        """(N, 3) map frame to (N, 3) model frame."""
        return ((xyz - self.offset) / self.scale) @ self._rotation()

    def _rotation(self) -> NDArray[np.float64]:
        c, s = np.cos(self.angle), np.sin(self.angle)
        return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


@dataclass(frozen=True)
class BuildingModel:
    """All elements with their outward-oriented triangles.

    Frames: the *model frame* is the IFC file's own world frame, in metres. Geometry is stored in the *local frame*:
    local = model - ``origin``, so that double and single precision keep sub-0.1 mm everywhere.
    """

    path: str
    content_hash: str
    schema: str
    """IFC2X3, IFC4 or IFC4X3."""
    length_unit_m: float
    """Metres per file length unit (0.001 for a file in millimetres)."""
    origin: NDArray[np.float64]
    """(3,) metres, model frame."""
    elements: tuple[Element, ...]
    vertices: NDArray[np.float64]
    """(V, 3) metres, local frame."""
    triangles: NDArray[np.int32]
    """(T, 3) rows of ``vertices``, counter-clockwise seen from outside."""
    triangle_element: NDArray[np.int32]
    """(T,) rows of ``elements``; ascending, so each element's triangles are one slice."""
    closed: NDArray[np.bool_]
    """(E,) the element's surface is a closed solid (else its sides cannot be told apart)."""
    transparent: NDArray[np.bool_]
    """(T,) the surface is styled as glass: many scanners look through it."""
    map_conversion: MapConversion | None = None
    skipped: tuple[str, ...] = field(default=())
    """One sentence per product that has a body but could not be turned into triangles."""
    project_name: str = ""
    project_id: str = ""
    """GlobalId of the IfcProject."""
    partly: tuple[str, ...] = ()
    """IFC classes of ``elements`` of which the file has more than these: layered walls whose parts have the bodies."""

    @property
    def triangle_start(self) -> NDArray[np.int64]:
        """(E + 1,) element ``e`` owns the triangles ``triangle_start[e]:triangle_start[e + 1]``."""
        return np.searchsorted(self.triangle_element, np.arange(len(self.elements) + 1))

    @property
    def bounds(self) -> NDArray[np.float64]:
        """(2, 3) lowest and highest corner, metres, local frame."""
        used = self.vertices[np.unique(self.triangles)]
        return np.stack([used.min(axis=0), used.max(axis=0)])

    @property
    def element_bounds(self) -> NDArray[np.float64]:
        """(2, E, 3) lowest and highest corner of each element, metres, local frame; infinite and inside out without a body."""
        corner = self.vertices[self.triangles]
        found = np.full((2, len(self.elements), 3), np.inf)
        found[1] = -np.inf
        np.minimum.at(found[0], self.triangle_element, corner.min(axis=1))
        np.maximum.at(found[1], self.triangle_element, corner.max(axis=1))
        return found
