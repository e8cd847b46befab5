"""One image onto the model: from a coarse pose to matched lines, a rigorous adjustment, and what is not determined."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..errors import BimVerifyError
from .camera import Camera
from .cameras_file import KnownCamera
from .crowded_edges import crowding
from .detect_lines import ImageLines
from .edge_bearers import EdgeBearers
from .element_errors import estimate_with_elements
from .line_pose import PoseEstimate, PosePrior, pose_difference
from .mistaken_lines import SEARCH_WIDTH, mistaken_px
from .pose_search import WIDE, gate, refine, score_pose, search
from .uncertain_lines import LineMatches
from .visible_edges import EdgeViewer, VisibleEdges
from .weak_geometry import WeakDirection, weak_directions

Vector = NDArray[np.float64]
Ints = NDArray[np.int64]
BATCH, MOST_BATCHES = 2000, 8
KEPT = 40
"""Best hypotheses of a batch that are refined with all lines."""
CONFIRMATIONS = 3
"""So many hypotheses from different matches must lead to one pose before the search ends early."""
MOST_EDGES, MOST_LINES = 120, 500
LIMIT = 6.0
"""Squared normalised distance at which a match has no more worth in the score."""
WIDTHS = (1.0, 0.5, 0.25, 0.1, 0.1)
"""How the tolerance shrinks when a hypothesis is refined, shares of the search's."""
LEAST_LINES = 5
SAME_POSE_M, SAME_POSE_RAD = 0.03, math.radians(0.5)
TEST = 13.8
"""Chi-square of two degrees at 99.9 %: matches beyond it, scaled by the variance factor, are taken out."""
MOST_OUT = 0.5
LOOKS = 2
FARTHEST = 35.0
"""Chi-square of six degrees that is never reached: a pose beyond it contradicts the coarse one."""
AMBIGUOUS = 0.93
"""A different pose that explains this share of what the best one does makes the result ambiguous."""
LEAST_SURE = 7
"""Lines, less one for each direction that they leave open: fewer lie on edges by chance too often."""
MOST_RIVALS = 6
"""So many other poses of the search are looked at anew, each with the edges that it would see."""
NEAR_M, NEAR_RAD = 0.01, math.radians(0.15)
"""Poses of the search nearer than this to the best are not looked at anew."""
CHANCE_POSES, CHANCE_EDGES, MOST_BY_CHANCE = 64, 60, 0.8
"""So many poses are drawn from the coarse sigma and pulled onto the lines; if one of them explains this share of what the best
does of the longest edges, so many lines may lie on edges by chance."""


@dataclass(frozen=True)
class MatchedLine:
    """An image line and the model edge it is taken for."""

    bearers: EdgeBearers
    """Of this one edge."""
    edge: Vector
    """(2, 3) ends of the visible part, metres, local frame"""
    line: Vector
    """(4,) both ends in ideal pixels"""
    residual: float
    """Root mean square distance of the line's ends from the projected edge, pixels."""
    crowding: float
    """How far the line may lie from the edge because others are too near to be told apart, pixels."""
    weight: float
    """Of the line's length and strength, see ``ImageLines.weight``."""
    test: float
    """Chi-square with two degrees."""
    kept: bool

    @property
    def element(self) -> int:
        """Row of the element in the model."""
        return int(self.bearers.element[0, 0])


@dataclass(frozen=True)
class ImageRegistration:
    """What became of one image. ``estimate`` is None where no pose could be determined, and ``note`` says why."""

    coarse: KnownCamera
    estimate: PoseEstimate | None
    matches: tuple[MatchedLine, ...]
    lines: ImageLines
    before: VisibleEdges
    after: VisibleEdges | None
    explained: float
    """Share of the visible edges' length that lines account for."""
    runner_up: float
    """What the best different pose explains, share of the best; near one: ambiguous."""
    chance: float
    """The most that a pose drawn from the coarse sigma explains once pulled onto the lines, share of the best; 1 for too few
    lines to tell."""
    weak: tuple[WeakDirection, ...]
    note: str = ""

    @property
    def camera(self) -> Camera:
        """The refined camera, or the coarse one where there is none."""
        return self.coarse.camera if self.estimate is None else self.estimate.camera

    @property
    def covariance(self) -> Vector | None:
        """(6, 6) rotation in the camera frame [rad] and position [m]; scaled up where the fit is worse than stated."""
        return None if self.estimate is None else self.estimate.scaled_covariance


