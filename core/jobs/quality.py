"""Scan quality: from files to what every element's returns are worth, what is missing, and why."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from ... import __version__
from ..errors import BimVerifyError
from ..evidence.collect import StationIndexes
from ..evidence.photo_campaign import adjusted_freely, place_sigma
from ..evidence.registration import FALLBACK_M
from ..model.elements import BuildingModel
from ..model.raycast import RayScene
from ..model.sample_surface import sample_surface
from ..progress import Progress
from ..quality.assess import Assessor
from ..quality.built import find_built
from ..quality.color import study_color
from ..quality.edges import edge_distance
from ..quality.faces import main_faces, number_faces
from ..quality.factors import nine_factors
from ..quality.measure import measure
from ..quality.noise import OverlapResiduals, compare_stations, study_edges
from ..quality.occluders import find_occluders
from ..quality.options import QualityOptions
from ..quality.results import PatchQuality, QualityResult, StationQuality
from ..quality.survey import Survey, survey
from ..scans.campaign import ScanSource
from ..scans.store import ReturnStore
from .inputs import Stopwatch, limited_threads, open_model, open_with_blocks

FARTHEST_EDGE_M = 0.5
"""Beyond it a sample counts as far from any edge."""


def quality(
    model: BuildingModel | str | Path,
    scans: ScanSource | Sequence[str | Path],
    options: QualityOptions | None = None,
    progress: Progress | None = None,
) -> QualityResult:
    """Survey what a campaign gives for every element, and why it gives nothing elsewhere.

    ``model`` and ``scans`` may be files or what was read from them. Nothing is written. Raises BimVerifyError with one
    sentence when a file cannot be used, or when the scans do not come near the model.
    """
    options = options or QualityOptions()
    progress = progress or Progress()
    with limited_threads(options.threads):
        watch = Stopwatch()
        model = open_model(model, options, progress.part(0.0, 0.1))
        watch.lap("tessellation")
        source, blocks = open_with_blocks(model, scans, options)
        place = place_sigma(blocks)
        progress.update(0.1, "Spreading query positions over the model")
        scene = RayScene(model)
        samples = sample_surface(
            model, options.sample_spacing, scene=scene, most=options.most_queries, cache=options.cache
        )
        spacing = max(options.sample_spacing, math.sqrt(float(samples.area.sum()) / len(samples)))
        edge = edge_distance(model, samples, FARTHEST_EDGE_M)
        watch.lap("query positions")
        with ReturnStore(source, options.memory_gb, progress.part(0.2, 0.4)) as store:
            watch.lap("reading")
            stations = StationIndexes(store, model.origin)
            face = number_faces(model)
            sample_face = face[samples.triangle]
            built = find_built(model, samples, face, stations, scene, options.window, progress.part(0.4, 0.45))
            watch.lap("built faces")
            found = survey(model, samples, stations, scene, edge, built.moved, options, progress.part(0.45, 0.75))
            counts = [store.count(s) for s in range(len(store.stations))]
        watch.lap("survey")
        if not (found.seen.any() or (found.best.state == 1).any()):
            raise BimVerifyError(
                f"No return of {', '.join(Path(p).name for p in source.paths)} lies on the model's surface: register the "
                "scans to the model first (bim-verify verify --align auto shows whether they can be)."
            )
        positions = np.array(stations.position).reshape(-1, 3)
        names = tuple(s.name for s in store.stations)
        standing = RayScene(model, built.shift) if built.shift.any() else scene
        blocked, clutter = find_occluders(
            model, samples, found, positions, scene, standing, names, options.window, spacing
        )
        edges = study_edges(found, samples, scene, positions, sample_face, options.window)
        overlap = compare_stations(found, len(samples))
        everywhere = overlap.between(slice(None))
        registration = everywhere if math.isfinite(everywhere) else FALLBACK_M
        watch.lap("causes")
        color = study_color(source, stations.spacing, progress.part(0.75, 0.8))
        watch.lap("colour")
        progress.update(0.8, "Expected errors")
        seen_area = np.bincount(
            samples.triangle, weights=samples.area * (found.seen + 1e-6 * samples.exposed), minlength=len(model.triangles)
        ).astype(np.float64)
        assessor = Assessor(
            model, samples, found, blocked, clutter, overlap, edges, main_faces(model, face, seen_area), registration,
            place, names, positions, options,
        )
        elements, patches = [], list[PatchQuality]()
        for row in range(len(model.elements)):
            progress.update(0.8 + 0.2 * row / len(model.elements), "Elements")
            elements.append(assessor.element(row))
            patches += assessor.patches(row, sample_face)
        whole = measure(np.flatnonzero(samples.exposed), samples, found, overlap, found.spacing)
        watch.lap("elements")
        return QualityResult(
            model=model, options=options, elements=tuple(elements), patches=tuple(patches),
            stations=tuple(_stations(store, stations, found, overlap, samples.area, counts, model)), clutter=clutter,
            factors=nine_factors(
                whole, tuple(elements), edges, color, everywhere if math.isfinite(everywhere) else None, sum(counts),
                source.paths, place,
            ),
            whole=whole, samples=samples, survey=found, blocked=blocked, registration_sigma=math.hypot(registration, place),
            scan_paths=source.paths, scan_date=max((s.acquired for s in store.stations), default=""),
            method=f"bim_verify {__version__} quality", timings=watch.seconds,
            warnings=tuple(_warnings(model, spacing, options, math.isfinite(everywhere), place)),
        )


def _stations(
    store: ReturnStore, stations: StationIndexes, found: Survey, overlap: OverlapResiduals, area: np.ndarray,
    counts: list[int], model: BuildingModel,
) -> Iterator[StationQuality]:
    best = np.bincount(
        found.best.station[found.seen].astype(np.int64), weights=area[found.seen], minlength=len(store.stations)
    )
    for i, station in enumerate(store.stations):
        view, bias = found.views[i], float(overlap.station_bias[i])
        yield StationQuality(
            name=station.name,
            position=(float(station.position[0]), float(station.position[1]), float(station.position[2])),
            returns=counts[i], spacing_rad=stations.spacing[i], range_max=view.range_max,
            elevation_min=view.elevation_min, elevation_max=view.elevation_max, best_view_area=float(best[i]),
            registration=bias if math.isfinite(bias) else None,
        )


def _warnings(model: BuildingModel, spacing: float, options: QualityOptions, overlapping: bool, place: float) -> Iterator[str]:
    if place > 0.0:
        yield f"{adjusted_freely(place)}."
    if not overlapping:
        yield (
            f"No surface was seen from two stations, so how well they agree is not known; {1000 * FALLBACK_M:.0f} mm are "
            "assumed."
        )
    if spacing > 1.2 * options.sample_spacing:
        yield (
            f"Query positions lie {1000 * spacing:.0f} mm apart, not {1000 * options.sample_spacing:.0f} mm, to be no more "
            f"than about {options.most_queries:,} (--queries)."
        )
    yield from model.skipped
