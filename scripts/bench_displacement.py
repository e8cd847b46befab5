"""Joint displacements of a simulated panelled wall: 3 distances x 4 incidence angles x 3 resolutions x 15 movements.

    python scripts/bench_displacement.py [--locked] [--relief ridges|plain|bricks] [--chamfer-mm 20] [--quick]
        [--distances 5 10 30] [--steps 0.12 0.06 0.03] [--own-base] [--stepped]

Each movement is scanned anew and compared with a scan of the wall before; the middle column's joints are scored. Prints
one line per set-up, then the share of the joints' length that was extracted (rounded to quarters per joint), the mean
error, and last ``worst N mm``: the largest mean error of a column's joints over all cases. ``--locked`` shoots all lines
of a scan at the same elevations. ``--own-base`` scans the wall before anew for each movement: the errors are then
independent, as the share of them below 1.96 sigma needs. ``--stepped`` takes five other movements, of panels that step
out of one another. Joints that were not found, and those whose movement was not determined, are counted and have no error.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace

import numpy as np
from headless_entry import package

PACKAGE = package()

from bim_verify.core.jobs.displacement import DisplacementOptions, displacement  # noqa: E402
from bim_verify.core.scans.campaign import Station  # noqa: E402
from bim_verify.core.simulation.box_building import ArraySource  # noqa: E402
from bim_verify.core.simulation.panel_wall import (  # noqa: E402
    PanelMove,
    WallDesign,
    build_wall,
    joint_shift,
    leaning,
    uniform,
)
from bim_verify.core.simulation.scanner import Scanner  # noqa: E402
from bim_verify.core.simulation.wall_scan import scan_window  # noqa: E402
from bim_verify.core.wall_displacement.result import Column, DisplacementResult  # noqa: E402

DISTANCES_M = (5.0, 10.0, 30.0)
INCIDENCES_DEG = (0.0, 10.0, 20.0, 30.0)
STEPS_DEG = (0.12, 0.06, 0.03)
SCANNER = Scanner(
    "long range", np.radians(0.06), sigma_range=0.001, sigma_signal=0.0003, beam_exit_diameter=0.007, beam_divergence=3.5e-4,
    range_max=200.0,
)
HEIGHT_M = 1.75
FOUND_WITHIN_M = 0.03


def movements(design: WallDesign) -> dict[str, list[PanelMove]]:
    """The fifteen: none; settlement and lateral 10, 50, 100 mm; all panels or inner and outer ones turned."""
    out = {"none": uniform(design)}
    for mm in (10, 50, 100):
        out[f"settlement {mm}"] = uniform(design, vertical=-mm / 1000)
        out[f"lateral {mm}"] = uniform(design, lateral=mm / 1000)
    for angle in (1, -1, 2, -2):
        out[f"tilt {angle}"] = leaning(design, np.radians([angle] * design.rows).tolist())
        other = {1: 2, -1: -2, 2: 1, -2: -1}[angle]
        inner = [other, *[angle] * (design.rows - 2), other]
        out[f"tilts {angle}"] = leaning(design, np.radians(inner).tolist())
    return out


def stepped(design: WallDesign) -> dict[str, list[PanelMove]]:
    """Panels out of one another, outward, inward and in turns, with and without settlements of their own."""
    rows = range(design.rows)
    return {
        "outward": [PanelMove(0.006 * k) for k in rows],
        "inward": [PanelMove(-0.006 * k) for k in rows],
        "in turns": [PanelMove(0.01 * (k % 2)) for k in rows],
        "settled apart": [PanelMove(0.0, -0.006 * k) for k in rows],
        "bulging": [PanelMove(0.02 * k / design.rows * (1 + k / design.rows), -0.005 * k) for k in rows],
    }


def scanned(design: WallDesign, moves: list[PanelMove], distance: float, incidence: float, step: float, seed: int,
            locked: bool) -> ArraySource:
    scene = build_wall(design, dict.fromkeys(range(design.columns), moves))
    angle = np.radians(incidence)
    position = np.array([distance * np.sin(angle), distance * np.cos(angle), HEIGHT_M])
    half = design.panel_width / 2 + 0.35
    top = design.rows * (design.panel_height + design.joint)
    offsets = scan_window(
        scene, position, np.array([-half, 0.0, 0.0]), np.array([half, 0.0, top]),
        replace(SCANNER, angular_step=np.radians(step)), seed=seed, locked=locked,
    )
    return ArraySource((Station("S", position),), (offsets,))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--locked", action="store_true")
    parser.add_argument("--relief", default="ridges", choices=("ridges", "plain", "bricks"))
    parser.add_argument("--chamfer-mm", type=float, default=20.0)
    parser.add_argument("--distances", type=float, nargs="+", choices=DISTANCES_M, default=DISTANCES_M, help="only these")
    parser.add_argument("--steps", type=float, nargs="+", choices=STEPS_DEG, default=STEPS_DEG, help="only these, degrees")
    parser.add_argument("--quick", action="store_true", help="one incidence angle and five movements")
    parser.add_argument("--stepped", action="store_true", help="five movements of panels out of one another instead")
    parser.add_argument("--own-base", action="store_true", help="a base scan for each movement")
    arguments = parser.parse_args()
    design = WallDesign(relief=arguments.relief, chamfer=arguments.chamfer_mm / 1000)
    cases = stepped(design) if arguments.stepped else movements(design)
    if arguments.quick and not arguments.stepped:
        cases = {k: cases[k] for k in ("none", "settlement 50", "lateral 100", "tilt 2", "tilts -2")}
    extracted, errors, worst_joint, undetermined, lost, count, number = [], [], 0.0, 0, 0, 0, 0
    opened = []
    seconds, processor, taken, z = [], [], [], []
    print("distance incidence  step    extracted  mean error  worst case  s a column")
    for distance in DISTANCES_M:
        for incidence in INCIDENCES_DEG[1:2] if arguments.quick else INCIDENCES_DEG:
            for step in STEPS_DEG:
                number += 1
                if distance not in arguments.distances or step not in arguments.steps:
                    continue
                base = scanned(design, uniform(design), distance, incidence, step, 1000 * number, arguments.locked)
                rows = []
                for k, (_, moves) in enumerate(cases.items()):
                    if arguments.own_base and k > 0:
                        first = 1000 * number + 500 + k
                        base = scanned(design, uniform(design), distance, incidence, step, first, arguments.locked)
                    later = scanned(design, moves, distance, incidence, step, 1000 * number + 1 + k, arguments.locked)
                    begin, used = time.perf_counter(), time.process_time()
                    result = displacement(base, later, DisplacementOptions())
                    taken.append(time.perf_counter() - begin)
                    seconds.append(taken[-1] / max(len(result.columns), 1))
                    processor.append((time.process_time() - used) / max(len(result.columns), 1))
                    column = middle_column(result)
                    shares, found = [], []
                    for row in range(design.rows - 1):
                        height = design.joint_height(row)
                        near = [j for j in column.joints
                                if j.state == "PAIRED" and abs(j.position[2] - height) < FOUND_WITHIN_M]
                        shares.append(np.round(4 * near[0].completeness_later) / 4 if near else 0.0)
                        if not near:
                            lost += 1
                            continue
                        joint, true = near[0], joint_shift(design, moves, row)
                        if joint.vertical is None or joint.lateral is None:
                            undetermined += 1
                            continue
                        error = 1000 * np.array([joint.lateral - true[0], joint.vertical - true[1]])
                        found.append(np.abs(error).mean())
                        z.append(error / 1000 / [joint.lateral_sigma, joint.vertical_sigma])
                        if joint.opening is not None and joint.opening_sigma:
                            width = moves[row + 1].vertical - moves[row].vertical
                            opened.append((joint.opening - width, joint.opening_sigma))
                        worst_joint = max(worst_joint, float(np.abs(error).max()))
                    count += 1
                    rows.append((np.mean(shares), np.mean(found) if found else np.nan))
                extracted += [r[0] for r in rows]
                errors += [r[1] for r in rows]
                case = np.array([r[1] for r in rows])
                print(
                    f"{distance:6.0f} m {incidence:6.0f} deg {step:6.2f} {np.mean([r[0] for r in rows]):10.3f} "
                    f"{np.nanmean(case):8.2f} mm {np.nanmax(case):8.2f} mm {np.mean(seconds[-len(rows):]):8.2f}", flush=True,
                )
    print(f"{count} cases; joints extracted, mean {np.mean(extracted):.4f}; joints not found {lost}, without a "
          f"movement {undetermined}")
    share = 100 * np.mean(np.abs(z) < 1.96, axis=0)
    print(f"mean error {np.nanmean(errors):.3f} mm; worst single joint and direction {worst_joint:.2f} mm; "
          f"|error| < 1.96 sigma: lateral {share[0]:.1f} %, vertical {share[1]:.1f} %")
    if arguments.stepped and opened:
        off, sigma = np.array(opened).T
        inside = 100 * np.mean(np.abs(off / sigma) < 1.96)
        print(f"opening: mean error {1000 * np.abs(off).mean():.2f} mm, |error| < 1.96 sigma {inside:.1f} %")
    print(f"{np.mean(seconds):.2f} s a column, at most {np.max(seconds):.2f} s; {np.mean(taken):.2f} s a case, "
          f"at most {np.max(taken):.2f} s; processor {np.mean(processor):.2f} s a column, at most {np.max(processor):.2f} s")
    print(f"worst {np.nanmax(errors):.3f} mm")


def middle_column(result: DisplacementResult) -> Column:
    """The column that stands at x = 0 of the scan frame, whatever part of its neighbours was found."""
    return min(result.columns, key=lambda c: abs(c.joints[0].position[0]) if c.joints else np.inf)


if __name__ == "__main__":
    main()
