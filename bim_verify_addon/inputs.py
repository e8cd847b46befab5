"""Files that a scene reads are never written to, whatever operator writes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

import bpy

from ..core.commands.checks import refuse_inputs
from . import bonsai

SETTINGS = "bim_verify"
"""Settings of the scene begin so; what they hold with this subtype is a file to read."""
FILE = "FILE_PATH"


def refuse(*outputs: str | Path, beside: Iterable[str] = ()) -> None:
    """Raise BimVerifyError where one of these is a file that a scene reads, or the project that Bonsai has open.

    ``beside``: further files that the operator itself reads; empty names are none.
    """
    read = (path for one in bpy.data.scenes for name in _groups(one) for path in _files(getattr(one, name)))
    given = [bpy.path.abspath(path) for path in read]
    refuse_inputs([*given, *filter(None, [bonsai.live_path(), *beside])], [str(output) for output in outputs])


def _groups(scene: bpy.types.Scene) -> list[str]:
    return [p.identifier for p in scene.bl_rna.properties if p.type == "POINTER" and p.identifier.startswith(SETTINGS)]


def _files(group: bpy.types.PropertyGroup) -> Iterator[str]:
    for kind in group.bl_rna.properties:
        value = getattr(group, kind.identifier)
        if kind.type == "COLLECTION":
            for entry in value:
                yield from _files(entry)
        elif kind.type == "STRING" and kind.subtype == FILE and value.strip():
            yield value
