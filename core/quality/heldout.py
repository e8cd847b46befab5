"""Predicted against actual error: components modelled again from the returns of a simulated campaign built as planned."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..model.raycast import RayScene
from ..scans.campaign import ScanSource
from .face_returns import face_returns
from .faces import Face, main_faces, number_faces
from .prediction import ComponentClass, table_for, with_registration
from .remodel import MARGIN_M, remodel_face
from .results import QualityResult

LEAST_FILLED = 0.97
"""Share of its rectangle that a face must fill to have four sides."""
LEAST_SEEN = 0.9
SMALLEST_M = 0.08


@dataclass(frozen=True)
class ErrorPair:
    """One component; metres."""

    kind: str
    predicted: float
    actual: float
    spacing: float


def predicted_and_actual(result: QualityResult, source: ScanSource) -> list[ErrorPair]:
    """Every element whose main face is a rectangle that was seen almost whole, modelled from its returns: its plane, and its
    corners where a side of it ends in the air.

    ``source`` are the scans, in the model's frame, of a building that stands as planned, so what the model differs from
    the plan is its error.
    """
    model, samples = result.model, result.samples
    seen_area = np.bincount(
        samples.triangle, weights=samples.area * result.survey.seen, minlength=len(model.triangles)
    ).astype(np.float64)
    chosen: list[Face] = []
    for row, face in enumerate(main_faces(model, number_faces(model), seen_area)):
        quality = result.elements[row]
        if face is None or quality.predicted_error is None or min(face.width, face.height) < SMALLEST_M:
            continue
        own = np.flatnonzero(samples.element == row)
        place = (samples.position[own] - face.corner) @ face.axes.T
        on = (np.abs(place[:, 2]) < 0.01) & (samples.normal[own] @ face.axes[2] > 0.9)
        if on.sum() < 20 or face.filled < LEAST_FILLED or result.survey.seen[own[on]].mean() < LEAST_SEEN:
            continue
        chosen.append(face)
    points: list[list[NDArray[np.float64]]] = [[] for _ in chosen]
    positions = [s.position - model.origin for s in source.stations]
    gate = result.options.window
    for block in source.blocks():
        point = block.offsets + positions[block.station]
        for face, mine in zip(chosen, points, strict=True):
            if (positions[block.station] - face.corner) @ face.axes[2] <= 0:
                continue
            place = (point - face.corner) @ face.axes.T
            near = (np.abs(place[:, 2]) <= gate) & (place[:, :2] >= -MARGIN_M).all(axis=1)
            near &= (place[:, 0] <= face.width + MARGIN_M) & (place[:, 1] <= face.height + MARGIN_M)
            mine.append(point[near])
    pairs = []
    scene = RayScene(model)
    for face, mine in zip(chosen, points, strict=True):
        own = np.flatnonzero((samples.element == face.element) & samples.exposed)
        returns = face_returns(face, own, samples, result.survey, result.survey.spacing, np.array(positions))
        if returns is None:
            continue
        table = table_for(face, cache=result.options.cache)
        surface, sides = remodel_face(face, np.concatenate(mine), returns, gate)
        free = _free_sides(face, scene) & returns.seen
        actual: dict[ComponentClass, float] = {"surface": surface}
        if free.any():
            actual["outline"] = float(np.hypot(surface, np.sqrt(2.0) * sides[free].mean()))
        for kind, error in actual.items():
            predicted = with_registration(
                table.expected(kind, returns.spacing, returns.noise, returns.across[free].tolist()),
                result.registration_sigma, returns.stations,
            )
            if np.isfinite(predicted) and np.isfinite(error):
                pairs.append(ErrorPair(kind, predicted, error, returns.spacing))
    return pairs


def _free_sides(face: Face, scene: RayScene) -> NDArray[np.bool_]:
    """(4,) the right, left, top and bottom side where the face ends in the air: nothing goes on beyond it or touches it."""
    along = np.linspace(0.1, 0.9, 9)
    free = np.zeros(4, dtype=np.bool_)
    sides = (
        (np.full(9, face.width), along * face.height, 1.0, 0.0), (np.zeros(9), along * face.height, -1.0, 0.0),
        (along * face.width, np.full(9, face.height), 0.0, 1.0), (along * face.width, np.zeros(9), 0.0, -1.0),
    )
    normal = face.axes[2]
    for k, (u, v, du, dv) in enumerate(sides):
        beyond = _points(face, u + 0.02 * du, v + 0.02 * dv, 0.02)
        inward, _ = scene.first_hit(beyond, np.broadcast_to(-normal, beyond.shape), 0.1)
        outward = scene.all_hits(beyond, np.broadcast_to(normal, beyond.shape), 50.0, most=1)
        inside_solid = np.zeros(len(beyond), dtype=np.bool_)
        if len(outward.distance):
            inside_solid = (outward.triangle[0] >= 0) & ~outward.entering[0]
        within = _points(face, u - 0.02 * du, v - 0.02 * dv, 0.02)
        shown, _ = scene.first_hit(within, np.broadcast_to(-normal, within.shape), 0.025)
        free[k] = bool((np.isinf(inward) & ~inside_solid & np.isfinite(shown)).all())
    return free


def _points(
    face: Face, u: NDArray[np.float64], v: NDArray[np.float64], w: float
) -> NDArray[np.float64]:
    return face.corner + u[:, None] * face.axes[0] + v[:, None] * face.axes[1] + w * face.axes[2]


def compare_errors(pairs: list[ErrorPair]) -> str:
    """Mean difference and correlation in one line, millimetres."""
    if len(pairs) < 3:
        return f"{len(pairs)} components, too few to compare"
    predicted, actual = (1000 * np.array([getattr(p, name) for p in pairs]) for name in ("predicted", "actual"))
    away = np.abs(predicted - actual)
    with np.errstate(invalid="ignore"):
        correlation = float(np.corrcoef(predicted, actual)[0, 1])
    return (
        f"{len(pairs)} components: predicted {predicted.mean():.2f} mm, actual {actual.mean():.2f} mm on average; mean "
        f"difference {away.mean():.2f} mm (standard deviation {away.std():.2f}), correlation {correlation:.2f}"
    )