def register_image(
    viewer: EdgeViewer, lines: ImageLines, coarse: KnownCamera, *, model_sigma: float, focal: bool = False, seed: int = 0
) -> ImageRegistration:
    """Refine a camera's coarse pose by its image's lines; ``model_sigma`` [m] is that of the model's edges per axis."""
    camera = coarse.camera
    reach = min(_reach(coarse), 0.25 * camera.interior.width)
    before = viewer.look(camera, reach)
    nothing = ImageRegistration(coarse, None, (), lines, before, None, 0.0, 0.0, 0.0, ())
    if len(before) < LEAST_LINES:
        return replace(nothing, note=f"The model shows only {len(before)} edges to this camera; check its coarse pose.")
    if len(lines) < LEAST_LINES:
        return replace(nothing, note=f"The image has only {len(lines)} straight lines.")
    found = search_pose(before, lines, coarse, model_sigma, reach, seed)
    if found is None:
        return replace(nothing, note="No pose near the coarse one explains the lines; check the coarse pose and its sigma.")
    pose, others = found
    try:
        settled = _settle(viewer, lines, replace(coarse, camera=pose), coarse, model_sigma, focal)
    except BimVerifyError as error:
        return replace(nothing, note=str(error))
    estimate, matches, after, explained = settled.estimate, settled.matches, settled.seen, settled.explained
    away = pose_difference(estimate.camera, camera)
    if (away[:3] @ away[:3]) / coarse.rotation_sigma**2 + (away[3:] @ away[3:]) / coarse.position_sigma**2 > FARTHEST:
        return replace(nothing, note=(
            f"The lines put the camera {np.linalg.norm(away[3:]):.2f} m and {math.degrees(np.linalg.norm(away[:3])):.1f} deg "
            "from the coarse pose, which its sigma does not allow; check the coarse pose and its sigma."
        ))
    weak = weak_directions(estimate, PosePrior(coarse.rotation_sigma, coarse.position_sigma))
    used = sum(m.kept for m in matches)
    few = used < LEAST_SURE - len(weak)
    runner_up = _rival(viewer, lines, settled, others, coarse, model_sigma, focal)
    chance = 1.0 if few else _by_chance(viewer, lines, settled, coarse, model_sigma, focal, seed)
    share = f"lines account for {explained:.0%} of the edges that should show"
    note = ""
    if few:
        note = f"Only {used} lines lie on edges, which may be by chance ({share}); check the overlay."
    elif runner_up > AMBIGUOUS:
        note = f"Another pose explains the lines nearly as well ({share}); check the overlay and the coarse pose."
    elif chance > MOST_BY_CHANCE:
        note = f"A pose by chance explains the lines nearly as well ({share}); check the coarse pose, or give a sharper image."
    return ImageRegistration(coarse, estimate, matches, lines, before, after, explained, runner_up, chance, weak, note)


@dataclass(frozen=True)
class _Settled:
    """A pose that was adjusted with the edges it sees, and the share of them that lines account for."""

    estimate: PoseEstimate
    matches: tuple[MatchedLine, ...]
    seen: VisibleEdges
    explained: float


def _settle(
    viewer: EdgeViewer, lines: ImageLines, known: KnownCamera, coarse: KnownCamera, model_sigma: float, focal: bool
) -> _Settled:
    """The adjusted pose near a ``known`` one. Raises BimVerifyError where there is none."""
    for _ in range(LOOKS):
        seen = viewer.look(known.camera)
        pairs = match_lines(seen, lines, known, model_sigma)
        if pairs is None:
            raise BimVerifyError("Too few lines lie on edges of the model to determine a pose.")
        known, best, explained = pairs
        estimate, matches = adjust_matches(seen, lines, best, known, coarse, model_sigma, focal)
        known = replace(known, camera=estimate.camera)
    return _Settled(estimate, matches, seen, explained)


