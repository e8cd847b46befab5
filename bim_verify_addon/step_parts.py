"""What the steps of the sidebar are made of: the main button, and what a step needs that is not there yet."""

from __future__ import annotations

import bpy

from . import project
from .capability import StepState
from .shared_settings import KnownRegistration

MAIN_HEIGHT = 1.4
"""Of the main button, in heights of a common one."""


def main_button(layout: bpy.types.UILayout, operator: str, icon: str) -> None:
    """The one button of a step that does its work."""
    row = layout.row()
    row.scale_y = MAIN_HEIGHT
    row.operator(f"bim_verify.{operator}", icon=icon)


def registration(layout: bpy.types.UILayout, settings: KnownRegistration) -> None:
    """Whether the stations' registration is known, and how well."""
    layout.prop(settings, "registration_known")
    row = layout.row()
    row.active = settings.registration_known
    row.prop(settings, "registration_sigma_mm")


def reached(found: str, optional: str, missing: str) -> StepState:
    """The state of an optional step: what it found; else what it is for, and what it still needs (empty: nothing)."""
    if found:
        return StepState(True, found)
    return StepState(False, f"{optional}\n{missing}" if missing else optional)


def missing(scene: bpy.types.Scene, *, model: bool = True, scans: bool = True) -> str:
    """``Needs a model`` or ``Needs a scan`` where one is asked for and not there; else empty."""
    settings = scene.bim_verify
    if model and not project.has_model(settings):
        return "Needs a model"
    if scans and not project.scan_paths(settings):
        return "Needs a scan"
    return ""
