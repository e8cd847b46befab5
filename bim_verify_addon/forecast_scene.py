"""A scan plan in the scene: markers of its set-ups, and on every element what the plan is expected to give."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import bpy
from bpy.props import FloatProperty, IntProperty, StringProperty

from . import scene, survey_scene

if TYPE_CHECKING:
    from ..core.planning.results import ElementForecast, PlanResult

MODE = "FORECAST"
REACHED, HAVE, SHORT, OUT = "REACHED", "HAVE", "SHORT", "OUT"
"""With a planned set-up; by the existing campaign; not even with all set-ups; from no place looked at."""


class BimVerifyForecast(bpy.types.PropertyGroup):
    """What a plan is expected to give for one element; lengths in metres, not-a-number where nothing is measured."""

    kind: StringProperty(description="Empty: not planned for")
    plan_loa: IntProperty(name="Level asked for", description="0: no plan knows this element")
    set_up: IntProperty(name="Complete with set-up")
    target: FloatProperty(name="Asked", default=math.nan)
    reachable: FloatProperty(name="Reachable", default=math.nan)
    coverage: FloatProperty(name="Expected", default=math.nan)
    before: FloatProperty(name="By the campaign", default=math.nan)
    belief: FloatProperty(name="Belief occupied", default=math.nan)
    spacing: FloatProperty(name="Point spacing", default=math.nan)
    sigma: FloatProperty(name="Sigma", default=math.nan)
    level: StringProperty(name="Level expected")


def show_plan(target: bpy.types.Scene, result: PlanResult) -> str:
    """Mark the planned set-ups, colour the elements by their forecast, and return one sentence."""
    from ..core.planning.sentences import plan_sentence  # here: enabling the extension must not wait for its libraries
    from ..core.quality.levels import ACTIONS
    from . import paint

    existing = scene.objects_of(target, result.model)
    for forecast in result.forecasts:
        _store(existing[forecast.global_id].bim_verify_plan, forecast, result.options.loa)
    survey_scene.show_stations(target, [
        survey_scene.Marker(
            s.name, s.position, result.scanner.elevation_min,
            "; ".join(ACTIONS[action] for action in s.actions) or f"measures {s.area:.0f} m2, {s.new_area:.0f} m2 more",
            planned=True,
        )
        for s in result.stations
    ], planned=True)
    target.bim_verify.color_mode = MODE
    paint.refresh(target)
    target[survey_scene.SUMMARY_KEY] = plan_sentence(result)
    return str(target[survey_scene.SUMMARY_KEY])


def forget(target: bpy.types.Scene) -> None:
    """What was forecast for the elements is no more; the markers stay."""
    for item in scene.element_objects(target).values():
        item.property_unset("bim_verify_plan")


def _store(stored: BimVerifyForecast, forecast: ElementForecast, loa: int) -> None:
    stored.kind, stored.plan_loa, stored.set_up = _kind(forecast), loa, max(forecast.reached_by, 0)
    for name in ("target", "reachable", "coverage", "before", "belief"):
        setattr(stored, name, getattr(forecast, name))
    for name in ("spacing", "sigma"):
        value = getattr(forecast, name)
        setattr(stored, name, math.nan if value is None else value)
    stored.level = "NONE" if forecast.loa is None else f"LOA{forecast.loa}"


def _kind(forecast: ElementForecast) -> str:
    if not forecast.chosen:
        return ""
    if forecast.target <= 0:
        return OUT
    return REACHED if forecast.reached_by > 0 else HAVE if forecast.reached_by == 0 else SHORT
