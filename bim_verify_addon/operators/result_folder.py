"""Operators that write all that a step found into one folder: model, report, tables, shapes."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import bpy
from bpy.props import BoolProperty, StringProperty

from ...core.errors import BimVerifyError
from ...core.files import all_or_none, make_folder, whole_file
from ...core.progress import Progress
from .. import bonsai, inputs
from ..jobs import Work
from .file_browser import FileJob, idle


class Part(NamedTuple):
    """A file or folder of the folder."""

    name: str
    write: Callable[[Path, Progress], object]
    wanted: bool = True


class ResultFolder(FileJob[str]):
    """Mixed into an operator; it gives ``found``, ``parts`` and the words below."""

    ending: ClassVar[str] = ""
    """Added to the model's name for the proposed folder."""
    first: ClassVar[str] = ""
    """What has to be done first: ``Find changes``."""

    filepath: StringProperty(name="Folder", subtype="FILE_PATH", description="The folder to write; made if it is missing")
    filter_folder: BoolProperty(default=True, options={"HIDDEN"})

    @classmethod
    def found(cls, scene: bpy.types.Scene) -> Any | None:
        """The result that the scene shows; None where it is not in memory. It has the ``model`` it is about."""
        raise NotImplementedError

    @classmethod
    def shown(cls, scene: bpy.types.Scene) -> bool:
        """Whether the scene shows a result, in memory or not."""
        raise NotImplementedError

    def parts(self, found: Any) -> Sequence[Part]:
        """All that can be written of it; called on the main thread."""
        raise NotImplementedError

    def sources(self, scene: bpy.types.Scene, found: Any) -> list[str]:
        """Files that the result was made from, which must not be written over."""
        return [found.model.path]

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if cls.found(context.scene) is not None:
            return idle(cls)
        known = cls.shown(context.scene)
        cls.poll_message_set(f"{cls.first} again: the result is not in memory" if known else f"{cls.first} first")
        return False

    def proposed(self, context: bpy.types.Context) -> Path:
        found = self.found(context.scene)
        source = Path("model.ifc" if found is None else found.model.path)
        return source.with_name(f"{source.stem}{self.ending}")

    def prepare(self, context: bpy.types.Context) -> Work[str]:
        if not self.filepath:
            raise BimVerifyError("No folder was given. Choose where to write.")
        folder = Path(bpy.path.abspath(self.filepath))
        found = self.found(context.scene)
        if found is None:
            raise BimVerifyError(f"{self.first} first: there is nothing to write.")
        if folder.is_file():
            raise BimVerifyError(f"{folder} is a file. Give a folder.")
        parts = [part for part in self.parts(found) if part.wanted]
        inputs.refuse(*(folder / part.name for part in parts), beside=self.sources(context.scene, found))

        def work(progress: Progress) -> str:
            with all_or_none():
                make_folder(folder)
                for number, part in enumerate(parts):
                    progress.update(number / len(parts), f"Writing {part.name}")
                    part.write(folder / part.name, progress.part(number / len(parts), (number + 1) / len(parts)))
                progress.check()
            return str(folder)

        return work

    def finish(self, context: bpy.types.Context, value: str) -> str:
        return f"Written: {value}"


def model_part(name: str, write: Callable[[Path, Progress], object], wanted: bool) -> Part:
    """The model with property sets: a copy of Bonsai's file in memory, which has them already, or what ``write`` makes."""
    live = bonsai.live_copy() if wanted else None

    def copy(path: Path, progress: Progress) -> None:
        if live is None:
            write(path, progress)
            return
        with live[0], whole_file(path) as temporary:
            shutil.copyfile(live[1], temporary)

    return Part(name, copy, wanted)
