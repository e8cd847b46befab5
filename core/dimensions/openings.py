"""Clear widths and heights of the openings of a model as built."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..planes.cloud import Cloud
from ..planes.derived import Estimate
from ..results import VerificationResult
from .faces import BEFORE_FACE_M, LEVEL_COS, Face, faces_of, widths
from .opening_edges import hole_on_face
from .opening_faces import planned_hole
from .opening_sides import NO_SCANS, ROLES, at_the_face, in_the_frame, why_not
from .regions import Region
from .table import Dimension, unmeasured, width

Flags = NDArray[np.bool_]

BESIDE_OPENING_M = 0.01
FLOORS = ("IfcSlab", "IfcCovering")
FLOOR_M = 0.05
"""A level surface this close to an opening's lower end is the floor under it."""


def opening_rows(
    opening: Region, result: VerificationResult, names: Sequence[str], measured: Flags, shared: float, rays: Cloud | None
) -> list[Dimension]:
    """Clear width and height: between reveals, lintel and sill or the floor below; between its edges on the wall's faces;
    where neither tells, between the inner faces of what stands in it; else a row that says why not.
    """
    elements, samples = result.model.elements, result.samples
    row_of = {e.global_id: k for k, e in enumerate(elements)}
    if (host := row_of.get(opening.host)) is None:
        return []
    first = samples.first_of(len(names))
    own = np.arange(first[host], first[host + 1])
    own = own[opening.holds(samples.position[own], BESIDE_OPENING_M)]
    own = own[opening.holds(samples.position[own] + BEFORE_FACE_M * samples.normal[own])]
    level = np.flatnonzero((samples.normal[:, 2] > LEVEL_COS) & (np.abs(samples.position[:, 2] - opening.low) < FLOOR_M))
    level = level[opening.holds(samples.position[level], FLOOR_M)]
    below = level[[elements[k].ifc_class.startswith(FLOORS) and k != host for k in samples.element[level]]]
    sides = np.concatenate([own, below])
    fillings = [row_of[g] for g in opening.fillings if g in row_of]
    frame = np.concatenate([below, *(np.arange(first[k], first[k + 1]) for k in fillings)])
    found = list(widths(opening, faces_of(result, sides[measured[sides]]), names, shared))
    # posts between the inner faces of a frame are within the widest pair
    inner = {
        r.what: r for r in sorted(
            widths(opening, faces_of(result, frame[measured[frame]]), names, shared), key=lambda r: r.planned or 0.0
        )
    }  # fmt: skip
    edged = _between_edges(opening, host, fillings, faces_of(result, below[measured[below]]), result, names, rays)
    rows = []
    for what in ROLES:
        clear = [r for r in found if r.what == what] + [r for r in edged if r.what == at_the_face(what)]
        if not clear and what in inner:
            clear = [replace(inner[what], what=in_the_frame(what))]
        if not clear and elements[host].ifc_class.startswith("IfcWall"):
            reason = why_not(what, samples.normal[sides], samples.exposed[sides], measured[sides], [names[k] for k in fillings])
            if rays is None and not result.photos_only:
                reason += f"; {NO_SCANS}"
            clear = [unmeasured(opening.name, opening.global_id, what, (names[host],), reason)]
        rows += [replace(r, opening=True) for r in clear]
    return rows


def _between_edges(
    opening: Region, host: int, fillings: Sequence[int], floor: Sequence[Face], result: VerificationResult,
    names: Sequence[str], rays: Cloud | None,
) -> Iterator[Dimension]:
    """From edge to edge on the wall's face; upwards from the floor where that bounds the opening."""
    hole = None if rays is None else planned_hole(opening, host, fillings, result)
    sigma = max((s.registration_sigma for s in result.stations), default=0.0)
    found = None if hole is None or rays is None else hole_on_face(hole, rays, result.options.sigma, sigma)
    if hole is None or found is None:
        return
    name, start, end = opening.name, hole.box[0], hole.box[1]
    own: tuple[str, ...] = (names[host],)
    if (wide := found.distance("start", "end")) is not None:
        yield width(name, opening.global_id, at_the_face("width"), own, wide, end - start)
    high, planned = found.distance("sill", "head") if hole.on_wall else None, opening.high - opening.low
    if floor:
        face, head = max(floor, key=lambda f: len(f.points)), found.place("head")
        own, high, planned = (names[face.element], names[host]), None, opening.high - float(face.place[2])
        if head is not None:
            under = np.array([[opening.outline.centroid.x, opening.outline.centroid.y, opening.low]])
            level = opening.low - float(face.plane.distance(under)[0]) / float(face.plane.normal[2])
            spread = np.hypot(float(face.plane.sigma_at(under)[0]), sigma)
            high = Estimate(head.value - level, float(np.hypot(head.sigma, spread)))
    if high is not None:
        yield width(name, opening.global_id, at_the_face("height"), own, high, planned)


def opening_shares(rows: Sequence[Dimension]) -> str:
    """In a line: of how many openings the width and the height were measured."""
    told = []
    for what in ROLES:
        own = [r for r in rows if r.opening and r.what.startswith(what)]
        measured = {r.global_id for r in own if r.value is not None}
        framed, edged = (sum(r.what == other for r in own) for other in (in_the_frame(what), at_the_face(what)))
        told.append(
            f"{what}s of {len(measured)} of {len({r.global_id for r in own})} openings ({edged} between edges on the wall's "
            f"face, {framed} within a frame)"
        )
    return f"Measured: {', '.join(told)}; the others have a line that says why not."
