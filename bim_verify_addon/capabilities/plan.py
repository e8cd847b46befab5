"""What a scan plan is expected to give: its colours and numbers. Its buttons are in the step *Quality*."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from .. import forecast_scene, project
from .. import scene as scenery
from ..capability import Capability
from ..colors import Category, Surface, categorical, ramp
from ..forecast_scene import HAVE, OUT, REACHED, SHORT, BimVerifyForecast
from ..text import millimetres, percent


def _kind(item: bpy.types.Object) -> str:
    return str(item.bim_verify_plan.kind)


def _planned(item: bpy.types.Object) -> bool:
    return item.bim_verify_plan.plan_loa > 0


def _coverage(surface: Surface) -> NDArray[np.float32]:
    return np.full(len(surface), surface.item.bim_verify_plan.coverage, dtype=np.float32)


MODES = (
    categorical(
        forecast_scene.MODE,
        "Plan",
        "What the scan plan is expected to give, before anyone scans",
        (
            Category(REACHED, "Reached", "A planned set-up completes it", (0.0, 0.62, 0.45)),
            Category(HAVE, "Before plan", "The scans that are there give the level", (0.0, 0.40, 0.66)),
            Category(SHORT, "Falls short", "Less than asked for, even with all set-ups", (0.95, 0.72, 0.20)),
            Category(OUT, "Out of reach", "No place looked at measures enough of it", (0.38, 0.08, 0.27)),
        ),
        _kind,
    ),
    ramp(
        "PLANNED",
        "Planned coverage",
        "Share of the element's surface that the plan is expected to measure as the level needs",
        _coverage,
        unit="%",
        known=_planned,
    ),
)


def _numbers(item: bpy.types.Object) -> list[tuple[str, str]]:
    if not _planned(item):
        return []
    found = item.bim_verify_plan
    return [
        ("Measured, expected", percent(found.coverage)),
        ("Asked", percent(found.target)),
        ("In reach at all", percent(found.reachable)),
        ("By scans there are", percent(found.before) if found.before > 0 else ""),
        ("Belief occupied", percent(found.belief)),
        ("Point spacing", millimetres(found.spacing)),
        ("Sigma", millimetres(found.sigma)),
        ("Level expected", found.level if found.level != "NONE" else "none"),
    ]


def _why(item: bpy.types.Object) -> str:
    found = item.bim_verify_plan
    said = {
        REACHED: f"LOA{found.plan_loa} with set-up {found.set_up}",
        HAVE: f"The scans that are there give LOA{found.plan_loa}",
        SHORT: f"Less than LOA{found.plan_loa} needs, even with all set-ups",
        OUT: f"No place that was looked at measures enough of it for LOA{found.plan_loa}",
    }
    return said.get(found.kind, "The plan was not made for this element")


def _brief(item: bpy.types.Object, vertex: int) -> list[str]:
    if not _planned(item):
        return []
    return [_why(item), f"{percent(item.bim_verify_plan.coverage)} of its surface expected to be measured"]


def show(scene: bpy.types.Scene, result: Any) -> bool:
    """Put a plan into a scene; False if the result is none."""
    from ...core.planning.results import PlanResult  # here: enabling the extension must not wait for its libraries

    if not isinstance(result, PlanResult):
        return False
    scene.bim_verify.model_path = str(Path(result.model.path).resolve())
    project.adopt_frame(scene, result.model)
    forecast_scene.show_plan(scene, result)
    scenery.show_colors_in_views()
    return True


CAPABILITY = Capability(
    "plan",
    modes=MODES,
    element=BimVerifyForecast,
    numbers=_numbers,
    brief=_brief,
    why=_why,
    forget=forecast_scene.forget,
    show=show,
)
