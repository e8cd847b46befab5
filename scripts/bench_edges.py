"""How often the 95 % intervals of the edges of openings hold: single walls with a hole behind boxes, all drawn by chance.

    python scripts/bench_edges.py [--walls 60] [--seed 1] [--pose-mm 0]

A wall of 4 m x 2.6 m with a door's hole or a window (frame, a pane that sends a third of the rays back), one to three boxes
before it, one or two stations with grids of 0.2, 0.3 or 0.5 degrees, 2 mm noise. A beam whose middle passes an edge by less
than 1 to 3 mm returns from the face. With ``--pose-mm`` every station is off by as much along each axis, and edges count it
as in a reconstruction. Only ``find_openings`` is run, so many
walls take little time; ``bench_reconstruct.py`` prints the same for whole storeys.
"""

from __future__ import annotations

import argparse

import numpy as np
from headless_entry import package
from numpy.typing import NDArray

PACKAGE = package()

from bim_verify.core.planes.derived import Z95  # noqa: E402
from bim_verify.core.reconstruction.crossings import BAND_M, GRAZING_COS, Crossings  # noqa: E402
from bim_verify.core.reconstruction.opening_edges import SIDES  # noqa: E402
from bim_verify.core.reconstruction.openings import face_raster, find_openings  # noqa: E402

Array = NDArray[np.float64]
Hole = tuple[float, float, float, float]

WIDE, HIGH = 4.0, 2.6
NOISE_M = 0.002
FRAME_M = 0.06
PANE_SHARE = 0.35
FOUND_SHARE = 0.3
STRADDLING_M = (0.001, 0.003)


def draw_hole(rng: np.random.Generator) -> tuple[Hole, float, bool]:
    """Start, end, sill, head [m]; the wall's thickness; whether a window stands in it."""
    thick = float(rng.uniform(0.1, 0.4))
    window = bool(rng.random() < 0.6)
    wide = float(rng.uniform(0.6, 1.8))
    start = float(rng.uniform(0.3, WIDE - 0.3 - wide))
    sill = float(rng.uniform(0.4, 1.2)) if window else 0.0
    head = float(rng.uniform(sill + 0.6, 2.35)) if window else float(rng.uniform(1.95, 2.3))
    return (start, start + wide, sill, head), thick, window


def draw_boxes(rng: np.random.Generator, hole: Hole) -> list[tuple[Array, Array]]:
    """Lower and upper corners; y is the distance from the wall."""
    boxes = []
    for _ in range(rng.integers(1, 4)):
        wide = rng.uniform(0.3, 1.4)
        start, gap, deep = rng.uniform(hole[0] - wide, hole[1]), rng.uniform(0.02, 0.3), rng.uniform(0.25, 0.6)
        high = rng.uniform(0.5, 2.4)
        base = 0.0 if rng.random() < 0.8 else rng.uniform(0.6, 1.5)
        top = base + (high if base == 0 else rng.uniform(0.2, 0.8))
        boxes.append((np.array([start, gap, base]), np.array([start + wide, gap + deep, top])))
    return boxes


def scan(
    rng: np.random.Generator, step_deg: float, hole: Hole, thick: float, window: bool, pose: float = 0.0
) -> Crossings:
    """What all stations together see of the wall y = 0 from the side y > 0."""
    boxes = draw_boxes(rng, hole)
    rows = [_station(rng, step_deg, hole, thick, window, boxes) for _ in range(rng.integers(1, 3))]
    if pose > 0.0:
        for own in rows:
            along, across, up = rng.normal(0.0, pose, 3)
            own += (along, up, across, along, up)
    u, z, depth, end_u, end_z = np.concatenate(rows).T
    return Crossings(u, z, depth, end_u, end_z, np.arange(len(u)))


