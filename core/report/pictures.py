"""The pictures of the report: which views, and each of them coloured by status, deviation and evidence."""

from __future__ import annotations

import base64
import io
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ..model.elements import BuildingModel
from ..model.raycast import RayScene
from ..parallel import in_chunks
from ..progress import Progress
from ..results import VerificationResult
from .camera import Camera, view_of_box
from .palette import belief_color, deviation_color, status_color, to_linear
from .render import SUPERSAMPLE, SampleColors, View, face_pixels, shade_view, trace_view

SIZE = (1120, 720)
"""Pixels, width and height."""
CUT_HEIGHT_M = 1.2
"""A section is cut this far above the floor: through doors and windows, above tables."""
MOST_STOREYS = 2
SAME_FLOOR_M = 1.0
"""Storeys whose floors are closer than this are cut together."""
PLAN_CAPTION = "from above, +y is up; numbers are stations"
UPRIGHT = ("Wall", "Column", "Door", "Stair")
"""Classes whose feet stand on the floor of their storey."""
SURROUNDINGS = ("IfcSite", "IfcGeographicElement", "IfcCivilElement")
"""Would make the building itself small in the picture."""
PICK_SCALE = 2
"""The picture of element numbers is this much smaller than the one that is seen."""


@dataclass(frozen=True)
class Picture:
    """One view; images as base64 PNG."""

    title: str
    caption: str
    images: dict[str, str]
    """``status``, ``deviation``, ``evidence``."""
    pick: str
    """Element row + 1 in the red, green and blue bytes, 0 where nothing is."""
    stations: tuple[tuple[float, float, str], ...] = ()
    """Column, row and number of the stations in a plan."""


def report_pictures(result: VerificationResult, deviation_limit_m: float, progress: Progress) -> list[Picture]:
    """Two views from outside, and for the storeys with most elements a section and a plan."""
    model = result.model
    scene = RayScene(model)
    face = to_linear(status_color([v.status for v in result.verdicts]))[model.triangle_element]
    evidence = result.evidence
    colors = {
        "deviation": to_linear(deviation_color(evidence.deviation, deviation_limit_m)).astype(np.float32),
        "evidence": to_linear(belief_color(evidence.m_occ, evidence.m_emp, evidence.m_unk)).astype(np.float32),
    }
    finder = SampleColors(result.samples)
    viewpoints = _viewpoints(model)
    pictures: list[Picture | None] = [None] * len(viewpoints)

    def draw(part: slice) -> None:
        for number in range(part.start, part.stop):
            progress.update(number / len(viewpoints), "Drawing the model")
            at = viewpoints[number]
            view = trace_view(model, at.camera, SIZE, scene=scene)
            found = finder.find(model, view, threads=1)
            images = {"status": png(shade_view(view, face_pixels(view, face)))}
            images |= {name: png(shade_view(view, found.pixels(color))) for name, color in colors.items()}
            pictures[number] = Picture(at.title, at.caption, images, _pick_map(view), _station_marks(result, at))

    in_chunks(len(viewpoints), draw, size=1)
    return [picture for picture in pictures if picture is not None]


def floors(model: BuildingModel) -> list[tuple[str, float, int]]:
    """(storey, height of its floor [m, local frame], elements on it), lowest first, from where its elements stand."""
    low, high = _element_heights(model)
    found = []
    for storey in sorted({e.storey for e in model.elements}):
        on_it = np.array([e.storey == storey and e.ifc_class not in SURROUNDINGS for e in model.elements])
        upright = on_it & np.array([any(word in e.ifc_class for word in UPRIGHT) for e in model.elements])
        upright &= high - low > CUT_HEIGHT_M
        if upright.any():
            found.append((storey, float(np.median(low[upright])), int(on_it.sum())))
    found.sort(key=lambda item: item[1])
    merged: list[tuple[str, float, int]] = []
    for storey, z, count in found:
        if merged and z - merged[-1][1] < SAME_FLOOR_M:
            first = merged[-1]
            name = first[0] if first[2] >= count else storey
            merged[-1] = (name, max(first[1], z), first[2] + count)
        else:
            merged.append((storey, z, count))
    return merged


