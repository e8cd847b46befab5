"""Did an element slide along its visible faces? Its faces then stay in their planes and only its ends tell.

The rays through the strip that it left pass it, those through the strip that it covers now return from it, and beyond that
strip there is nothing. All three are asked of single rays where they cross the plane of the face, so that the end is found
far closer than the spacing of the rays.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..model.on_element import plane_crossing
from ..progress import Progress
from .collect import Queries
from .decide import Context, Place
from .displacement import Shift
from .hypotheses import face_groups
from .outline import goes_on
from .sightings import AT, BEYOND, SEARCH_M, Sightings

if TYPE_CHECKING:
    from .scenery import AsBuilt, Scenery

Array = NDArray[np.float64]

ALONG = 0.3
"""A face lies along a direction when the cosine between its normal and the direction is below this."""
LEAST_SLIDE_M = 0.008
"""A beam some mm wide that straddles the true end returns a range in between: nearer ends are not told apart."""
LEAST_RAYS = 8
PURE_SHARE = 0.8
"""Of the rays through the strip that was left, and of those through the strip that was covered, this many must say so."""
STRIP_LEVELS = (1 / 6, 1 / 2, 5 / 6)
MOST_STRIP = 240
"""Query positions along an end."""
BEAM_EDGE_M = 0.002
"""How well a ray can say on which side of an end it passed: half of a beam's width, as a standard deviation."""


@dataclass(frozen=True)
class Slide:
    """A shift along faces that stay in their planes."""

    element: int
    direction: Array
    """(3,) unit vector."""
    length: float
    """Metres."""
    sigma: float
    rays: int
    """That passed the strip that it left."""
    end: float
    """Coordinate along ``direction`` of the planned leading end, metres."""

    @property
    def vector(self) -> Array:
        return self.length * self.direction


def crossings(seen: Sightings, start: Array, position: Array, normal: Array) -> Array:
    """(M, 3) where rays from ``start`` (M, 3) cross the planes of their queries, which have position and normal (M, 3)."""
    ray = seen.point.astype(np.float64) - start
    ray /= np.linalg.norm(ray, axis=1, keepdims=True)
    return plane_crossing(start, ray, position, normal)


def candidate_slides(scenery: Scenery, e: int, seen: Sightings, context: Context) -> list[Slide]:
    """Slides of element ``e`` worth a look, from what was ``seen`` of it at its planned place."""
    state = seen.state(context.window)
    telling = np.flatnonzero(seen.on_face & ((state == AT) | (state == BEYOND)))
    if np.sum(state[telling] == BEYOND) < LEAST_RAYS:
        return []
    telling = telling[np.unique(seen.ray_key(telling), return_index=True)[1]]
    passed = state[telling] == BEYOND
    if passed.sum() < LEAST_RAYS:
        return []
    s = scenery.samples
    local = seen.sample[telling].astype(np.int64)
    normal = s.normal[local]
    told = seen.rows(telling)
    place = crossings(told, scenery.origins(told), s.position[local], normal)
    triangle = slice(*scenery.model.triangle_start[[e, e + 1]])
    corner, facing = scenery.surfaces.corner[triangle], scenery.surfaces.normal[triangle]
    _, axes = face_groups(facing, np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1))
    found = []
    least = max(LEAST_SLIDE_M, 4.0 * context.registration_sigma)
    for d in _both_ways(axes):
        faces = np.abs(facing @ d) < ALONG
        of = np.abs(normal @ d) < ALONG
        if not faces.any() or of.sum() < 2 * LEAST_RAYS:
            continue
        along = corner[faces].reshape(-1, 3) @ d
        end = _left_strip(place[of] @ d - along.min(), passed[of])
        if end is not None and least < end[0] <= SEARCH_M:
            found.append(Slide(e, d, end[0], float(np.hypot(end[1], BEAM_EDGE_M)), end[2], float(along.max())))
    return found


def _both_ways(axes: Array) -> list[Array]:
    """The different axes among face directions, each both ways."""
    chosen: list[Array] = []
    for axis in axes:
        if all(abs(float(axis @ other)) < 0.97 for other in chosen):
            chosen.append(axis)
    return [sign * axis for axis in chosen for sign in (1.0, -1.0)]


