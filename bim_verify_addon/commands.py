"""``blender --command bim_verify verify ...``: the same commands as the console script."""

from __future__ import annotations

from typing import Any

import bpy

_handle: Any = None


def register() -> None:
    """Make the command known to Blender."""
    global _handle
    _handle = bpy.utils.register_cli_command("bim_verify", _run)


def unregister() -> None:
    """Take it away."""
    global _handle
    if _handle is not None:
        bpy.utils.unregister_cli_command(_handle)
        _handle = None


def _run(argv: list[str]) -> int:
    from ..cli import main

    return main(argv)
