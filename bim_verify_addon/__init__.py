"""The Blender face of bim_verify: the only code of the project that imports ``bpy``."""

from __future__ import annotations


def register() -> None:
    """Register everything with Blender."""
    from . import registration

    registration.register()


def unregister() -> None:
    """Take everything back; nothing of the extension is left in Blender."""
    from . import registration

    registration.unregister()
