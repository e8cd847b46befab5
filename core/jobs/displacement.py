"""Two epochs of a panelled wall to its joints' displacements and the field between them."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import BimVerifyError
from ..options import InputOptions
from ..progress import Progress
from ..scans.campaign import ScanSource
from ..scans.open import open_scans
from ..wall_displacement.columns import FoundJoint, horizontal_joints, trace_face, vertical_joints
from ..wall_displacement.epoch import Epoch, read_epoch
from ..wall_displacement.field import displacement_field, face_profile
from ..wall_displacement.measure import ColumnPoints, measure_joint, pair_joints
from ..wall_displacement.result import Column, DisplacementResult, JointDisplacement, State
from ..wall_displacement.wall import Wall, find_wall, on_wall, smooth, spacing_on
from .inputs import Stopwatch, limited_threads

Array = NDArray[np.float64]
NARROWEST_COLUMN_M = 0.3
STRIP_M = 1.5
"""Width of the strips that a wall without visible vertical joints is cut into."""
LEAST_POINTS = 100


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
) -> DisplacementResult:
    """Displacements of a panelled wall between two epochs that are registered to one frame with z up.

    Nothing is written. Raises BimVerifyError when a file cannot be used, when a scan holds no upright wall, or when the
    later epoch does not show the base epoch's wall.
    """
    options, progress = options or DisplacementOptions(), progress or Progress()
    with limited_threads(options.threads):
        watch = Stopwatch()
        sources = [open_scans(s, origin=options.origin) if isinstance(s, Sequence) else s for s in (base, later)]
        origin: Array = np.round(sources[0].stations[0].position).astype(np.float64)
        epochs = [
            read_epoch(s, origin, options.memory_gb, progress.part(0.25 * k, 0.25 * (k + 1))) for k, s in enumerate(sources)
        ]
        watch.lap("reading")
        return _displacement(epochs, origin, options, progress.part(0.5, 1.0), watch)


def _displacement(
    epochs: list[Epoch], origin: Array, options: DisplacementOptions, progress: Progress, watch: Stopwatch
) -> DisplacementResult:
    progress.update(0.0, "Looking for the wall")
    wall = find_wall(epochs[0], None if options.near is None else np.array(options.near) - origin)
    clouds, stations = [], []
    for epoch in epochs:
        points, rows = on_wall(epoch, wall)
        if len(points) < LEAST_POINTS:
            raise BimVerifyError(
                f"{', '.join(Path(p).name for p in epoch.paths)} shows fewer than {LEAST_POINTS} points of the wall; both "
                "epochs must be registered to one frame and show the same wall."
            )
        clouds.append(points)
        stations.append(wall.to_wall(epoch.stations)[epoch.station[rows]])
    spacing = (spacing_on(clouds[0]), spacing_on(clouds[1]))
    watch.lap("wall")
    bounds, warnings = _columns(wall, clouds, max(spacing))
    columns = []
    for number, (low, high) in enumerate(bounds):
        progress.update(0.1 + 0.6 * number / len(bounds), f"Column {number + 1} of {len(bounds)}")
        column = _column(number, low, high, wall, clouds, stations, spacing, origin, options.registration_sigma)
        if column is not None:
            columns.append(column)
    watch.lap("joints")
    field = displacement_field(
        wall, clouds[0], clouds[1], max(spacing), options.registration_sigma, origin, progress.part(0.7, 1.0)
    )
    watch.lap("field")
    outward = wall.axes[1]
    warnings += _notes(columns, epochs, spacing)
    return DisplacementResult(
        tuple(columns), field, (float(outward[0]), float(outward[1]), float(outward[2])), wall.area, spacing,
        options.registration_sigma, epochs[0].paths, epochs[1].paths, epochs[0].date, epochs[1].date, tuple(warnings),
        watch.seconds,
    )


def _columns(wall: Wall, clouds: list[Array], spacing: float) -> tuple[list[tuple[float, float]], list[str]]:
    """Column bounds along the wall from the vertical joints of the base epoch; strips where there are none."""
    points = clouds[0]
    smoothed = Wall(wall.origin, wall.axes, wall.low, smooth(wall.surface))
    depth = smoothed.depth(points[:, 0], points[:, 2]) - points[:, 1]
    joints = vertical_joints(points, np.nan_to_num(depth), spacing)
    ends = (float(np.quantile(points[:, 0], 0.001)), float(np.quantile(points[:, 0], 0.999)))
    warnings = []
    if not len(joints):
        warnings.append("No vertical joints were found: the wall was cut into strips, which may span two columns of panels.")
        count = max(round((ends[1] - ends[0]) / STRIP_M), 1)
        edges = np.linspace(*ends, count + 1)
    else:
        edges = np.array([ends[0], *_with_pitch(joints), ends[1]])
    bounds = [(a, b) for a, b in itertools.pairwise(edges) if b - a > NARROWEST_COLUMN_M]
    return [(float(a), float(b)) for a, b in bounds], warnings


def _with_pitch(joints: Array) -> Array:
    """Joints that were missed between two found ones are put where the panels' usual width says."""
    steps = np.diff(joints)
    if len(steps) < 2:
        return joints
    pitch = float(np.median(steps))
    out = [joints[0]]
    for step, joint in zip(steps, joints[1:], strict=True):
        pieces = round(step / pitch)
        if pieces > 1 and abs(step - pieces * pitch) < 0.1 * pitch:
            out += [joint - step * (1 - k / pieces) for k in range(1, pieces)]
        out.append(joint)
    return np.array(out)


