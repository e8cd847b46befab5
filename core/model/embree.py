"""Embree's scenes, all of one device: a process that opens one for every scene has none left after some thousand."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray


@cache
def _device() -> Any:
    from embreex.rtcore import EmbreeDevice

    return EmbreeDevice()


def triangle_scene(corners: NDArray[np.floating]) -> tuple[Any, Any]:
    """Embree's scene of triangles ``corners`` (T, 3, 3), taken in single precision, and its mesh, which must live as long."""
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene

    scene = EmbreeScene(_device())
    return scene, TriangleMesh(scene, np.ascontiguousarray(corners, dtype=np.float32))
