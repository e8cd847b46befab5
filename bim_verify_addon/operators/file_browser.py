"""File operators that start a job: the browser asks for the name, the job starts when it has closed."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import bpy

from .. import project
from ..jobs import start_soon
from ..session import SESSION


def ask_or_start(
    operator: bpy.types.Operator, context: bpy.types.Context, event: bpy.types.Event | None,
    start: Callable[[bpy.types.Context, bpy.types.Event | None], set[str]],
) -> set[str]:  # fmt: skip
    """``invoke`` of a file operator: open the browser, or start at once when the file is named already."""
    if operator.properties.is_property_set("filepath") or bpy.app.background or context.window is None:
        return start(context, event)
    return _open_browser(operator, context)


def propose(
    operator: bpy.types.Operator, context: bpy.types.Context, event: bpy.types.Event | None, name: Callable[[], Path],
    start: Callable[[bpy.types.Context, bpy.types.Event | None], set[str]],
) -> set[str]:  # fmt: skip
    """``ask_or_start`` of an operator that writes a file: the browser opens with a ``name`` where none was given."""
    if not operator.properties.is_property_set("filepath"):
        operator.filepath = str(name())
        if not bpy.app.background and context.window is not None:
            return _open_browser(operator, context)
    return ask_or_start(operator, context, event, start)


def _open_browser(operator: bpy.types.Operator, context: bpy.types.Context) -> set[str]:
    operator.asked = True
    context.window_manager.fileselect_add(operator)
    return {"RUNNING_MODAL"}


def restart_when_closed(operator: bpy.types.Operator) -> bool:
    """In ``execute``: True when the browser has just answered, and the operator was started anew with that answer.

    The browser calls ``execute``, where no modal job may start; so the same operator is invoked from a timer.
    """
    if not getattr(operator, "asked", False):
        return False
    start_soon(operator)
    return True


def idle(cls: type[bpy.types.Operator]) -> bool:
    """Part of every ``poll``: nothing else runs."""
    if SESSION.job is not None:
        cls.poll_message_set(f"{SESSION.job.title} is running; wait for it or press Esc")
        return False
    return True


def has_model(cls: type[bpy.types.Operator], context: bpy.types.Context) -> bool:
    """Part of ``poll``: a model is there, the scene's or Bonsai's."""
    if project.has_model(context.scene.bim_verify):
        return True
    cls.poll_message_set("Import an IFC model first")
    return False


def has_scans(cls: type[bpy.types.Operator], context: bpy.types.Context) -> bool:
    """Part of ``poll``: at least one scan is in use."""
    if any(scan.use for scan in context.scene.bim_verify.scans):
        return True
    cls.poll_message_set("Add at least one scan first")
    return False


def has_result(cls: type[bpy.types.Operator], context: bpy.types.Context) -> bool:
    """Part of ``poll``: the result that the scene shows is in memory."""
    settings = context.scene.bim_verify
    if settings.result_key in SESSION.results:
        return True
    cls.poll_message_set("Verify again: the result is not in memory" if settings.counts else "Verify first: there is no result")
    return False
