"""Why a simulated campaign cannot see a part of the planned surface: from the scene and the scanner, not from returns."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..evidence.sightings import VISIBLE_SPACINGS
from .campaign import Campaign
from .scanner import Scanner
from .scene import Scene

SEEN, SEEN_THROUGH, ABSORBED, GRAZING, OUT_OF_RANGE, OUTSIDE_VIEW, OCCLUDED = range(7)
NAMES = ("seen", "seen through", "absorbed", "too grazing", "out of range", "outside the field of view", "occluded")
SIGHT_TOLERANCE_M = 0.003
STEEPEST_COS = np.cos(np.radians(80.0))
LEAST_ANSWER = 1.0 - 0.5 ** (1.0 / (math.pi * VISIBLE_SPACINGS**2))
"""Share of beams that must come back for a place to be seen more often than not, that is for one of the beams to come back
that pass it within ``VISIBLE_SPACINGS``: the rule by which the survey calls a place seen."""


@dataclass(frozen=True)
class MissingTruth:
    """Per point (N,)."""

    cause: NDArray[np.int8]
    """Of the station that comes closest to seeing it: the least cause in the order of ``NAMES``."""
    blocker: NDArray[np.int32]
    """(S, N) rows of ``scene.names``: the first thing between each station and the point; -1 where nothing is."""


def missing_truth(
    campaign: Campaign, position: NDArray[np.float64], normal: NDArray[np.float64], element: NDArray[np.int32]
) -> MissingTruth:
    """For points (N, 3) on planned surfaces with outward normals (N, 3), of ``element`` (N,). Metres, local frame.

    Planned elements that were removed are seen through; shifted ones are not judged (their own shifted body would count
    as what hides the plan).
    """
    scene, scanner = campaign.scene, campaign.scanner
    cause = np.full(len(position), OCCLUDED, np.int8)
    blockers = []
    gone = np.zeros(len(campaign.model.elements), dtype=np.bool_)
    gone[[row for row, edit in campaign.edits.items() if edit.kind == "remove"]] = True
    for set_up in campaign.set_ups:
        ray = position - set_up.position
        distance = np.linalg.norm(ray, axis=1)
        ray /= np.maximum(distance, 1e-9)[:, None]
        cosine = -np.einsum("ij,ij->i", ray, normal)
        hit = scene.cast(set_up.position, ray)
        before = hit.distance < distance - SIGHT_TOLERANCE_M
        blocker = np.where(before, scene.owner[hit.triangle], -1).astype(np.int32)
        blockers.append(blocker)
        state = np.where(before | (cosine <= 0), OCCLUDED, SEEN).astype(np.int8)
        open_view = state == SEEN
        state[open_view] = _answer(
            scene, scanner, ray[open_view] @ set_up.rotation, distance[open_view], cosine[open_view], element[open_view]
        )
        state[open_view & gone[element]] = np.where(
            state[open_view & gone[element]] == OUTSIDE_VIEW, OUTSIDE_VIEW, SEEN_THROUGH
        )
        cause = np.minimum(cause, state)
    return MissingTruth(cause, np.array(blockers))


def _answer(
    scene: Scene, scanner: Scanner, direction: NDArray[np.float64], distance: NDArray[np.float64],
    cosine: NDArray[np.float64], owner: NDArray[np.int32],
) -> NDArray[np.int8]:
    """What a surface in plain view sends back: directions (N, 3) in the sensor frame.

    Range, incidence and dullness weaken a return together. The cause is the one without which there would be a return:
    absorbed, if a surface as bright as the scene's median one would answer from there; else too grazing, if that one would
    answer head-on; else out of range.
    """
    elevation = np.arcsin(np.clip(direction[:, 2], -1.0, 1.0))
    outside = (elevation < scanner.elevation_min) | (elevation > scanner.elevation_max)
    usual = np.full(len(distance), float(np.median(scene.reflectance)))
    reflectance = scene.reflectance[owner] * (1.0 - scene.lost_share[owner])
    lost = (_returns(scanner, distance, cosine, reflectance) < LEAST_ANSWER) | (distance > scanner.range_max)
    state = np.full(len(distance), SEEN, np.int8)
    state[lost] = ABSORBED
    state[lost & (_returns(scanner, distance, cosine, usual) < LEAST_ANSWER)] = GRAZING
    state[cosine < STEEPEST_COS] = GRAZING
    head_on = _returns(scanner, distance, np.ones_like(cosine), usual) < LEAST_ANSWER
    state[lost & ((distance > scanner.range_max) | head_on)] = OUT_OF_RANGE
    state[outside] = OUTSIDE_VIEW
    return state


def _returns(
    scanner: Scanner, distance: NDArray[np.float64], cosine: NDArray[np.float64], reflectance: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Share of the beams that come back."""
    power = np.maximum(scanner.power(distance, np.maximum(cosine, 0.0), reflectance), 1e-12)
    return 1.0 / (1.0 + (scanner.weakest_power / power) ** 4)
