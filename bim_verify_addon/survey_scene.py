"""Scan quality in the scene: elements coloured by what is missing and why, stations with their views."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import bpy
import numpy as np
from numpy.typing import NDArray

from ..core.progress import Progress
from . import frame, project, scene
from .surface_grid import FACING_WEIGHT_M, SurfaceGrid, grid_within

if TYPE_CHECKING:
    from ..core.quality.results import QualityResult

STATIONS = "Stations"
STATION_KEY = "bim_verify_station"
"""On each station's marker: its name."""
CAUSE, COVERED, SPACING = "bv_cause", "bv_covered", "bv_spacing"
MODE = "MISSING"
ELEMENT_KEYS = ("bim_verify_coverage", "bim_verify_gsa_level", "bim_verify_actions", "bim_verify_quality")
CONE_LENGTH_M = 0.6
CONE_SIDES = 24
SUMMARY_KEY = "bim_verify_survey"
"""On the scene: what the last survey or plan found, in one sentence."""

SURVEY_KEY, PLAN_KEY = "bim_verify_survey_result", "bim_verify_plan_result"
"""On the scene: they name the last survey and the last plan in memory."""


@dataclass(frozen=True)
class SurveyDisplay:
    """The surfaces of a survey, ready to be shown; per vertex of the grid."""

    grid: SurfaceGrid
    cause: NDArray[np.float32]
    """Row of ``CAUSE_COLORS``: seen, or why not; NaN where other elements touch the surface, so that nothing could be."""
    covered: NDArray[np.float32]
    """1 where returns lie on it, else 0."""
    spacing: NDArray[np.float32]
    """Metres; NaN where there are no returns."""


@dataclass(frozen=True)
class Marker:
    """A station to be shown. Metres, model frame; angles in radians."""

    name: str
    position: tuple[float, float, float]
    elevation_min: float
    note: str = ""
    planned: bool = False


def make_survey_display(
    result: QualityResult, budget: int, progress: Progress | None = None, spacing: float | None = None
) -> SurveyDisplay:
    """Carry what is known of the query positions to a grid of at most ``budget`` vertices; for a worker thread.

    ``spacing`` [m]: of the query positions that the grid is made for; that of a verification gives the same vertices as it.
    """
    from scipy.spatial import cKDTree  # here: enabling the extension must not wait for it

    from ..core.quality.json_out import CAUSE_COLORS, sample_causes

    progress = progress or Progress()
    grid, _ = grid_within(result.model, spacing or result.options.sample_spacing, budget, progress.part(0, 0.4))
    samples = result.samples
    rows = np.flatnonzero(samples.exposed)
    causes = sample_causes(result)
    names = list(CAUSE_COLORS)
    code = np.array([names.index(cause) for cause in causes], dtype=np.int64)
    count = len(grid.vertices)
    cause = np.full(count, np.nan, np.float32)
    covered, distance_between = np.zeros(count, np.float32), np.full(count, np.nan, np.float32)
    element = samples.element[rows]
    start = np.searchsorted(element, np.arange(len(result.model.elements) + 1))
    for e in range(len(result.model.elements)):
        progress.update(0.4 + 0.6 * e / len(result.model.elements), "Colouring the surface")
        at = slice(int(grid.vertex_start[e]), int(grid.vertex_start[e + 1]))
        of = slice(int(start[e]), int(start[e + 1]))
        if at.start == at.stop or of.start == of.stop:
            continue
        own = rows[of]
        tree = cKDTree(np.hstack([samples.position[own], FACING_WEIGHT_M * samples.normal[own]]))
        _, nearest = tree.query(np.hstack([grid.vertices[at], FACING_WEIGHT_M * grid.normal[at]]))
        cause[at] = code[of][nearest]
        covered[at] = code[of][nearest] == 0
        distance_between[at] = result.survey.spacing[own][nearest]
    return SurveyDisplay(grid, cause, covered, distance_between)


