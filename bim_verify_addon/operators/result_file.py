"""Operators that write the result to a file, off the main thread: the browser asks for the name, Esc stops."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import bpy
from bpy.props import BoolProperty

from ...core.errors import BimVerifyError
from ...core.files import all_or_none
from ...core.progress import Progress
from .. import inputs, project, selection
from ..jobs import Work
from .file_browser import FileJob, has_result, idle, named

if TYPE_CHECKING:
    from ...core.results import VerificationResult

Write = Callable[["VerificationResult", Path, Progress], str]


class ResultFile(FileJob[str]):
    """Mixed into an operator with ``filepath``; the operator gives ``ending``, ``suffixes`` and ``writer``."""

    ending: ClassVar[str] = ""
    """Added to the model's name for the proposed file name."""
    suffixes: ClassVar[tuple[str, ...]] = ()
    """Allowed; the first is taken where none was given. Empty: a folder."""

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return has_result(cls, context) and idle(cls)

    def writer(self, context: bpy.types.Context) -> Write:
        """Read what is needed (main thread) and return what writes; it gives one sentence for the status bar."""
        raise NotImplementedError

    def result(self, context: bpy.types.Context) -> VerificationResult:
        """What is written about."""
        return project.result(context.scene)

    def inside(self) -> tuple[str, ...]:
        """Files that are written into such a folder."""
        return ()

    def proposed(self, context: bpy.types.Context) -> Path:
        source = Path(project.model_path(context.scene.bim_verify) or "model.ifc")
        return source.with_name(f"{source.stem}{self.ending}")

    def prepare(self, context: bpy.types.Context) -> Work[str]:
        if not self.filepath:
            raise BimVerifyError("No file name was given. Choose where to write.")
        path = named(self.filepath, *self.suffixes)
        result, write = self.result(context), self.writer(context)
        inputs.refuse(path, *(path / name for name in self.inside()))

        def work(progress: Progress) -> str:
            with all_or_none():
                said = write(result, path, progress)
                progress.check()
            return said

        return work

    def finish(self, context: bpy.types.Context, value: str) -> str:
        context.scene.bim_verify.exported_path = value
        return f"Written: {value}"


class SelectionFile(ResultFile):
    """One that can be about the selected elements alone."""

    selected_only: BoolProperty(
        name="Selected elements only", default=False, description="About the selected elements alone, not about all"
    )

    def result(self, context: bpy.types.Context) -> VerificationResult:
        from ...core.some_elements import of_elements

        only = selection.chosen(context, self.selected_only)
        return super().result(context) if only is None else of_elements(super().result(context), only)