def _left_strip(distance: Array, passed: NDArray[np.bool_]) -> tuple[float, float, int] | None:
    """How far from the trailing end the rays pass: (width [m], its sigma, rays). None when they do not, or all do.

    distance (R,) [m] of each ray from that end; passed (R,) whether it went through.
    """
    order = np.argsort(distance)
    y, p = distance[order], passed[order]
    score = np.cumsum(np.where(p, 1, -1))
    last = int(np.argmax(score))
    count = last + 1
    inside, beyond = int(p[:count].sum()), p[count:]
    if inside < LEAST_RAYS or inside < PURE_SHARE * count or len(beyond) < LEAST_RAYS or beyond.mean() > 0.5:
        return None
    gap = float(y[count] - y[last])
    return float(0.5 * (y[count] + y[last])), gap / 12**0.5, inside


def probe_slides(
    scenery: Scenery, asked: list[Slide], plans: list[Place], as_built: AsBuilt | None, context: Context,
    progress: Progress,
) -> dict[int, list[Place]]:
    """The places that slides lead to, of those whose leading end is found where it should be."""
    if not asked:
        return {}
    s = scenery.samples
    margin = scenery.ring_margin
    first = s.first_of(len(plans))
    position, sample, owner, shift = [], [], [], []
    beyond_end = []
    for k, slide in enumerate(asked):
        rows = np.arange(first[slide.element], first[slide.element + 1])
        rows = rows[s.exposed[rows] & (np.abs(s.normal[rows] @ slide.direction) < ALONG)]
        along = s.position[rows] @ slide.direction
        near = rows[along > slide.end - max(slide.length, 0.05)]
        near = near[:: max(len(near) // MOST_STRIP, 1)]
        base = s.position[near] - (s.position[near] @ slide.direction)[:, None] * slide.direction
        for level in (*STRIP_LEVELS, None):
            x = slide.end + (level * slide.length if level is not None else slide.length + margin)
            position.append(base + x * slide.direction)
            sample.append(near)
            owner.append(np.full(len(near), k))
            shift.append(np.broadcast_to(slide.vector, (len(near), 3)))
            beyond_end.append(np.full(len(near), level is None))
    rows, ask, ring = np.concatenate(sample), np.concatenate(owner), np.concatenate(beyond_end)
    queries = Queries(
        number=np.arange(len(rows)), position=np.concatenate(position), normal=s.normal[rows], element=s.element[rows],
        triangle=s.triangle[rows], shift=np.concatenate(shift),
    )
    seen = scenery.look(queries, progress)
    seen = scenery.explain(seen, seen.on_face | ring[seen.sample], queries.element[seen.sample], as_built)
    state = seen.state(context.window)
    found: dict[int, list[Place]] = {}
    ask = ask[seen.sample]
    for k, slide in enumerate(asked):
        strip = (ask == k) & seen.on_face & ~ring[seen.sample]
        covered, open_ = (len(np.unique(seen.ray_key(strip & (state == what)))) for what in (AT, BEYOND))
        if covered < LEAST_RAYS or covered < PURE_SHARE * (covered + open_):
            continue
        around = seen.rows((ask == k) & ring[seen.sample])
        if goes_on(around, context.sigma, context.thresholds.outline_share):
            continue
        found.setdefault(slide.element, []).append(slid(slide, plans[slide.element], covered))
    return found


def slid(slide: Slide, plan: Place, covered: int) -> Place:
    """The place of an element that slid: what its faces say across them, and its end along them."""
    fit, d = plan.fit, slide.direction
    if len(fit.determined):
        d = d - fit.determined.T @ (fit.determined @ d)
    left = float(np.linalg.norm(d))
    if left > 0.5:
        d = d / left
        fit = Shift(
            fit.vector + slide.length * d, fit.covariance + slide.sigma**2 * np.outer(d, d),
            fit.registration + np.outer(d, d), np.vstack([fit.determined, d]), fit.residual_sigma,
        )
    left_area = slide.rays / max(plan.rays, 1) * (plan.at + plan.beyond)
    return Place(
        slide.vector, plan.at, max(plan.beyond - left_area, 0.0), plan.hidden, plan.exposed, plan.sightings + covered,
        plan.rays + covered,
        plan.stations, fit,
    )
