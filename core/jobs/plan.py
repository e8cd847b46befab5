"""Planning: from a model, and perhaps an existing campaign, to stations that reach a level of accuracy."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ... import __version__
from ..errors import BimVerifyError
from ..model.elements import BuildingModel
from ..model.sample_surface import sample_surface
from ..model.samples import SurfaceSamples
from ..planning.choose import choose_places, in_order
from ..planning.cover import Array, shared_enough
from ..planning.existing import Existing, clutter_props
from ..planning.forecast import forecast
from ..planning.goals import set_goals
from ..planning.options import PlanOptions
from ..planning.quick_start import quick_start
from ..planning.results import PlanResult
from ..planning.set_ups import list_set_ups, warnings
from ..planning.site import Places, Site
from ..planning.targets import Targets, choose_elements, pick_targets, second_targets
from ..planning.visibility import Requirement, registrable, view_matrix
from ..progress import Progress
from ..quality.options import QualityOptions
from ..scans.campaign import ScanSource
from ..simulation.scanner import PRESETS, Scanner
from ..simulation.scene import build_scene
from ..simulation.stand_points import find_stand_points
from .inputs import Stopwatch, limited_threads, open_model
from .quality import quality

SAMPLE_SPACING_M = 0.05
LINK_THINNER = 4.0


def plan(
    model: BuildingModel | str | Path,
    options: PlanOptions | None = None,
    progress: Progress | None = None,
    scans: ScanSource | Sequence[str | Path] = (),
) -> PlanResult:
    """Find the fewest stations that measure enough of every chosen element as the level needs.

    With ``scans``, the stations to add to that campaign. Nothing is written. Raises BimVerifyError with one sentence
    when a file cannot be used or no scanner can stand anywhere.
    """
    options = options or PlanOptions()
    progress = progress or Progress()
    if options.scanner != "auto" and options.scanner not in PRESETS:
        raise BimVerifyError(f"There is no scanner preset {options.scanner!r}; choose auto, {', '.join(PRESETS)}.")
    with limited_threads(options.threads):
        watch = Stopwatch()
        model = open_model(model, options, progress.part(0.0, 0.1))
        watch.lap("tessellation")
        samples = sample_surface(model, SAMPLE_SPACING_M, cache=options.cache)
        watch.lap("query positions")
        site = _site(model, samples, options, scans, progress.part(0.1, 0.3))
        watch.lap("places")
        if options.scanner != "auto":
            return _plan(site, options, PRESETS[options.scanner], progress.part(0.3, 1.0), watch)
        tried = []
        for k, scanner in enumerate(PRESETS.values()):
            part = progress.part(0.3 + 0.7 * k / len(PRESETS), 0.3 + 0.7 * (k + 1) / len(PRESETS))
            tried.append(_plan(site, options, scanner, part, watch))
        return min(tried, key=lambda p: (-p.summary()["elements_reached"], p.minutes))


def _site(
    model: BuildingModel, samples: SurfaceSamples, options: PlanOptions, scans: ScanSource | Sequence[str | Path],
    progress: Progress,
) -> Site:
    chosen = choose_elements(model, options)
    found = None
    props = []
    if not isinstance(scans, Sequence) or len(scans):
        found = quality(
            model, scans,
            QualityOptions(
                loa=options.loa, sample_spacing=SAMPLE_SPACING_M, scan_frame=options.scan_frame, origin=options.origin,
                threads=options.threads, memory_gb=options.memory_gb, cache=options.cache,
            ),
            progress,
        )
        props = clutter_props(found)
        samples = found.samples
    scene = build_scene(model, {}, props)
    stands = find_stand_points(model, scene, count=options.candidates, seed=options.seed)
    if not len(stands.position):
        raise BimVerifyError(f"{model.path} leaves no free place for a scanner on a level floor; there is nothing to plan.")
    return Site(model, samples, chosen, scene, stands, found)


def _plan(site: Site, options: PlanOptions, scanner: Scanner, progress: Progress, watch: Stopwatch) -> PlanResult:
    need, everyone = Requirement.of(options, scanner), np.ones(len(site.chosen), np.bool_)
    first, second = pick_targets(site.model, site.samples, site.chosen), second_targets(site.model, site.samples, site.chosen)
    if not len(first):
        raise BimVerifyError(f"Nothing of the chosen elements of {site.model.path} can be seen from anywhere.")
    existing = site.existing(first, need)
    places = Places.of(site, existing)
    sees = _views(site, places, first, existing, scanner, need, progress.part(0.0, 0.4))
    sees_second = _views(site, places, second, site.existing(second, need), scanner, need, progress.part(0.4, 0.7))
    # stations are registered by all that they see in common, whether the plan asks for it or not
    common = pick_targets(site.model, site.samples, everyone, thinner=LINK_THINNER)
    scans_share = view_matrix(site.scene, places.position, common, scanner, registrable(scanner), progress.part(0.7, 0.8))
    linked = shared_enough(scans_share, common.area, options.overlap)
    watch.lap("visibility")
    progress.update(0.8, "Choosing places")
    goals = set_goals(options.coverage, len(site.chosen), first, sees, second, sees_second)
    choice = choose_places(
        goals.views, goals.look, linked, places.known, partial(_quick, site, places.position, first, scanner, need), options
    )
    order = in_order(choice.problem, [c for c in choice.chosen if c >= places.known], places.known)
    watch.lap("solving")
    everything = second_targets(site.model, site.samples, everyone)
    forecasts = forecast(
        site, everything, places.position[order], scanner, options, goals, site.existing(everything, need)
    )
    watch.lap("forecast")
    return PlanResult(
        model=site.model, options=options, scanner=scanner,
        stations=tuple(list_set_ups(site, existing, choice, sees, first, order, places, scanner, options)),
        existing=existing.names if existing else (), forecasts=tuple(forecasts), least=choice.least,
        optimal=len(order) <= choice.least, places=len(site.stands.position), heuristic=choice.heuristic,
        method=f"bim_verify {__version__} plan", timings=dict(watch.seconds), warnings=tuple(warnings(site, choice, goals)),
    )


def _views(
    site: Site, places: Places, points: Targets, existing: Existing | None, scanner: Scanner, need: Requirement,
    progress: Progress,
) -> NDArray[np.bool_]:
    """(C, P) what each place measures as required; stations of the campaign, the first ones, all that it has."""
    sees = view_matrix(site.scene, places.position[places.known :], points, scanner, need, progress)
    return sees if existing is None else np.concatenate([np.repeat(existing.good[None], places.known, axis=0), sees])


def _quick(site: Site, positions: Array, targets: Targets, scanner: Scanner, need: Requirement) -> list[int]:
    return quick_start(site.scene, positions, targets, scanner, need, most=3)