def _column(
    number: int, low: float, high: float, wall: Wall, clouds: list[Array], stations: list[Array],
    spacing: tuple[float, float], origin: Array, registration_sigma: float,
) -> Column | None:
    margin = min(0.06, 0.15 * (high - low))
    parts = [(c[:, 0] > low + margin) & (c[:, 0] < high - margin) for c in clouds]
    if min(int(p.sum()) for p in parts) < LEAST_POINTS:
        return None
    middle = 0.5 * (low + high)
    own = clouds[0][parts[0]]
    slope = np.polyfit(own[:, 0] - middle, own[:, 1], 1)[0] if np.ptp(own[:, 0]) > 0.2 else 0.0
    c, s = np.cos(np.arctan(slope)), np.sin(np.arctan(slope))
    turn = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    shift = np.array([middle, float(np.median(own[:, 1])), 0.0])
    epochs, found = [], []
    for k in range(2):
        points = (clouds[k][parts[k]] - shift) @ turn.T
        station = (stations[k][parts[k]] - shift) @ turn.T
        before = np.abs(points[:, 1]) < 0.4
        points, station = points[before], station[before]
        face = trace_face(points)
        keep = face.residual < max(5 * face.noise, 0.03)
        points, station = points[keep], station[keep]
        epochs.append(ColumnPoints(points, station, trace_face(points)))
        found.append(horizontal_joints(points, epochs[k].face, spacing[k]))

    def place(height: float) -> tuple[float, float, float]:
        at = wall.to_local((np.array([[0.0, 0.0, height]]) @ turn) + shift)[0] + origin
        return float(at[0]), float(at[1]), float(at[2])

    joints = _joints(number, middle, epochs, found, registration_sigma, place)
    level = np.arange(own[:, 2].min() + 0.05, own[:, 2].max(), 0.1)
    profiles = [face_profile(e.points, level) for e in epochs]
    return Column(number, low, high, tuple(joints), level + place(0.0)[2], profiles[0], profiles[1])


def _joints(
    number: int, middle: float, epochs: list[ColumnPoints], found: list[list[FoundJoint]], registration_sigma: float,
    place: Callable[[float], tuple[float, float, float]],
) -> list[JointDisplacement]:
    pairs = pair_joints(found[0], found[1])
    joints = []
    for i, k in pairs:
        first, second = found[0][i], found[1][k]
        move = measure_joint(epochs[0], epochs[1], first, second, _room(found, epochs, i, k))
        spot = place(move.height)
        joints.append(JointDisplacement(
            number, "PAIRED", middle, spot, spot[2], move.vertical, move.vertical_sigma, move.lateral, move.lateral_sigma,
            move.opening, first.completeness, second.completeness,
            _significant(move.vertical, move.vertical_sigma, registration_sigma),
            _significant(move.lateral, move.lateral_sigma, registration_sigma),
        ))
    states: tuple[State, State] = ("MISSING", "NEW")
    for side, state in enumerate(states):
        taken = {pair[side] for pair in pairs}
        for row, joint in enumerate(found[side]):
            if row not in taken:
                spot = place(joint.height)
                seen = (joint.completeness, 0.0) if side == 0 else (0.0, joint.completeness)
                joints.append(JointDisplacement(
                    number, state, middle, spot, spot[2], completeness_base=seen[0], completeness_later=seen[1]
                ))
    return sorted(joints, key=lambda j: j.height)


def _room(found: list[list[FoundJoint]], epochs: list[ColumnPoints], i: int, k: int) -> tuple[float, float]:
    """Free height below and above a joint in both epochs, to the next joint or the column's end [m]."""
    below, above = [], []
    for joints, row, epoch in ((found[0], i, epochs[0]), (found[1], k, epochs[1])):
        z = epoch.points[:, 2]
        low = joints[row - 1].height + 0.06 if row > 0 else float(z.min())
        high = joints[row + 1].height - 0.06 if row + 1 < len(joints) else float(z.max())
        below.append(joints[row].height - low)
        above.append(high - joints[row].height)
    return min(below), min(above)


def _significant(value: float | None, sigma: float | None, registration_sigma: float) -> bool | None:
    if value is None or sigma is None:
        return None
    return bool(abs(value) > 1.96 * np.hypot(sigma, registration_sigma))


def _notes(columns: list[Column], epochs: list[Epoch], spacing: tuple[float, float]) -> list[str]:
    notes = []
    joints = [j for c in columns for j in c.joints]
    unsure = sum(j.state == "PAIRED" and j.vertical is None for j in joints)
    if not joints:
        notes.append("No horizontal joints were found: only the field along the face's normal says how the wall moved.")
    if unsure:
        notes.append(f"The vertical movement of {unsure} joints is not determined: beam rows lie too far apart at their edges.")
    for epoch, name in zip(epochs, ("base", "later"), strict=True):
        if epoch.kept_one_in > 1:
            notes.append(f"Of the {name} epoch one return in {epoch.kept_one_in} was used; give --memory-gb more for all.")
        if not np.isfinite(epoch.stations).all():
            notes.append(f"The {name} epoch names no scanner position; edges seen obliquely are less exact. Give --origin.")
    if max(spacing) > 0.05:
        notes.append(f"Points lie {1000 * max(spacing):.0f} mm apart on the wall: joints narrower than that may be missed.")
    return notes
