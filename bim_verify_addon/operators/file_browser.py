"""File operators that start a job: the browser asks for the name, the job starts when it has closed."""

from __future__ import annotations

from pathlib import Path
from typing import TypeVar

import bpy

from .. import project, verdicts
from ..jobs import Job, start_soon
from ..session import SESSION

T = TypeVar("T")


class FileJob(Job[T]):
    """A job on a file: the browser asks for its name where none was given, and the job starts when it has closed.

    The browser calls ``execute``, where no modal job may start; so the same operator is invoked from a timer, and the
    call from the browser ends as CANCELLED: it did nothing that could be undone.
    """

    def proposed(self, context: bpy.types.Context) -> Path | None:
        """A name for a file to write; None for a file to read."""
        return None

    def needs_no_file(self, context: bpy.types.Context) -> bool:
        """Whether the job can start without a name."""
        return False

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event | None) -> set[str]:
        """Open the browser, or start at once when the file is named already."""
        named = self.properties.is_property_set("filepath") or self.needs_no_file(context)
        if not named and (name := self.proposed(context)) is not None:
            self.filepath = str(name)
        if named or bpy.app.background or context.window is None:
            return super().invoke(context, event)
        self.take_settings(context)
        self.asked = True
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Do it, or start it anew when the browser has just answered."""
        if getattr(self, "asked", False):
            start_soon(self)
            return {"CANCELLED"}
        return super().execute(context)


def chosen(operator: bpy.types.Operator) -> list[str]:
    """The files that a person chose together, or the one that a script named; empty where there is none.

    The operator has ``filepath``, and ``directory`` and ``files`` as the browser fills them.
    """
    names = [entry.name for entry in operator.files if entry.name]
    given = [str(Path(operator.directory) / name) for name in names] or [operator.filepath]
    return [str(Path(bpy.path.abspath(path)).absolute()) for path in given if path]


def named(filepath: str, *endings: str) -> Path:
    """The file that a person named, with the first of ``endings`` added where the name has none of them.

    Added and not put in the place of another one: ``house.v2`` becomes ``house.v2.ifc``, and not a ``house.ifc`` that the
    browser never asked about.
    """
    path = Path(bpy.path.abspath(filepath))
    return path if not endings or path.suffix.lower() in endings else path.with_name(path.name + endings[0])


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
    if project.scan_paths(context.scene.bim_verify):
        return True
    cls.poll_message_set("Add at least one scan first")
    return False


def has_result(cls: type[bpy.types.Operator], context: bpy.types.Context) -> bool:
    """Part of ``poll``: the result that the scene shows is in memory."""
    settings = context.scene.bim_verify
    if settings.result_key in SESSION.results:
        return True
    known = verdicts.verified(context.scene)
    cls.poll_message_set("Verify again: the result is not in memory" if known else "Verify first: there is no result")
    return False
