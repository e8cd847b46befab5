"""How good the scans are and where to scan next: the step, its colours, its numbers, and the scene that shows it."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core.report import palette
from .. import survey_scene
from ..capability import Capability, Step, StepState
from ..colors import Legend, Mode, Surface, ramp
from ..step_parts import main_button, missing, reached
from ..text import percent, wrapped

COARSEST_M = 0.05
"""Point spacing with the last colour."""


def _state(scene: bpy.types.Scene) -> StepState:
    found = scene.get(survey_scene.SUMMARY_KEY, "")
    return reached(found, "Optional: how good the scans are, what is missing and why, where to scan next", missing(scene))


def _draw(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    main_button(layout, "quality", "SHADING_TEXTURE")
    column = layout.column(align=True)
    column.operator("bim_verify.plan", icon="OUTLINER_OB_LIGHTPROBE")
    column.operator("bim_verify.simulate", icon="OUTLINER_OB_POINTCLOUD")
    for key, name in ((survey_scene.SURVEY_KEY, "export_quality"), (survey_scene.PLAN_KEY, "export_plan")):
        if key in context.scene:
            column.operator(f"bim_verify.{name}", icon="EXPORT")
    item = context.object
    if item is not None and survey_scene.STATION_KEY in item:
        wrapped(layout.box(), context, f"{item[survey_scene.STATION_KEY]}: {item['note']}")


def _colors() -> list[tuple[str, palette.RGB]]:
    from ...core.quality.json_out import CAUSE_COLORS  # here: enabling the extension must not wait for its libraries

    return [(name, (r / 255, g / 255, b / 255)) for name, (r, g, b) in CAUSE_COLORS.items()]


def _cause_color(surface: Surface, _scene: bpy.types.Scene) -> NDArray[np.float64]:
    cause = surface(survey_scene.CAUSE)
    table = np.array([color for _, color in _colors()] + [palette.UNMEASURED])
    row: NDArray[np.float64] = table[np.where(np.isfinite(cause), cause, len(table) - 1).astype(np.int64)]
    return row


def _surveyed(item: bpy.types.Object) -> bool:
    return survey_scene.CAUSE in item.data.attributes


MODES = (
    Mode(
        survey_scene.MODE,
        "Scan quality",
        "Where returns lie, and where not, why",
        _cause_color,
        lambda _: Legend(tuple((name.capitalize(), color) for name, color in _colors())),
        _surveyed,
    ),
    ramp(
        "SPACING",
        "Point spacing",
        "Distance between neighbouring returns on the surface",
        survey_scene.SPACING,
        unit="mm",
        span=lambda _: (0.0, COARSEST_M),
        nothing="No returns",
        known=_surveyed,
    ),
)


def _numbers(item: bpy.types.Object) -> list[tuple[str, str]]:
    if "bim_verify_quality" not in item:
        return []
    return [
        ("Returns on", percent(item["bim_verify_coverage"])),
        ("GSA level", str(item["bim_verify_gsa_level"] or "none")),
        ("To do", str(item["bim_verify_actions"])),
    ]


def _why(item: bpy.types.Object) -> str:
    return str(item.get("bim_verify_quality", ""))


def _brief(item: bpy.types.Object, vertex: int) -> list[str]:
    if not _surveyed(item):
        return []
    cause = item.data.attributes[survey_scene.CAUSE].data[vertex].value if vertex >= 0 else float("nan")
    here = [f"Here: {_colors()[int(cause)][0]}"] if cause == cause else []
    return [*here, *_why(item).splitlines()]


def show(scene: bpy.types.Scene, result: Any) -> bool:
    """Put a survey into the scene; False if the result is none."""
    return survey_scene.show_survey(scene, result, scene.bim_verify.display_vertices)


CAPABILITY = Capability(
    "quality",
    Step("quality", "Quality", _state, _draw, optional=True),
    MODES,
    numbers=_numbers,
    why=_why,
    brief=_brief,
    forget=survey_scene.forget,
    show=show,
)
