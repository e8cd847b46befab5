"""What tests read from a scene."""

from __future__ import annotations

import bpy


def status_counts(scene: bpy.types.Scene) -> list[tuple[str, int]]:
    """(verdict, number of elements), as the finding list has them."""
    return [(c.category, c.count) for c in scene.bim_verify.counts if c.mode == "STATUS"]