def show_quality(
    target: bpy.types.Scene, result: QualityResult, display: SurveyDisplay, only: Collection[str] | None = None
) -> str:
    """Show on every element (of the GlobalIds ``only``) what is missing and why, mark the stations; one sentence."""
    from ..core.quality.levels import ACTIONS  # here: enabling the extension must not wait for its libraries
    from . import paint

    existing = scene.objects_of(target, result.model)
    grid = display.grid
    for index, key in enumerate(scene.keys(result.model)):
        item = existing.get(key)
        if item is None or (only is not None and result.elements[index].global_id not in only):
            continue
        at = slice(int(grid.vertex_start[index]), int(grid.vertex_start[index + 1]))
        of = slice(int(grid.triangle_start[index]), int(grid.triangle_start[index + 1]))
        middle = np.array(item[frame.ORIGIN_KEY][:]) - result.model.origin
        scene.fill(item.data, grid.vertices[at] - middle, grid.triangles[of] - at.start)
        scene.set_attribute(item.data, CAUSE, "FLOAT", display.cause[at])
        scene.set_attribute(item.data, COVERED, "FLOAT", display.covered[at])
        scene.set_attribute(item.data, SPACING, "FLOAT", display.spacing[at])
        quality = result.elements[index]
        item["bim_verify_coverage"] = quality.measured.coverage
        item["bim_verify_gsa_level"] = quality.gsa_level
        item["bim_verify_actions"] = "; ".join(ACTIONS[action] for action in quality.actions)
        item["bim_verify_quality"] = quality.reason
    show_stations(target, [
        Marker(s.name, s.position, s.elevation_min if s.returns else -math.pi / 3, f"{s.returns:,} returns")
        for s in result.stations
    ], planned=False)
    target.bim_verify.color_mode = MODE
    paint.refresh(target)
    target[SUMMARY_KEY] = result.headline
    return str(target[SUMMARY_KEY])


def forget(target: bpy.types.Scene) -> None:
    """What was found on the elements is no more; stations stay, they belong to the scans or to a plan."""
    for key in (SUMMARY_KEY, SURVEY_KEY, PLAN_KEY):
        target.pop(key, None)
    for item in scene.element_objects(target).values():
        for key in ELEMENT_KEYS:
            item.pop(key, None)


def show_stations(target: bpy.types.Scene, markers: Sequence[Marker], *, planned: bool) -> None:
    """Markers of the stations; those of an earlier survey (or plan) are replaced.

    A marker is a double cone at the scanner's centre: below it, what the scanner cannot see.
    """
    scene.remove(*(i for i in target.objects if STATION_KEY in i and bool(i.get("planned")) == planned))
    place = frame.stored(target) or frame.ViewFrame()
    for marker in markers:
        item = bpy.data.objects.new(marker.name, _cone(marker))
        item[STATION_KEY] = marker.name
        item["planned"] = planned
        item["note"] = marker.note
        item[frame.ORIGIN_KEY] = [float(v) for v in marker.position]
        item.show_name = True
        item.color = (0.17, 0.37, 0.85, 1.0) if planned else (0.95, 0.66, 0.0, 1.0)
        frame.place(item, place)
        scene.collection(target, STATIONS).objects.link(item)


def station_markers(target: bpy.types.Scene) -> list[tuple[str, NDArray[np.float64]]]:
    """(name, position (3,) [m, model frame]) of the markers in the scene, planned ones first, where a user moved them to."""
    place = frame.stored(target) or frame.ViewFrame()
    items = [item for item in target.objects if STATION_KEY in item]
    items.sort(key=lambda item: (not item.get("planned"), item.name))
    return [(item[STATION_KEY], place.to_model(np.array(item.matrix_world.translation))) for item in items]


def show_survey(target: bpy.types.Scene, result: object, budget: int) -> bool:
    """Show a survey in an empty scene (``--blend``); False when it is none."""
    from ..core.quality.results import QualityResult  # here: enabling the extension must not wait for its libraries

    if not isinstance(result, QualityResult):
        return False
    target.bim_verify.model_path = str(Path(result.model.path).resolve())
    project.adopt_frame(target, result.model)
    show_quality(target, result, make_survey_display(result, budget))
    scene.show_colors_in_views()
    return True


def _cone(marker: Marker) -> bpy.types.Mesh:
    """The blind cone below the scanner, and a small ball of a scanner above it."""
    half = max(math.pi / 2 + marker.elevation_min, math.radians(3.0))
    turn = np.arange(CONE_SIDES) * (2 * math.pi / CONE_SIDES)
    radius, depth = CONE_LENGTH_M * math.sin(half), CONE_LENGTH_M * math.cos(half)
    ring = np.column_stack([radius * np.cos(turn), radius * np.sin(turn), np.full(CONE_SIDES, -depth)])
    head = 0.12 * np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], dtype=np.float64)
    vertices = np.concatenate([np.zeros((1, 3)), ring, head])
    after = np.roll(np.arange(CONE_SIDES), -1)
    sides = np.column_stack([np.zeros(CONE_SIDES, np.int64), 1 + np.arange(CONE_SIDES), 1 + after])
    first = 1 + CONE_SIDES
    ball = first + np.array([[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]])
    mesh = bpy.data.meshes.new(marker.name)
    scene.fill(mesh, vertices, np.concatenate([sides, ball]))
    return mesh
