"""How right and how fast is ``reconstruct``? Storeys made in code, furnished, scanned, and compared with their truth.

    python scripts/bench_reconstruct.py [--cases flat,offices,slanted,two] [--seed 1] [--step-deg 0.18]
    python scripts/bench_reconstruct.py --cases r101,r102,r103,r104 --seed 5 --step-deg 0.3
    python scripts/bench_reconstruct.py --pose-mm 3 --pose-turn-deg 0.01
    python scripts/bench_reconstruct.py --cases flat --step-deg 0.5 --ground
    python scripts/bench_reconstruct.py --cases lined --seed 7 --step-deg 0.4

Scans: several stations inside, 2 mm noise, six boxes and two people, glass that passes rays; poses are exact unless said
(standard deviations along and about each axis), and there is nothing outside unless ``--ground``. In truth walls are
flat, plumb, square and parallel. The methods were developed on the named plans (seed 1) and on the drawn ones r1 to r4;
r101 and up were drawn to score on.
"""

from __future__ import annotations

import argparse
import math
import tempfile
import time
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from headless_entry import package
from ifcopenshell.util.element import get_pset
from numpy.typing import NDArray
from shapely import MultiPolygon, Polygon, union_all
from shapely.geometry.base import BaseGeometry

PACKAGE = package()

from bim_verify.core.dimensions.regions import Region, read_regions, region_of  # noqa: E402
from bim_verify.core.dimensions.table import Dimension  # noqa: E402
from bim_verify.core.jobs import reconstruct  # noqa: E402
from bim_verify.core.model.load import load_model, open_ifc  # noqa: E402
from bim_verify.core.planes.cloud import Cloud, read_cloud  # noqa: E402
from bim_verify.core.planes.derived import Z95  # noqa: E402
from bim_verify.core.reconstruction.building import BuiltRoom, Reconstruction  # noqa: E402
from bim_verify.core.reconstruction.compare import ClassComparison, Comparison, compare, comparison_lines  # noqa: E402
from bim_verify.core.reconstruction.crossings import BAND_M, cross  # noqa: E402
from bim_verify.core.reconstruction.dimensions import dimension_rows  # noqa: E402
from bim_verify.core.reconstruction.shapes import PSET_NAME, Shape, read_shapes  # noqa: E402
from bim_verify.core.reconstruction.write_ifc import write_reconstruction  # noqa: E402
from bim_verify.core.scans.open import open_scans  # noqa: E402
from bim_verify.core.simulation.campaign import Campaign, place_props, scan_to_files, set_up  # noqa: E402
from bim_verify.core.simulation.random_storey import random_storey  # noqa: E402
from bim_verify.core.simulation.scanner import PRESETS  # noqa: E402
from bim_verify.core.simulation.scene import Prop, build_scene  # noqa: E402
from bim_verify.core.simulation.storey_plans import flat, lined, offices, slanted  # noqa: E402
from bim_verify.core.simulation.storeys import PlannedStorey, write_building  # noqa: E402

GROUND_M, GROUND_BELOW_M = 80.0, 0.05
CELL_M = 0.05
NEAR_M = 0.05
"""A true dimension or corner so near is the one that was measured."""
CASES = {
    "flat": ((flat,), 8.0, (0.0, 0.0), 0.0),
    "offices": ((offices,), 0.0, (0.0, 0.0), 0.0),
    "slanted": ((slanted,), 17.3, (1000.0, 2000.0), 3.0),
    "two": ((slanted, flat), -31.0, (-50.0, 12.0), 100.0),
    "lined": ((lined,), 24.0, (0.0, 0.0), 0.0),
    "equal": ((flat, flat), 12.0, (20.0, 5.0), 0.0),
}


class Off(NamedTuple):
    """By how much something is off."""

    what: str
    by: float
    unit: str
    where: str