def _rival(
    viewer: EdgeViewer, lines: ImageLines, found: _Settled, others: list[tuple[float, Camera]], coarse: KnownCamera,
    model_sigma: float, focal: bool,
) -> float:
    """What the best different pose explains, as a share of what the ``found`` one does of the edges that it sees.

    ``others`` are poses of the search, the best first. What they explained there counts edges as the coarse pose sees them, so
    each is judged by the edges that it sees itself. One that explains enough is adjusted as the found pose was.
    It is the same if the covariances allow the difference, and a rival if not, however near it is.
    """
    explained = _explained(found, lines, coarse, model_sigma)
    if explained == 0.0:
        return 1.0
    most = 0.0
    for _, camera in others[:MOST_RIVALS]:
        seen = viewer.look(camera)
        matched = match_lines(seen, lines, replace(coarse, camera=camera), model_sigma)
        if matched is None:
            continue
        share = matched[2] * float(seen.length_px.sum()) / explained
        if share > AMBIGUOUS:
            try:
                rival = _settle(viewer, lines, matched[0], coarse, model_sigma, focal)
            except BimVerifyError:
                continue
            if _one_place(rival.estimate, found.estimate):
                continue
            share = _explained(rival, lines, coarse, model_sigma) / explained
        elif _is(matched[0].camera, found.estimate):
            continue
        most = max(most, share)
    return most


def _explained(found: _Settled, lines: ImageLines, coarse: KnownCamera, model_sigma: float) -> float:
    """What a pose explains of the edges that it sees [px]."""
    matched = match_lines(found.seen, lines, replace(coarse, camera=found.estimate.camera), model_sigma)
    return 0.0 if matched is None else matched[2] * float(found.seen.length_px.sum())


def _is(pose: Camera, found: PoseEstimate) -> bool:
    """Whether a pose is the ``found`` one, or differs by what its covariance leaves open if its matches are right.

    What a wrong match may do does not count: a rival is there just because of one.
    """
    return _same(pose, found.camera) or _differ(pose, found.camera, _if_right(found)) <= FARTHEST


def _one_place(rival: PoseEstimate, found: PoseEstimate) -> bool:
    """Whether two adjusted poses are one: near each other by what both covariances allow, or by that of the found one alone.

    Farther off, that of a rival with few lines must not count: it allows anything.
    """
    both = _differ(rival.camera, found.camera, _if_right(rival) + _if_right(found))
    return both <= FARTHEST and _is(rival.camera, found)


def _if_right(pose: PoseEstimate) -> Vector:
    return pose.covariance if pose.if_right is None else pose.if_right


def _differ(pose: Camera, other: Camera, covariance: Vector) -> float:
    """Squared difference of two poses over a ``covariance`` (6, 6)."""
    away = pose_difference(pose, other)
    return float(away @ np.linalg.solve(covariance, away))


def _by_chance(
    viewer: EdgeViewer, lines: ImageLines, found: _Settled, coarse: KnownCamera, model_sigma: float, focal: bool, seed: int
) -> float:
    """The most that poses explain which are drawn around the ``found`` one and are not the same, as a share of what it does.

    Those are the same that come back to it, or differ by what its covariance leaves open. One that explains too much is
    followed to its end before it is judged: adjusted as the found pose was, by the edges that it sees itself.
    """
    center = found.estimate.camera
    edges = found.seen.rows(np.argsort(-found.seen.length_px, kind="stable")[:CHANCE_EDGES])
    best = match_lines(edges, lines, replace(coarse, camera=center), model_sigma)
    if best is None:
        return 1.0
    rng = np.random.default_rng((seed, 31))
    drawn: list[tuple[float, KnownCamera]] = []
    for _ in range(CHANCE_POSES):
        camera = center.moved(rng.normal(0, coarse.rotation_sigma, 3), rng.normal(0, coarse.position_sigma, 3))
        matched = match_lines(edges, lines, replace(coarse, camera=camera), model_sigma)
        if matched is not None and not _is(matched[0].camera, found.estimate):
            drawn.append((matched[2] / best[2], matched[0]))
    explained = _explained(found, lines, coarse, model_sigma)
    most = 0.0
    for share, pose in drawn:
        if share > MOST_BY_CHANCE and explained > 0.0:
            try:
                other = _settle(viewer, lines, pose, coarse, model_sigma, focal)
            except BimVerifyError:
                pass
            else:
                same = _one_place(other.estimate, found.estimate)
                share = 0.0 if same else _explained(other, lines, coarse, model_sigma) / explained
        most = max(most, share)
    return most


def _reach(coarse: KnownCamera, depth: float = 2.0) -> float:
    """How far the coarse pose may put an edge off [px], three sigmas, at ``depth`` metres."""
    return 3.0 * coarse.camera.interior.fx * math.hypot(coarse.rotation_sigma, coarse.position_sigma / depth)


