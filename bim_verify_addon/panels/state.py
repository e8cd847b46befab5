"""What each step of the work has reached. Plain facts, so that the panels only draw."""

from __future__ import annotations

from dataclasses import dataclass

import bpy

from .. import bonsai, project
from ..session import SESSION


@dataclass(frozen=True)
class StepState:
    """One step."""

    done: bool
    text: str
    """What was reached, or what is missing."""


def model(scene: bpy.types.Scene) -> StepState:
    """A model is there."""
    settings = scene.bim_verify
    if bonsai.live_file() is not None:
        return StepState(True, settings.model_summary or "Bonsai's project")
    if settings.model_path:
        return StepState(True, settings.model_summary)
    return StepState(False, "No model yet")


def scans(scene: bpy.types.Scene) -> StepState:
    """At least one scan is in use."""
    used = [scan for scan in scene.bim_verify.scans if scan.use]
    if not used:
        return StepState(False, "No scan yet")
    points = sum(scan.points for scan in used)
    stations = sum(scan.stations for scan in used)
    return StepState(True, f"{points / 1e6:.1f} M points, {stations} station{'s' if stations != 1 else ''}")


def align(scene: bpy.types.Scene) -> StepState:
    """Optional: scans that are in the model's frame need none."""
    settings = scene.bim_verify
    if settings.alignment_summary:
        return StepState(True, settings.alignment_summary)
    return StepState(False, "Optional: scans are taken as they are")


def verify(scene: bpy.types.Scene) -> StepState:
    """There is a result."""
    settings = scene.bim_verify
    if settings.counts:
        return StepState(True, settings.result_summary)
    if not project.has_model(settings):
        return StepState(False, "Needs a model")
    if not any(scan.use for scan in settings.scans):
        return StepState(False, "Needs a scan")
    return StepState(False, "Ready")


def export(scene: bpy.types.Scene) -> StepState:
    """The verdicts are in a file."""
    settings = scene.bim_verify
    if settings.exported_path:
        return StepState(True, f"Written: {settings.exported_path}")
    if scene.name in SESSION.results:
        in_bonsai = bonsai.live_file() is not None
        return StepState(in_bonsai, "In Bonsai's project: save it there" if in_bonsai else "Ready")
    return StepState(False, "Verify again in this session" if settings.counts else "Needs a result")