def case(name: str) -> tuple[list[PlannedStorey], float, tuple[float, float], float]:
    """Storeys, turn [deg], shift [m] and elevation [m] of a named plan, or of plan N drawn by chance (rN)."""
    if name in CASES:
        plans, *place = CASES[name]
        return [plan() for plan in plans], *place
    if not (name.startswith("r") and name[1:].isdigit()):
        raise SystemExit(f"No plan is named {name}; there are {', '.join(CASES)}, and r1, r2, ...")
    number = int(name[1:])
    return [random_storey(number)], float(37 * number % 90), (0.0, 0.0), 0.0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", default="flat,offices,slanted,two")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--step-deg", type=float, default=0.18)
    parser.add_argument("--pose-mm", type=float, default=0.0)
    parser.add_argument("--pose-turn-deg", type=float, default=0.0)
    parser.add_argument("--ground", action="store_true", help="level ground outside, so that rays through panes come back")
    parser.add_argument("--keep", metavar="FOLDER", help="leave the truth, the scans and what was found in this folder")
    arguments = parser.parse_args()
    poses = arguments.pose_mm / 1000.0, math.radians(arguments.pose_turn_deg)
    edges: list[tuple[bool, float]] = []
    whole: dict[str, list[float]] = {}
    every: list[Dimension] = []
    off: list[Off] = []
    with nullcontext(arguments.keep) if arguments.keep else tempfile.TemporaryDirectory() as folder:
        for name in arguments.cases.split(","):
            truth, built, scan, found = (Path(folder) / f"{name}{end}" for end in ("_truth.ifc", ".ifc", ".e57", "_found.ifc"))
            storeys, turn, shift, level = case(name)
            write_building(truth, storeys, turn_deg=turn, shift=shift, elevation=level, furniture=False)
            positions = write_building(built, storeys, turn_deg=turn, shift=shift, elevation=level)
            model = load_model(built)
            props = place_props(model, build_scene(model, {}, seed=arguments.seed), seed=arguments.seed, boxes=6, people=2)
            if arguments.ground:
                middle = 0.5 * (model.vertices.min(axis=0) + model.vertices.max(axis=0))
                below = float(model.vertices[:, 2].min()) - GROUND_BELOW_M
                place = float(middle[0]), float(middle[1]), below
                props = (*props, Prop("Ground", "box", place, (GROUND_M, GROUND_M, 0.01)))
            set_ups = tuple(set_up(f"S{k}", p - model.origin, arguments.seed, k, poses) for k, p in enumerate(positions))
            step = math.radians(arguments.step_deg)
            scanner = replace(PRESETS["fast"], angular_step=step, sigma_range=0.002, sigma_signal=0.0)
            campaign = Campaign(model, scanner, set_ups, {}, props, arguments.seed, poses, glass="clear")
            written = scan_to_files(campaign, scan, None)
            begin = time.perf_counter()
            result = reconstruct([scan])
            write_reconstruction(found, result)
            seconds = time.perf_counter() - begin
            print(f"{name}: {written.returns:,} returns of {len(positions)} stations, {seconds:.1f} s", flush=True)
            comparison = compare(read_shapes(found), read_shapes(truth))
            for line in comparison_lines(comparison):
                print(f"  {line}", flush=True)
            for line in what_showed(comparison.classes["openings"], scan):
                print(f"  {line}", flush=True)
            shape = what_is_off(name, comparison, found, truth)
            off += shape
            print(f"  {worst(shape)}", flush=True)
            own = [e for m in comparison.classes["openings"].matches for e in m.edges_in_sigmas]
            print(f"  {coverage(own)}", flush=True)
            edges += own
            print(f"  Poses taken to be off by {1000 * result.poses.sigma:.2f} mm, "
                  f"{math.degrees(result.poses.turn):.4f} degrees.", flush=True)
            rows = dimension_rows(result)
            errors, large = in_sigmas(rows, result, truth), largest_gap(rows)
            errors["axes of walls"] = axes_in_sigmas(comparison, found)
            print(f"  {intervals(errors)}\n  {small_p(rows)} Largest gap {1000 * large:.1f} mm.", flush=True)
            for kind, values in errors.items():
                whole.setdefault(kind, []).extend(values)
            every += rows
    print(f"All: {worst(off)}\n{coverage(edges)}\n{intervals(whole)}\n{small_p(every)}")


def what_is_off(name: str, comparison: Comparison, found: Path, truth: Path) -> list[Off]:
    """Lengths of walls, and outlines of rooms and slabs in plan: an area found wrongly, or not found."""
    walls = comparison.classes["walls"].matches
    out = [Off("length of a wall", abs(m.length), "m", f"{name}, {m.reference.name}") for m in walls]
    mine, true = open_ifc(found), open_ifc(truth)
    for what, kind in (("outline of a room", "spaces"), ("outline of a slab", "slabs")):
        for m in comparison.classes[kind].matches:
            a, b = (region_of(f.by_guid(s.global_id), np.zeros(3)) for f, s in ((mine, m.found), (true, m.reference)))
            assert a is not None and b is not None, "what was compared has a body"
            apart = filled(a.outline).symmetric_difference(filled(b.outline)).area
            out.append(Off(what, apart, "m2", f"{name}, {m.reference.name}"))
    return out


def filled(outline: Polygon | MultiPolygon) -> BaseGeometry:
    """Without holes: the true rooms have none where columns stand."""
    return union_all([Polygon(part.exterior) for part in getattr(outline, "geoms", [outline])])


def worst(off: list[Off]) -> str:
    """The largest of each kind."""
    kinds = dict.fromkeys(o.what for o in off)
    largest = [max((o for o in off if o.what == kind), key=lambda o: o.by) for kind in kinds]
    return "Most off: " + "; ".join(f"{o.what} {o.by:.3f} {o.unit} ({o.where})" for o in largest) + "."


def what_showed(openings: ClassComparison, scan: Path) -> list[str]:
    """Of each opening that was not found, how much of it any station could see into; and the F1 of those that showed at all."""
    if not openings.missed:
        return []
    cloud = read_cloud(open_scans([scan]), 4.0)
    shares = {hole.name: shown(cloud, hole) for hole in openings.missed}
    there = openings.reference - sum(share == 0.0 for share in shares.values())
    f1 = 2 * len(openings.matches) / (openings.found + there)
    told = ", ".join(f"{name} ({100 * share:.0f} % of its area)" for name, share in shares.items())
    return [f"Of openings not found showed: {told}. F1 of the {there} openings of which something showed: {f1:.3f}."]


