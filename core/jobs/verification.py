"""The main job: the whole way from files to verdicts."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ... import __version__
from ..alignment.align import align
from ..alignment.transform import TransformedSource, whole_transform
from ..errors import BimVerifyError
from ..evidence import decide
from ..evidence.beside import shares_beside
from ..evidence.collect import StationIndexes
from ..evidence.decide import Context
from ..evidence.error_model import estimate_errors
from ..evidence.fuse_samples import fuse_samples
from ..evidence.gather import SensorModel
from ..evidence.photo_campaign import adjusted_freely, photo_campaign, place_sigma, read_dense, shared_sigma
from ..evidence.photo_table import photo_table
from ..evidence.scenery import Scenery, with_glass
from ..evidence.settle import settled
from ..evidence.sightings import Sightings
from ..evidence.thresholds import Thresholds
from ..evidence.verify import Findings, comes_near, looks_through_glass, places
from ..imagery.block_points import BlockPoints
from ..model.elements import BuildingModel
from ..model.on_element import ElementSurfaces
from ..model.raycast import RayScene
from ..model.sample_surface import MOST, sample_surface
from ..model.samples import SurfaceSamples
from ..options import VerifyOptions
from ..progress import Progress
from ..results import AlignmentRecord, ElementPhotos, ElementVerdict, StationRecord, VerificationResult
from ..scans.campaign import ScanSource
from ..scans.store import ReturnStore
from ..sensing.loa import UPPER_BOUND_M, level_sigma
from ..sensing.presets import PRESETS, ZONE_SIGMAS
from .asked import narrowed
from .inputs import Stopwatch, limited_threads, open_campaign, open_model, open_with_blocks


def verify(
    model: BuildingModel | str | Path,
    scans: ScanSource | Sequence[str | Path],
    options: VerifyOptions | None = None,
    progress: Progress | None = None,
) -> VerificationResult:
    """Verify every element of a model against scans.

    ``model`` and ``scans`` may be files or what was read from them. Nothing is written. Raises BimVerifyError with one
    sentence when a file cannot be used, when the scans do not come near the model, or when an alignment is asked for that
    the geometry does not fix.
    """
    options = options or VerifyOptions()
    progress = progress or Progress()
    with limited_threads(options.threads):
        watch = Stopwatch()
        model = open_model(model, options, progress.part(0.0, 0.1))
        watch.lap("tessellation")
        source, blocks = open_with_blocks(model, scans, options)
        return _verify(model, source, blocks, options, progress.part(0.1, 1.0), watch)


def align_scans(
    model: BuildingModel | str | Path,
    scans: ScanSource | Sequence[str | Path],
    options: VerifyOptions,
    progress: Progress | None = None,
) -> AlignmentRecord:
    """Only the alignment that ``verify`` with the same options begins with.

    Its ``transform`` applies to scans that are in the model's frame already (``scans.frame.to_model_frame``). Raises
    BimVerifyError when a file cannot be used, or when the geometry does not fix the pose.
    """
    progress = progress or Progress()
    with limited_threads(options.threads):
        model = open_model(model, options, progress.part(0.0, 0.2))
        source = open_campaign(model, scans, options)
        progress.update(0.2, "Spreading query positions over the model")
        samples = sample_surface(model, options.sample_spacing)
        return _align(model, samples, source, options, progress.part(0.3, 1.0))


def _verify(
    model: BuildingModel, source: ScanSource, blocks: Sequence[BlockPoints], options: VerifyOptions, progress: Progress,
    watch: Stopwatch,
) -> VerificationResult:
    progress.update(0.0, "Spreading query positions over the model")
    scene = RayScene(model)
    samples = sample_surface(model, options.sample_spacing, scene=scene, cache=options.cache)
    watch.lap("query positions")
    record = _align(model, samples, source, options, progress.part(0.05, 0.2))
    if options.align != "none":
        source = TransformedSource(source, record.transform)
        watch.lap("alignment")
    samples = narrowed(model, samples, options.only)
    photo = photo_campaign(source.stations, blocks, options.sigma)
    if photo is not None:
        options = replace(options, sigma=photo.sigma)
    if options.dense:
        transform = whole_transform(source)
        dense = read_dense(options.dense, transform, model.origin, blocks, photo, options.preset, options.memory_gb)
        photo = None if photo is None else replace(photo, dense=dense)
    with ReturnStore(source, options.memory_gb, progress.part(0.2, 0.4)) as store:
        watch.lap("reading")
        stations = StationIndexes(store, model.origin, photo)
        scenery = Scenery(
            model, samples, stations, scene, ElementSurfaces(model), _sensor(options),
            explain_within=min(UPPER_BOUND_M[options.loa], Thresholds.explain_within) + 2 * options.sigma,
        )
        seen = scenery.look(scenery.plan_queries(), progress.part(0.4, 0.75))
        if not comes_near(model, seen):
            raise BimVerifyError(_far_away(model, source))
        context = _context(scenery, seen, options, record, blocks)
        seen = with_glass(scenery, seen, samples.triangle[seen.sample], context.see_through)
        watch.lap("evidence")
        found = places(scenery, seen, context, progress.part(0.75, 0.98))
        if photo is None:  # the rays of photos have no width, and no returns around them
            found = settled(scenery, found, context, progress.part(0.98, 0.99))
        evidence = fuse_samples(
            len(samples), found.seen, options.fusion, ZONE_SIGMAS * level_sigma(options.loa), context.registration_sigma,
            context.thresholds.conflict_cap, options.sigma, context.window,
        )
        watch.lap("decision")
        result = VerificationResult(
            model=model, options=options, verdicts=(), samples=found.samples, evidence=evidence,
            stations=_station_records(store, stations, context), alignment=record, scan_paths=source.paths,
            scan_date=max((s.acquired for s in store.stations), default=""),
            method=f"bim_verify {__version__} {options.fusion}/{options.preset}",
            dropped={k: int(v) for k, v in vars(source.dropped).items() if not k.startswith("_")},
            timings=watch.seconds, warnings=tuple(_warnings(scenery, context, options, place_sigma(blocks))),
        )
        verdicts = tuple(_conclude(scenery, result, found, context, progress.part(0.99, 1.0)))
        photos: tuple[ElementPhotos, ...] = ()
        if photo is not None:
            photos = photo_table(photo, found.seen, found.samples, verdicts, scenery.sensor, context.window)
        return replace(result, verdicts=verdicts, photos=photos)


def _align(
    model: BuildingModel, samples: SurfaceSamples, source: ScanSource, options: VerifyOptions, progress: Progress
) -> AlignmentRecord:
    return align(
        model, samples, source, options.align, sigma=options.sigma, loa=options.loa, seed=options.seed, progress=progress
    )


def _sensor(options: VerifyOptions) -> SensorModel:
    if options.preset != "derived" and options.preset not in PRESETS:
        raise BimVerifyError(f"There is no preset {options.preset!r}; choose derived, {', '.join(sorted(PRESETS))}.")
    fixed = None if options.preset == "derived" else PRESETS[options.preset]
    return SensorModel(options.sigma, level_sigma(options.loa), fixed)


def _context(
    scenery: Scenery, seen: Sightings, options: VerifyOptions, record: AlignmentRecord, blocks: Sequence[BlockPoints]
) -> Context:
    photo = scenery.stations.photo
    thresholds = Thresholds()
    window = max(UPPER_BOUND_M[options.loa], thresholds.window_floor) + 3 * options.sigma
    errors = estimate_errors(
        seen, scenery.samples, options.sigma, window, len(scenery.stations.stations), options.registration_sigma,
        None if photo is None else photo.body,
    )
    registration = errors.registration.sigma
    if photo is not None and options.registration_sigma is None:
        registration = max(registration, shared_sigma(blocks))
    if record.covariance is not None:
        registration = float(np.hypot(registration, record.axis_sigma))
    elif options.registration_sigma is None:
        registration = max(registration, place_sigma(blocks))
    return Context(
        loa=options.loa, sigma=options.sigma, registration_sigma=registration, errors=errors, window=window,
        see_through=looks_through_glass(scenery, seen, window), thresholds=thresholds,
        station_names=(*(s.name for s in scenery.stations.stations), "dense points"),
    )


def _far_away(model: BuildingModel, source: ScanSource) -> str:
    positions = np.array([s.position for s in source.stations])
    low, high = model.bounds + model.origin
    away = np.linalg.norm(np.maximum(np.maximum(low - positions, positions - high), 0.0), axis=1).min()
    return (
        f"No return of {', '.join(Path(p).name for p in source.paths)} comes near the model; the nearest station stands "
        f"{away:,.0f} m from it, so scan and model are in different frames: register the scan, or use --align auto."
    )


def _conclude(
    scenery: Scenery, result: VerificationResult, found: Findings, context: Context, progress: Progress
) -> Iterator[ElementVerdict]:
    beside = shares_beside(scenery, found, context, progress)
    first = found.samples.first_of(len(found.plans))
    for e, (plan, place) in enumerate(zip(found.plans, found.best, strict=True)):
        rows = slice(int(first[e]), int(first[e + 1]))
        yield decide.conclude(e, result.model, found.samples, rows, result.evidence, plan, place, context, beside.get(e, 0.0))


def _station_records(store: ReturnStore, stations: StationIndexes, context: Context) -> tuple[StationRecord, ...]:
    return tuple(
        StationRecord(
            name=s.name, position=(float(s.position[0]), float(s.position[1]), float(s.position[2])),
            returns=store.count(i), spacing_rad=stations.spacing[i], registration_sigma=context.registration_sigma,
            known=s.known, acquired=s.acquired, sensor=s.sensor,
        )
        for i, s in enumerate(store.stations)
    )


def _warnings(scenery: Scenery, context: Context, options: VerifyOptions, place: float) -> Iterator[str]:
    free = place > 0.0 and options.align == "none"
    if free:
        stated = None if options.registration_sigma is None else context.registration_sigma
        yield f"{adjusted_freely(place, stated)}, or state --registration-sigma-mm."
    if options.sigma > level_sigma(options.loa):
        yield (
            f"One return's sigma of {1000 * options.sigma:.1f} mm is larger than that of LOA{options.loa} "
            f"({1000 * level_sigma(options.loa):.1f} mm): single returns cannot confirm this level."
        )
    if context.registration_sigma > level_sigma(options.loa) and not free:
        yield (
            f"The stations agree to {1000 * context.registration_sigma:.1f} mm only, less than LOA{options.loa} needs "
            f"({1000 * level_sigma(options.loa):.1f} mm): register them better before trusting a deviation."
        )
    if len(scenery.samples) >= MOST:
        yield "The model is so large that query positions lie farther apart than asked."
    if context.see_through:
        yield "Rays of this campaign pass planned glass, so a pane that was passed counts as not observed."
    yield from scenery.model.skipped