def _station(
    rng: np.random.Generator, step_deg: float, hole: Hole, thick: float, window: bool, boxes: list[tuple[Array, Array]]
) -> Array:
    at = np.array([rng.uniform(0.3, WIDE - 0.3), rng.uniform(1.2, 4.5), rng.uniform(1.4, 1.7)])
    azimuth = np.arange(-80, 80, step_deg) + rng.uniform(0, step_deg)
    elevation = np.arange(-65, 65, step_deg) + rng.uniform(0, step_deg)
    a, e = (np.radians(v.ravel()) for v in np.meshgrid(azimuth, elevation))
    ray = np.column_stack([np.sin(a) * np.cos(e), -np.cos(a) * np.cos(e), np.sin(e)])
    wall = -at[1] / ray[:, 1]
    place = at + wall[:, None] * ray
    by = rng.uniform(*STRADDLING_M)
    inside = _within(place, (hole[0] + by, hole[1] - by, hole[2] + by, hole[3] - by))
    ok = _within(place, (0.0, WIDE, 0.0, HIGH))
    t = np.where(ok & ~inside, wall, np.inf)
    for axis, edge in ((0, hole[0]), (0, hole[1]), (2, hole[2]), (2, hole[3])):
        with np.errstate(divide="ignore", invalid="ignore"):
            to = (edge - at[axis]) / ray[:, axis]
        y = at[1] + np.where(np.isfinite(to), to, 0.0) * ray[:, 1]
        t = np.where(inside & (to > 0) & (y < 0) & (y > -thick), np.minimum(t, to), t)
    if window:
        pane = (-0.6 * thick - at[1]) / ray[:, 1]
        x = at + pane[:, None] * ray
        frame = np.minimum.reduce([x[:, 0] - hole[0], hole[1] - x[:, 0], x[:, 2] - hole[2], hole[3] - x[:, 2]]) < FRAME_M
        back = frame | (rng.random(len(t)) < PANE_SHARE)
        t = np.where(inside & (t > pane), np.where(back, pane, np.inf), t)
    else:
        t = np.where(inside & ~np.isfinite(t), (-2.5 - at[1]) / ray[:, 1], t)
    for low, high in boxes:
        with np.errstate(divide="ignore", invalid="ignore"):
            one, other = (low - at) / ray, (high - at) / ray
        near, far = np.minimum(one, other).max(axis=1), np.maximum(one, other).min(axis=1)
        t = np.where((near < far) & (near > 0), np.minimum(t, near), t)
    good = np.isfinite(t) & ok & (np.abs(ray[:, 1]) > GRAZING_COS)
    t, ray, wall = t[good] + rng.normal(0.0, NOISE_M, int(good.sum())), ray[good], wall[good]
    end = at + t[:, None] * ray
    face = at + np.where(np.abs(end[:, 1]) <= BAND_M, t, wall)[:, None] * ray
    rows = np.column_stack([face[:, 0], face[:, 2], -end[:, 1], end[:, 0], end[:, 2]])
    return np.asarray(rows[_within(face, (0.0, WIDE, 0.0, HIGH))])


def _within(places: Array, hole: Hole) -> NDArray[np.bool_]:
    x, z = places[:, 0], places[:, 2]
    return np.asarray((x > hole[0]) & (x < hole[1]) & (z > hole[2]) & (z < hole[3]))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--walls", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--pose-mm", type=float, default=0.0)
    arguments = parser.parse_args()
    pose = arguments.pose_mm / 1000
    off: dict[str, list[tuple[float, float]]] = {"seen edges": [], "hidden edges": [], "widths and heights of seen edges": []}
    found = parts = 0
    for number in range(arguments.walls):
        rng = np.random.default_rng((arguments.seed, number))
        step = float(rng.choice([0.2, 0.3, 0.5]))
        hole, thick, window = draw_hole(rng)
        side = scan(rng, step, hole, thick, window, pose)
        openings = find_openings(face_raster([side], (0.0, WIDE), (0.0, HIGH), BAND_M), [side], 0.0, thick, BAND_M, window)
        own = [
            o for o in openings
            if min(o.u1, hole[1]) - max(o.u0, hole[0]) > FOUND_SHARE * (hole[1] - hole[0])
            and min(o.z1, hole[3]) - max(o.z0, hole[2]) > FOUND_SHARE * (hole[3] - hole[2])
        ]  # fmt: skip
        parts += len(openings) > 1
        if len(own) != 1:
            continue
        found += 1
        errors = np.array([own[0].u0, own[0].u1, own[0].z0, own[0].z1]) - hole
        sigmas = np.hypot(own[0].edge_sigma, pose)
        for name, error, sigma in zip(SIDES, errors, sigmas, strict=True):
            off["hidden edges" if name in own[0].hidden else "seen edges"].append((abs(error), sigma))
        for k in (0, 2):
            if not {SIDES[k], SIDES[k + 1]} & set(own[0].hidden):
                off["widths and heights of seen edges"].append((abs(errors[k + 1] - errors[k]), np.hypot(*sigmas[k : k + 2])))
    print(f"{found} of {arguments.walls} holes found once; {parts} in several parts.")
    for word, pairs in off.items():
        if pairs:
            error, sigma = np.array(pairs).T
            held = int((error < Z95 * sigma).sum())
            print(f"{word}: 95 % intervals hold {held} of {len(error)} times, {held / len(error):.1%} (worst "
                  f"{(error / sigma).max():.1f} sigma); error {1000 * np.median(error):.1f} mm at the median, at most "
                  f"{1000 * error.max():.0f}; sigma {1000 * np.median(sigma):.1f} mm at the median.")


if __name__ == "__main__":
    main()