def shown(cloud: Cloud, hole: Shape) -> float:
    """Share of a true opening's area through which rays went that came back, from either side of its wall, 0..1."""
    middle, half = hole.middle - cloud.origin, hole.width / 2
    u, z = float(middle[:2] @ hole.along), float(middle[2])
    reach = [[u - hole.length / 2, u + hole.length / 2], [z - hole.height / 2, z + hole.height / 2]]
    bins = [max(int((high - low) / CELL_M), 1) for low, high in reach]
    seen = np.zeros(bins, dtype=np.bool_)
    for normal in (hole.across, -hole.across):
        rays = cross(cloud, normal, float(middle[:2] @ normal) + half, hole.along, tuple(reach[0]), tuple(reach[1]))
        through = rays.depth > BAND_M
        seen |= np.histogram2d(rays.u[through], rays.z[through], bins, reach)[0] > 0
    return float(seen.mean())


def coverage(edges: list[tuple[bool, float]]) -> str:
    """How often the 95 % intervals of the edges of openings hold the truth."""
    parts = []
    for word, wanted in (("seen", True), ("hidden", False)):
        off = [abs(z) for seen, z in edges if seen == wanted]
        held = sum(z < Z95 for z in off)
        parts.append(f"{held} of {len(off)} {word} edges" + (f" (worst {max(off):.1f} sigma)" if off else ""))
    return "95 % intervals hold for " + ", ".join(parts) + "."


def in_sigmas(rows: list[Dimension], result: Reconstruction, truth: Path) -> dict[str, list[float]]:
    """Errors of clear widths, heights and corners of rooms over their sigmas; what is nearest in the true room is meant."""
    spaces, _ = read_regions(truth, result.origin)

    def true_room(room: BuiltRoom) -> Region | None:
        place, height = room.outline.representative_point(), 0.5 * (room.floor + room.ceiling)
        return next((v for v in spaces if v.outline.contains(place) and v.low < height < v.high), None)

    rooms = {f"{s.name}, room {k}": true_room(r) for s in result.storeys for k, r in enumerate(s.rooms, start=1)}
    out: dict[str, list[float]] = {}
    for row in rows:
        space = rooms.get(row.where)
        if space is None or row.value is None or row.sigma is None:
            continue
        ring = np.array(space.outline.exterior.coords)[:-1] + result.origin[:2]
        if row.what == "height":
            true = np.array([space.high - space.low])
        elif row.what == "width":
            true = side_distances(ring)
        elif row.what in ("vertex x", "vertex y"):
            true = ring[:, "xy".index(row.what[-1])]
        elif row.what == "vertex z":
            true = np.array([space.low, space.high]) + result.origin[2]
        else:
            continue
        off = float(np.min(np.abs(row.value - true)))
        if off < NEAR_M:
            out.setdefault("vertices" if row.what.startswith("vertex") else f"{row.what}s", []).append(off / row.sigma)
    return out


def axes_in_sigmas(comparison: Comparison, found: Path) -> list[float]:
    """Errors of the axes of walls over their ``PositionSigma``."""
    file = open_ifc(found)
    said = [(m.axis, get_pset(file.by_guid(m.found.global_id), PSET_NAME)) for m in comparison.classes["walls"].matches]
    return [axis / own["PositionSigma"] for axis, own in said if own.get("PositionSigma")]


def side_distances(ring: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distances of all parallel sides of a polygon [m]."""
    along = np.roll(ring, -1, axis=0) - ring
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    across = np.column_stack([-along[:, 1], along[:, 0]])
    apart = np.abs(np.einsum("ik,ijk->ij", across, ring[None] - ring[:, None]))
    parallel = np.abs(across @ along.T) < 0.01
    return np.asarray(apart[parallel & (apart > NEAR_M)])


def intervals(errors: dict[str, list[float]]) -> str:
    """How often 95 % intervals hold."""
    told = [
        f"{sum(v < Z95 for v in values)} of {len(values)} {kind} (worst {max(values):.1f} sigma)"
        for kind, values in errors.items()
    ]
    return f"95 % intervals of rooms and walls hold for {', '.join(told)}."


def largest_gap(rows: list[Dimension]) -> float:
    """Under a straightedge [m]."""
    return max((r.value for r in rows if r.what.startswith("flatness") and r.value is not None), default=0.0)


def small_p(rows: list[Dimension]) -> str:
    """How many tests find something where nothing is."""
    kinds: dict[str, list[float]] = {}
    for row in rows:
        if row.limit is not None and row.p_value is not None:
            kinds.setdefault(row.what.split()[0], []).append(row.p_value)
    told = [f"{kind} {sum(p < 0.05 for p in values)} of {len(values)}" for kind, values in kinds.items()]
    exceeded = sum(bool(r.exceeds) for r in rows)
    return f"p below 0.05: {', '.join(told)}; limits exceeded: {exceeded}."


if __name__ == "__main__":
    main()
