"""Per element what photogrammetric points say of it: the columns of table 7.7 of Meyer (2023)."""

from __future__ import annotations

import math

import numpy as np
from scipy.spatial import cKDTree

from ..model.samples import SurfaceSamples
from ..results import ElementPhotos, ElementVerdict
from ..sensing.presets import MassParameters, derived_masses
from .collect import PhotoCampaign
from .gather import SensorModel
from .sightings import AT, RAYLESS, Sightings

Parameters = tuple[float, float, float]


def photo_table(
    photo: PhotoCampaign, seen: Sightings, samples: SurfaceSamples, verdicts: tuple[ElementVerdict, ...], sensor: SensorModel,
    window: float,
) -> tuple[ElementPhotos, ...]:
    """A row for each element with photogrammetric points at its planned surface; ``window`` [m] around it."""
    at = seen.rows(seen.from_photos & seen.on_face & (seen.state(window) == AT))
    element = samples.element[at.sample]
    dense = _dense_counts(photo, samples, window, len(verdicts))
    rows = []
    for e in np.unique(element):
        own = at.rows(element == e)
        tie = own.rows(own.station != RAYLESS)
        _, first = np.unique(tie.photo[:, 3], return_index=True)
        points, sigma = tie.point[first].astype(np.float64), tie.photo[first, 0]
        spacing = _mean_spacing(points)
        around = own.photo[own.station == RAYLESS, 1]
        dense_sigma = float(around.mean()) if len(around) else None
        tie_sigma = float(sigma.mean()) if len(sigma) else None
        rows.append(ElementPhotos(
            global_id=verdicts[e].global_id, name=verdicts[e].name, queries=int(verdicts[e].sample_count),
            tie_points=len(points), tie_spacing=spacing, tie_sigma=tie_sigma,
            tie_parameters=_parameters(sensor, tie_sigma, spacing),
            dense_points=int(dense[e]), dense_spacing=photo.dense.spacing if photo.dense and dense_sigma else None,
            dense_sigma=dense_sigma,
            dense_parameters=None if photo.dense is None or dense_sigma is None
            else _shown(photo.dense.parameters(dense_sigma, sensor.model_sigma)),
            confirmed={level: verdicts[e].confirmed_ratio[level] for level in (40, 30, 20)},
        ))
    return tuple(rows)


def _dense_counts(photo: PhotoCampaign, samples: SurfaceSamples, window: float, count: int) -> np.ndarray:
    """(E,) dense points that lie nearest to each element's exposed surface, within the window and a sample's spacing."""
    exposed = np.flatnonzero(samples.exposed)
    if photo.dense is None or not len(exposed):
        return np.zeros(count, np.int64)
    spacing = math.sqrt(float(np.median(samples.area[exposed])))
    away, row = cKDTree(samples.position[exposed]).query(
        photo.dense.points, distance_upper_bound=math.hypot(window, spacing), workers=1
    )
    return np.bincount(samples.element[exposed[row[np.isfinite(away)]]], minlength=count)


def _mean_spacing(points: np.ndarray) -> float | None:
    if len(points) < 2:
        return None
    return float(cKDTree(points).query(points, k=2)[0][:, 1].mean())


def _parameters(sensor: SensorModel, sigma: float | None, spacing: float | None) -> Parameters | None:
    if sensor.fixed is not None:
        return _shown(sensor.fixed)
    if sigma is None or not spacing:
        return None
    return _shown(derived_masses(sigma, sensor.model_sigma, spacing))


def _shown(parameters: MassParameters) -> Parameters:
    return parameters.kappa, parameters.lam, parameters.c
