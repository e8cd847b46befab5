"""The model against another one: the step, and the colours that say what has a partner there."""

from __future__ import annotations

from typing import TYPE_CHECKING

import bpy
from bpy.props import StringProperty

from .. import scene as scenery
from ..capability import Capability, Step, StepState
from ..colors import Category, categorical
from ..shared_settings import ReportBeside
from ..step_parts import main_button, missing, reached
from ..text import signed_millimetres

if TYPE_CHECKING:
    from ...core.reconstruction.compare import Comparison

KIND_KEY = "bim_verify_compared"
"""On element objects: whether the other model has it."""
DIFFERENCES_KEY = "bim_verify_differences"
"""On those that it has: distance of the middles, differences of length, width and height [m]."""
MATCHED, EXTRA = "MATCHED", "EXTRA"
DIFFERENCES = ("Middle off", "Longer", "Wider", "Higher")


class BimVerifyCompareSettings(ReportBeside, bpy.types.PropertyGroup):
    """Of one scene."""

    summary: StringProperty()


def mark(scene: bpy.types.Scene, comparison: Comparison) -> None:
    """Say on every element of the classes compared whether the other model has it, and how far it is off."""
    _forget(scene)
    items = scenery.element_objects(scene)
    for found in comparison.classes.values():
        for match in found.matches:
            if (item := items.get(match.found.global_id)) is not None:
                item[KIND_KEY] = MATCHED
                item[DIFFERENCES_KEY] = [match.middle, match.length, match.width, match.height]
        for shape in found.extra:
            if (item := items.get(shape.global_id)) is not None:
                item[KIND_KEY] = EXTRA


def _state(scene: bpy.types.Scene) -> StepState:
    return reached(
        scene.bim_verify_compare.summary, "Optional: the model against another IFC file", missing(scene, scans=False)
    )


def _draw(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    layout.prop(context.scene.bim_verify_compare, "with_report")
    main_button(layout, "compare", "SELECT_DIFFERENCE")


def _kind(item: bpy.types.Object) -> str:
    return str(item.get(KIND_KEY, ""))


def _numbers(item: bpy.types.Object) -> list[tuple[str, str]]:
    if not _kind(item):
        return []
    said = [("Other model", "has it" if _kind(item) == MATCHED else "does not have it")]
    return said + [
        (name, signed_millimetres(value)) for name, value in zip(DIFFERENCES, item.get(DIFFERENCES_KEY, ()), strict=False)
    ]


def _forget(scene: bpy.types.Scene) -> None:
    scene.bim_verify_compare.summary = ""
    for item in scenery.element_objects(scene).values():
        for key in (KIND_KEY, DIFFERENCES_KEY):
            item.pop(key, None)


MODES = (
    categorical(
        "COMPARE",
        "Comparison",
        "Whether the other model has the element; what only the other one has is in the report",
        (
            Category(MATCHED, "In both", "The other model has it", (0.0, 0.62, 0.45)),
            Category(EXTRA, "Only here", "The other model has nothing like it there", (0.84, 0.37, 0.0)),
        ),
        _kind,
    ),
)

CAPABILITY = Capability(
    "compare",
    Step("compare", "Compare", _state, _draw, optional=True),
    MODES,
    settings=BimVerifyCompareSettings,
    numbers=_numbers,
    forget=_forget,
)