def _covariance(coarse: KnownCamera) -> Vector:
    return np.diag([coarse.rotation_sigma**2] * 3 + [coarse.position_sigma**2] * 3)


def _inside(camera: Camera) -> Vector:
    lens = camera.interior
    return np.array([lens.fx, lens.fy, lens.cx, lens.cy])


def _line_rows(lines: ImageLines, most: int | None = None) -> Vector:
    return np.column_stack([lines.start, lines.end, lines.offset_sigma, lines.angle_sigma])[:most]


def _candidates(allowed: NDArray[np.bool_]) -> tuple[Ints, Ints]:
    edge, line = np.nonzero(allowed)
    first = np.searchsorted(edge, np.arange(len(allowed) + 1)).astype(np.int64)
    return first, line.astype(np.int64)


def search_pose(
    edges: VisibleEdges, lines: ImageLines, coarse: KnownCamera, model_sigma: float, slack: float, seed: int
) -> tuple[Camera, list[tuple[float, Camera]]] | None:
    """The pose near the coarse one that explains most; others, different from it and each other, and what they explain of
    that, the best first."""
    camera, covariance, inside = coarse.camera, _covariance(coarse), _inside(coarse.camera)
    longest = np.argsort(-edges.length_px, kind="stable")[:MOST_EDGES]
    start, end = np.ascontiguousarray(edges.start[longest]), np.ascontiguousarray(edges.end[longest])
    rows = _line_rows(lines, MOST_LINES)
    allowed = gate(camera.rotation, camera.position, covariance, inside, start, end, rows, model_sigma, slack, WIDE)
    first, candidate = _candidates(allowed)
    if (np.diff(first) > 0).sum() < LEAST_LINES:
        return None
    chance = np.cumsum(np.where(np.diff(first) > 0, edges.length_px[longest], 0.0))
    width = SEARCH_WIDTH * camera.interior.width
    widths = width * np.array(WIDTHS)
    poses: list[tuple[float, Camera]] = []
    for batch in range(MOST_BATCHES):
        scores, rotations, positions = search(
            camera.rotation, camera.position, covariance, inside, start, end, chance, rows, first, candidate, model_sigma,
            width, LIMIT, BATCH, seed * MOST_BATCHES + batch,
        )
        for h in np.argsort(-scores, kind="stable")[:KEPT]:
            if scores[h] <= 0:
                break
            r, x, score = refine(
                rotations[h], positions[h], covariance, inside, start, end, rows, first, candidate, model_sigma, widths, LIMIT
            )
            poses.append((score, replace(camera, rotation=r, position=x)))
        poses.sort(key=lambda pair: -pair[0])
        poses = poses[: 4 * KEPT]
        if poses and sum(_same(p, poses[0][1]) and s > 0.9 * poses[0][0] for s, p in poses) >= CONFIRMATIONS * (batch + 1):
            break
    if not poses:
        return None
    best_score, best = poses[0]
    others: list[tuple[float, Camera]] = []
    for score, pose in poses:
        if not _same(pose, best, NEAR_RAD, NEAR_M) and not any(_same(pose, p) for _, p in others):
            others.append((score / best_score, pose))
    return best, others


def _same(pose: Camera, other: Camera, angle: float = SAME_POSE_RAD, distance: float = SAME_POSE_M) -> bool:
    """Whether two poses are turned by less than ``angle`` [rad] and shifted by less than ``distance`` [m]."""
    away = pose_difference(pose, other)
    return bool(np.linalg.norm(away[:3]) < angle and np.linalg.norm(away[3:]) < distance)


def match_lines(
    edges: VisibleEdges, lines: ImageLines, known: KnownCamera, model_sigma: float
) -> tuple[KnownCamera, Ints, float] | None:
    """Every visible edge with the lines that lie on it now; the pose, the (E, L) matches, the share explained."""
    camera, inside = known.camera, _inside(known.camera)
    rows = _line_rows(lines)
    tight = np.diag([SAME_POSE_RAD**2] * 3 + [SAME_POSE_M**2] * 3) / 9.0
    width = SEARCH_WIDTH * camera.interior.width
    allowed = gate(
        camera.rotation, camera.position, tight, inside, edges.start, edges.end, rows, model_sigma, 4.0 * width, WIDE
    )
    first, candidate = _candidates(allowed)
    r, x, score = refine(
        camera.rotation, camera.position, _covariance(known), inside, edges.start, edges.end, rows, first, candidate,
        model_sigma, width * np.array([0.5, 0.25, 0.1]), LIMIT,
    )
    best = np.empty(len(edges), dtype=np.int64)
    score_pose(r, x, inside, edges.start, edges.end, rows, first, candidate, model_sigma, 0.1 * width, LIMIT, best)
    if (best >= 0).sum() < LEAST_LINES:
        return None
    share = score / max(float(edges.length_px.sum()), 1e-9)
    return replace(known, camera=replace(camera, rotation=r, position=x)), best, share


