"""Query positions spread over the planned surface, and which of them a scanner could ever see."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..parallel import in_chunks
from . import exposure_cache
from .elements import BuildingModel
from .raycast import RayScene
from .samples import SurfaceSamples
from .shared_faces import MOST_HITS, REACH_M, drop_shared, leaves_another

FEWEST = 400
"""Query positions on an element of any size: shares are then resolved to a quarter of a percent."""
MOST = 4_000_000
"""Query positions over all elements; beyond it the spacing grows, so that memory does not follow the building."""
CONTACT_GAP_M = 0.005
"""Faces closer than this touch: no beam of a usual scanner (some mm wide) gets between them and back."""
NEAREST_SCANNER_M = 0.5
"""No scanner measures, or can be set up, closer to a surface than this."""
STEEPEST_VIEW_DEG = (0.0, 30.0, 60.0, 78.0)
"""Incidence angles at which a line of sight is looked for; beyond about 80 degrees a return is no evidence."""
OFFSET_M = 5e-4


def sample_surface(
    model: BuildingModel, spacing: float = 0.02, *, scene: RayScene | None = None, most: int = MOST,
    cache: bool = False,
) -> SurfaceSamples:
    """Spread query positions over every element, ``spacing`` metres apart or closer on small elements.

    Positions follow a low-discrepancy sequence over the triangles in proportion to their area, so the result depends on
    the model alone. A position is not ``exposed`` when another element encloses or touches it, when no line of sight of at
    least 0.5 m leaves it, or when it is the inner side of an open sheet that sees only its own element. With ``cache``
    that answer is kept between runs.
    """
    scene = scene or RayScene(model)
    corner = model.vertices[model.triangles]
    area = 0.5 * np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1)
    element_area = np.bincount(model.triangle_element, weights=area, minlength=len(model.elements))
    wanted = element_area / spacing**2
    if wanted.sum() > most:
        wanted *= most / wanted.sum()
    count = np.where(element_area > 0, np.maximum(np.ceil(wanted), FEWEST), 0).astype(np.int64)

    element = np.repeat(np.arange(len(count), dtype=np.int32), count)
    rank = np.arange(len(element)) - np.repeat(np.cumsum(count) - count, count)
    before = np.concatenate([[0.0], np.cumsum(area)])
    start = model.triangle_start
    target = before[start[element]] + (rank + 0.5) / count[element] * element_area[element]
    triangle = np.clip(np.searchsorted(before, target, side="right") - 1, start[element], start[element + 1] - 1)
    u, v = _r2_sequence(rank)
    fold = u + v > 1
    u, v = np.where(fold, 1 - u, u), np.where(fold, 1 - v, v)
    p = corner[triangle]
    position = p[:, 0] + u[:, None] * (p[:, 1] - p[:, 0]) + v[:, None] * (p[:, 2] - p[:, 0])
    normal = scene.normal[triangle]
    key = exposure_cache.key(model, spacing, most) if cache else ""
    exposed = exposure_cache.read(key, len(element)) if cache else None
    if exposed is None:
        exposed = is_exposed(model, scene, position, normal, element)
        exposed = drop_shared(model, scene, position, normal, element, exposed)
        if cache:
            exposure_cache.write(key, exposed)
    return SurfaceSamples(
        position=position,
        normal=normal,
        area=(element_area / np.maximum(count, 1))[element],
        element=element,
        triangle=triangle.astype(np.int32),
        exposed=exposed,
    )


def _r2_sequence(index: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Roberts' R2 low-discrepancy sequence in the unit square."""
    g = 1.32471795724474602596
    return (0.5 + index / g) % 1.0, (0.5 + index / g**2) % 1.0


def is_exposed(
    model: BuildingModel,
    scene: RayScene,
    position: NDArray[np.float64],
    normal: NDArray[np.float64],
    element: NDArray[np.int32],
) -> NDArray[np.bool_]:
    """(N,) whether a line of sight of at least 0.5 m leaves a position (N, 3), and no other element encloses or touches it.

    ``scene`` may show the elements elsewhere than ``model`` plans them.
    """
    exposed = np.ones(len(position), dtype=np.bool_)

    def work(part: slice) -> None:
        exposed[part] = _exposed_part(model, scene, position[part], normal[part], element[part])

    in_chunks(len(position), work)
    return exposed


def _exposed_part(
    model: BuildingModel,
    scene: RayScene,
    position: NDArray[np.float64],
    normal: NDArray[np.float64],
    element: NDArray[np.int32],
) -> NDArray[np.bool_]:
    origin = position + OFFSET_M * normal
    hits = scene.all_hits(origin, normal, reach=REACH_M, most=MOST_HITS)
    hidden = leaves_another(model, scene, hits, origin, normal, element)
    if not len(hits.distance):
        return ~hidden
    foreign = (hits.triangle[0] >= 0) & (scene.element[hits.triangle[0]] != element)
    hidden |= foreign & hits.entering[0] & (hits.distance[0] < CONTACT_GAP_M)
    near = ~hidden & (hits.distance[0] < NEAREST_SCANNER_M)
    sheet = ~hidden & ~model.closed[element]
    look = np.flatnonzero(near | sheet)
    free, foreign_seen = _look_around(scene, origin[look], normal[look], element[look])
    blind = ~free
    blind |= ~model.closed[element[look]] & ~foreign_seen
    hidden[look[blind]] = True
    return ~hidden


def _look_around(
    scene: RayScene, origin: NDArray[np.float64], normal: NDArray[np.float64], element: NDArray[np.int32]
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Per position: does any line of sight leave it far enough, and does any end elsewhere than on its own element."""
    helper = np.where(np.abs(normal[:, [2]]) < 0.9, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])
    tangent = np.cross(normal, helper)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    second = np.cross(normal, tangent)
    free = np.zeros(len(origin), dtype=np.bool_)
    foreign = np.zeros(len(origin), dtype=np.bool_)
    for incidence in np.radians(STEEPEST_VIEW_DEG):
        turns = 1 if incidence == 0 else 8
        for turn in np.arange(turns) * (2 * np.pi / turns) + incidence:
            direction = np.cos(incidence) * normal + np.sin(incidence) * (
                np.cos(turn) * tangent + np.sin(turn) * second
            )
            distance, triangle = scene.first_hit(origin, direction, REACH_M)
            free |= distance >= NEAREST_SCANNER_M
            foreign |= (triangle < 0) | (scene.element[triangle] != element)
    return free, foreign