def png(image: NDArray[np.uint8]) -> str:
    """(H, W, 3 or 4) to base64 PNG."""
    stream = io.BytesIO()
    Image.fromarray(image).save(stream, "PNG")
    return base64.b64encode(stream.getvalue()).decode("ascii")


@dataclass(frozen=True)
class _Viewpoint:
    title: str
    caption: str
    camera: Camera
    heights: tuple[float, float] | None = None
    """Stations between these heights (local frame) are marked; None: none is."""


def _viewpoints(model: BuildingModel) -> list[_Viewpoint]:
    bounds = _building_bounds(model)
    corners = (
        ("Outside, south-west", "seen from the corner at −x −y", 238),
        ("Outside, north-east", "seen from the corner at +x +y", 52),
    )
    found = [_Viewpoint(title, caption, view_of_box(bounds, side, 30, SIZE)) for title, caption, side in corners]
    all_floors = [floor for floor in floors(model) if floor[1] + CUT_HEIGHT_M < bounds[1, 2]]
    heights = [z for _, z, _ in all_floors]
    busiest = sorted(range(len(all_floors)), key=lambda k: -all_floors[k][2])[:MOST_STOREYS]
    for k in sorted(busiest):
        name, z = all_floors[k][0] or "Storey", heights[k]
        cut, bottom = z + CUT_HEIGHT_M, None if k == 0 else z - SAME_FLOOR_M
        lowest = -np.inf if k == 0 else z - SAME_FLOOR_M / 2
        highest = heights[k + 1] - SAME_FLOOR_M / 2 if k + 1 < len(heights) else np.inf
        inside = view_of_box(bounds, 248, 50, SIZE, cut_z=cut, bottom_z=bottom)
        plan = view_of_box(bounds, 270, 90, SIZE, cut_z=cut, bottom_z=bottom)
        found.append(_Viewpoint(f"{name}, inside", f"cut {CUT_HEIGHT_M:.1f} m above the floor", inside))
        found.append(_Viewpoint(f"{name}, plan", PLAN_CAPTION, plan, (lowest, highest)))
    if not all_floors:
        found.append(_Viewpoint("Plan", PLAN_CAPTION, view_of_box(bounds, 270, 90, SIZE), (-np.inf, np.inf)))
    return found


def _element_heights(model: BuildingModel) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    low, high = model.element_bounds[:, :, 2]
    return low, high


def _building_bounds(model: BuildingModel) -> NDArray[np.float64]:
    building = np.array([e.ifc_class not in SURROUNDINGS for e in model.elements])
    used = building[model.triangle_element]
    corners = model.vertices[model.triangles[used if used.any() else slice(None)]].reshape(-1, 3)
    return np.stack([corners.min(axis=0), corners.max(axis=0)])


def _pick_map(view: View) -> str:
    step = SUPERSAMPLE * PICK_SCALE
    number = (view.element[step // 2 :: step, step // 2 :: step] + 1).astype(np.uint32)
    return png(np.stack([number >> 16, number >> 8 & 255, number & 255], axis=-1).astype(np.uint8))


def _station_marks(result: VerificationResult, at: _Viewpoint) -> tuple[tuple[float, float, str], ...]:
    """Column, row and number of the stations that stand on the storey of a plan."""
    if at.heights is None or not result.stations:
        return ()
    place = np.array([s.position for s in result.stations]) - result.model.origin
    pixel = at.camera.project(place, SIZE)
    shown = np.array([s.known for s in result.stations]) & ((pixel > 0) & (pixel < np.array(SIZE))).all(axis=1)
    shown &= (place[:, 2] > at.heights[0]) & (place[:, 2] < at.heights[1])
    return tuple(
        (round(float(pixel[i, 0]), 1), round(float(pixel[i, 1]), 1), str(i + 1)) for i in np.flatnonzero(shown)
    )
