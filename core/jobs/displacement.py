"""Two epochs of a panelled wall to its joints' displacements and the field between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import BimVerifyError
from ..model.elements import BuildingModel
from ..options import InputOptions
from ..progress import Progress
from ..scans.campaign import ScanSource
from ..wall_displacement.bands import returns_near_joints
from ..wall_displacement.compare import LEAST_POINTS, Draft, compare_column, find_joints
from ..wall_displacement.epoch import Epoch, read_epoch, spread_rows
from ..wall_displacement.field import joined
from ..wall_displacement.measure import BEYOND_M, EDGE_REACH_M
from ..wall_displacement.panels import column_bounds, split
from ..wall_displacement.psets import check_is_element, element_box
from ..wall_displacement.result import Column, DisplacementResult
from ..wall_displacement.wall import find_wall, on_wall, spacing_on
from .inputs import Stopwatch, check_one_origin, limited_threads, open_model, opened

Array = NDArray[np.float64]
ENOUGH_TO_FIND = 500_000
"""Returns of an epoch in which the wall is looked for."""
ENOUGH_SPACING_M = 0.008
"""Of the points in which panels and joints are found: joints are 1 to 3 cm wide, denser points tell nothing more."""
NEAR_M = 10.0
"""A wall farther from the point that was named is not the one that was meant."""


@dataclass(frozen=True, kw_only=True)
class DisplacementOptions(InputOptions):
    """Options of ``displacement``. Lengths in metres."""

    registration_sigma: float = 0.001
    """Standard deviation of the registration of one epoch to the other, per direction."""
    near: tuple[float, float, float] | None = None
    """A point on the wall, scan frame, where the scans hold several."""


def displacement(
    base: ScanSource | Sequence[str | Path],
    later: ScanSource | Sequence[str | Path],
    options: DisplacementOptions | None = None,
    progress: Progress | None = None,
    element: tuple[BuildingModel | str | Path, str] | None = None,
) -> DisplacementResult:
    """Displacements of a panelled wall between two epochs that are registered to one frame with z up.

    ``element``: a model in the scans' frame and the GlobalId of the wall in it; the wall is then looked for there. Nothing is
    written. Raises BimVerifyError when a file cannot be used, when a scan holds no upright wall, when the later epoch does
    not show the base epoch's wall, or when the wall that was found is not the element.
    """
    options, progress = options or DisplacementOptions(), progress or Progress()
    with limited_threads(options.threads):
        watch = Stopwatch()
        box = None
        if element is not None:
            box = element_box(open_model(element[0], options, progress.part(0.0, 0.1)), element[1])
            if options.near is None:
                x, y, z = (float(v) for v in box.mean(axis=0))
                options = replace(options, near=(x, y, z))
        sources = [opened(s, options) for s in (base, later)]
        check_one_origin(sources, options)
        origin: Array = np.round(sources[0].stations[0].position).astype(np.float64)
        epochs = [
            read_epoch(s, origin, options.memory_gb, progress.part(0.25 * k, 0.25 * (k + 1))) for k, s in enumerate(sources)
        ]
        watch.lap("reading")
        within = NEAR_M if element is None else np.inf
        result = _displacement(epochs, origin, options, within, progress.part(0.5, 1.0), watch)
        if element is not None and box is not None:
            check_is_element(result, box, element[1])
        return result


def _displacement(
    epochs: list[Epoch], origin: Array, options: DisplacementOptions, within: float, progress: Progress, watch: Stopwatch
) -> DisplacementResult:
    progress.update(0.0, "Looking for the wall")
    samples = [e.take(spread_rows(len(e.points), ENOUGH_TO_FIND)) for e in epochs]
    wall = find_wall(samples[0], None if options.near is None else np.array(options.near) - origin, within)
    parts, spacing, thinned = [], [], []
    for epoch, sample in zip(epochs, samples, strict=True):
        found = on_wall(sample, wall)
        if len(found.points) < LEAST_POINTS:
            raise BimVerifyError(
                f"{', '.join(Path(p).name for p in epoch.paths)} shows fewer than {LEAST_POINTS} points of the wall; both "
                "epochs must be registered to one frame and show the same wall."
            )
        spacing.append(spacing_on(found.points) * float(np.sqrt(len(sample.points) / len(epoch.points))))
        thinned.append(max(spacing[-1], ENOUGH_SPACING_M))
        rows = spread_rows(len(epoch.points), len(epoch.points) * (spacing[-1] / thinned[-1]) ** 2)
        parts.append(on_wall(epoch.take(rows), wall))
    watch.lap("wall")
    bounds, warnings = column_bounds(wall, parts, max(thinned))
    split_parts = [split(part, bounds) for part in parts]
    drafts: list[Draft] = []
    for number in range(len(bounds)):
        progress.update(0.1 + 0.4 * number / len(bounds), f"Looking for joints in column {number + 1} of {len(bounds)}")
        base, later = (p[number].points for p in split_parts)
        draft = find_joints(len(bounds) - 1 - number, bounds[number], base, later, wall, origin, (thinned[0], thinned[1]))
        if draft is not None:
            drafts.append(draft)
    if not drafts:
        raise BimVerifyError(
            f"No column of the wall is wide enough to be measured in both epochs ({wall.area:.1f} m² of it were found); "
            "whether it moved is not determined. Scan more of the wall, or name a point on another one by --near."
        )
    watch.lap("joints")
    near = [
        returns_near_joints(
            epoch, wall, [d.bounds for d in drafts], [[j.height for j in d.joints[side]] for d in drafts],
            EDGE_REACH_M + BEYOND_M,
        )
        for side, epoch in enumerate(epochs)
    ]
    columns, fields = [], []
    for k, draft in enumerate(drafts):
        progress.update(0.5 + 0.5 * k / len(drafts), f"Measuring column {k + 1} of {len(drafts)}")
        column, field = compare_column(draft, near[0][k], near[1][k], max(thinned), options.registration_sigma)
        columns.append(column)
        fields.append(field)
    watch.lap("measuring")
    outward = wall.axes[1]
    warnings += _notes(columns, epochs, max(spacing))
    return DisplacementResult(
        columns=tuple(columns[::-1]), field=joined(fields[::-1]),
        outward=(float(outward[0]), float(outward[1]), float(outward[2])),
        area=wall.area, spacing=(spacing[0], spacing[1]), registration_sigma=options.registration_sigma,
        base_paths=epochs[0].paths, later_paths=epochs[1].paths, base_date=epochs[0].date, later_date=epochs[1].date,
        warnings=tuple(warnings), timings=watch.seconds,
    )


def _notes(columns: list[Column], epochs: list[Epoch], spacing: float) -> list[str]:
    notes = []
    joints = [j for c in columns for j in c.joints]
    unsure = sum(j.state == "PAIRED" and j.vertical is None for j in joints)
    if not joints:
        notes.append("No horizontal joints were found: only the field along the face's normal says how the wall moved.")
    if off := [str(c.number) for c in columns if c.may_be_a_panel_off]:
        notes.append(
            f"Column {', '.join(off)}: a joint is new at one end and one is missing at the other, so all joints between may be "
            "paired one panel off; a movement of more than 45 % of a panel's height cannot be told from one the other way."
        )
    if unsure:
        notes.append(f"The vertical movement of {unsure} joints is not determined: beam rows lie too far apart at their edges.")
    for epoch, name in zip(epochs, ("base", "later"), strict=True):
        if epoch.kept_one_in > 1:
            notes.append(f"Of the {name} epoch one return in {epoch.kept_one_in} was used; give --memory-gb more for all.")
        if not np.isfinite(epoch.stations).all():
            notes.append(f"The {name} epoch names no scanner position; edges seen obliquely are less exact. Give --origin.")
    if spacing > 0.05:
        notes.append(f"Points lie {1000 * spacing:.0f} mm apart on the wall: joints narrower than that may be missed.")
    return notes