def adjust_matches(
    edges: VisibleEdges, lines: ImageLines, best: Ints, known: KnownCamera, coarse: KnownCamera, model_sigma: float,
    focal: bool,
) -> tuple[PoseEstimate, tuple[MatchedLine, ...]]:
    """The rigorous adjustment; matches that do not fit it are taken out one after the other."""
    edge = _one_line_each(np.flatnonzero(best >= 0), best, edges, lines)
    line = best[edge]
    crowded = crowding(edges.pixel)[edge]
    line_of, cov = lines.uncertain(line, crowded)
    model = np.tile(np.eye(3) * model_sigma**2, (len(edge), 1, 1))
    matches = LineMatches(line_of, cov, edges.start[edge], edges.end[edge], model, model)
    kept = np.ones(len(edge), dtype=np.bool_)
    tests = np.full(len(edge), np.nan)
    bearers = edges.bearers.rows(edge)
    estimate = _estimate(matches, kept, bearers, model_sigma, known.camera, coarse, focal)
    for _ in range(int(MOST_OUT * len(edge))):
        rows = np.flatnonzero(kept)
        worst = int(np.argmax(estimate.test))
        factor = max(float(np.median(estimate.test)) / 1.386, 1.0)
        if estimate.test[worst] <= TEST * factor or len(rows) <= LEAST_LINES:
            break
        tests[rows[worst]] = estimate.test[worst]
        kept[rows[worst]] = False
        estimate = _estimate(matches, kept, bearers, model_sigma, estimate.camera, coarse, focal)
    tests[kept] = estimate.test
    estimate = _estimate(
        matches, kept, bearers, model_sigma, estimate.camera, coarse, focal,
        mistaken_px=mistaken_px(known.camera.interior.width),
    )
    return estimate, tuple(
        MatchedLine(
            edges.bearers.rows(np.array([e])), np.stack([edges.start[e], edges.end[e]]),
            np.concatenate([lines.start[k], lines.end[k]]), _distance(estimate.camera, edges, e, lines, k), float(near),
            float(lines.weight[k]), float(test), bool(keep),
        )
        for e, k, near, test, keep in zip(edge, line, crowded, tests, kept, strict=True)
    )


def _estimate(
    matches: LineMatches, kept: NDArray[np.bool_], bearers: EdgeBearers, model_sigma: float, known: Camera, coarse: KnownCamera,
    focal: bool, mistaken_px: float = 0.0,
) -> PoseEstimate:
    return estimate_with_elements(
        matches.rows(kept), bearers.rows(kept), known, model_sigma, focal=focal, at=coarse.camera,
        prior=PosePrior(coarse.rotation_sigma, coarse.position_sigma),
        mistaken_px=mistaken_px,
    )


def _one_line_each(rows: Ints, best: Ints, edges: VisibleEdges, lines: ImageLines) -> Ints:
    """Parts of one model edge, and edges taken for one line, are one match: the part with the longest line stays."""
    order = rows[np.argsort(-lines.length[best[rows]], kind="stable")]
    seen_line: set[int] = set()
    seen_edge: set[int] = set()
    out = []
    for e in order:
        if int(best[e]) in seen_line or int(edges.line[e]) in seen_edge:
            continue
        seen_line.add(int(best[e]))
        seen_edge.add(int(edges.line[e]))
        out.append(int(e))
    return np.array(sorted(out), dtype=np.int64)


def _distance(camera: Camera, edges: VisibleEdges, e: int, lines: ImageLines, k: int) -> float:
    a, b = camera.project(np.stack([edges.start[e], edges.end[e]]))
    along = (b - a) / np.linalg.norm(b - a)
    normal = np.array([-along[1], along[0]])
    off = np.array([(lines.start[k] - a) @ normal, (lines.end[k] - a) @ normal])
    return float(np.sqrt((off**2).mean()))
