"""What a capability adds to the Blender face beside its operators: its step, its colours, its settings, its numbers.

A capability is one module of ``capabilities`` that has a ``CAPABILITY``, and one name in the list there. Everything else
(sidebar, colour modes, legend, finding list, isolate and step, what is stored, registration) is made from these records.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import bpy

from .colors import Legend, Mode


@dataclass(frozen=True)
class StepState:
    """How far one step of the work is."""

    done: bool
    text: str
    """What was reached, or what is missing."""


@dataclass(frozen=True)
class Step:
    """One step of the work: a sub-panel of the sidebar with its state, one main button, and folded expert settings."""

    name: str
    """Identifier; the panel is ``BIMVERIFY_PT_step_<name>``."""
    label: str
    state: Callable[[bpy.types.Scene], StepState]
    draw: Callable[[bpy.types.UILayout, bpy.types.Context], None]
    """The main button and the settings that most users touch."""
    expert: Callable[[bpy.types.UILayout, bpy.types.Context], None] | None = None
    """Settings that rarely need a change; drawn in a folded sub-panel."""
    optional: bool = False
    """Folded at first: the work goes on without it."""


@dataclass(frozen=True)
class Capability:
    """What one capability brings. ``settings`` and ``element`` are stored in the .blend file."""

    name: str
    step: Step | None = None
    modes: tuple[Mode, ...] = ()
    """Colour modes; categorical ones also fill the finding list."""
    settings: type[bpy.types.PropertyGroup] | None = None
    """Becomes ``scene.bim_verify_<name>``."""
    element: type[bpy.types.PropertyGroup] | None = None
    """What is known of one element; becomes ``object.bim_verify_<name>``."""
    classes: tuple[type, ...] = ()
    """Further classes to register, before the two above: property groups inside them, lists."""
    numbers: Callable[[bpy.types.Object], list[tuple[str, str]]] | None = None
    """(name, value with unit) rows for the panel of the active element; empty where nothing is known of it."""
    brief: Callable[[bpy.types.Object, int], list[str]] | None = None
    """A few lines for the read-out under the mouse. Also given: the vertex pointed at, -1 where there is none."""
    why: Callable[[bpy.types.Object], str] | None = None
    """The sentence below them."""
    legend: Callable[[bpy.types.Scene], Legend | None] | None = None
    """Colours of its own in the view, beside those of the mode: what they mean, while there are any."""
    forget: Callable[[bpy.types.Scene], None] | None = None
    """Another model was imported: what was found on the one before holds no more."""
    show: Callable[[bpy.types.Scene, Any], bool] | None = None
    """Put a result (``Outcome.result`` of a command with ``--blend``) into an empty scene; False if it is not one's own."""
