"""What the steps beside Verify found, for the IFC file: into Bonsai's at once, else kept until the model is exported.

The scene names what is kept by keys, so undo in Blender brings the earlier one back.
"""

from __future__ import annotations

import bpy

from . import bonsai
from .session import SESSION, Edit


def put(context: bpy.types.Context, name: str, edit: Edit, *, adds: bool = False) -> None:
    """``name``: of the operator; what it found before is replaced, or stays under this one where this ``adds`` to it."""
    bonsai.change_file(context, name, edit)
    kept = context.scene.bim_verify.edits
    entry = next((e for e in kept if e.step == name), None) or kept.add()
    earlier = SESSION.edits.get(entry.key, ()) if adds else ()
    entry.step, entry.key = name, SESSION.edits.keep((*earlier, edit))


def kept(scene: bpy.types.Scene) -> list[Edit]:
    """Those that are in memory, in the order in which the steps were done first."""
    return [edit for entry in scene.bim_verify.edits for edit in SESSION.edits.get(entry.key, ())]
