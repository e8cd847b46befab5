"""The report of a bundle adjustment."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from ..report.plain_page import Section, millimetres, write_page
from .bundle import BundleResult
from .bundle_problem import INSIDE_NAMES, BundleProblem

MOST_ROWS = 500


def summary(problem: BundleProblem, result: BundleResult) -> dict[str, float | int]:
    """The adjustment in a few numbers; lengths in metres, image measures in pixels."""
    sigma = point_sigma(result)
    kept = result.weight > 0
    return {
        "images": len(result.cameras), "points": len(result.points), "observations": len(problem.observed),
        "control_points": len(problem.control.point), "redundancy": result.redundancy,
        "sigma0": math.sqrt(result.variance_factor) if result.variance_factor >= 0 else math.nan,
        "residual_rms_px": float(np.sqrt((result.residual[kept] ** 2).mean())) if kept.any() else math.nan,
        "rejected": int((~kept).sum()), "point_sigma_median": float(np.median(sigma)),
        "point_sigma_p95": float(np.percentile(sigma, 95)),
    }


def scaling(result: BundleResult) -> str:
    """One sentence: what the sigmas of the result count."""
    worse = [f"{g.name} {g.stretch:.2f} times" for g in result.groups if g.stretch > 1.0]
    first = f"Sigmas count {' and '.join(worse)} the stated ones" if worse else "Sigmas follow from the stated ones"
    return f"{first}, times {math.sqrt(result.covariance_scale):.3f} (sigma 0 that is left, where above 1)."


def point_sigma(result: BundleResult) -> np.ndarray:
    """(M,) mean standard deviation per axis, sqrt(trace / 3), metres."""
    return np.sqrt(np.einsum("pii->p", result.point_covariance) / 3.0)


def write_bundle_report(
    folder: str | Path, name: str, problem: BundleProblem, result: BundleResult, method: str, left_out: int = 0
) -> Path:
    """Write ``index.html`` into ``folder`` (made if missing) and return its path; BimVerifyError where that fails."""
    facts = summary(problem, result)
    groups = Section(
        "Groups of observations", "A variance component of 1 means: as accurate as stated.",
        columns=("Group", "Observations", "Redundancy", "Variance component"),
        rows=[(g.name, str(g.observations), f"{g.redundancy:.0f}", f"{g.factor:.3f}") for g in result.groups],
        numeric=frozenset({1, 2, 3}),
    )
    inside = Section(
        "Interior orientations", "Free parameters with their standard deviations; the others are as given.",
        columns=("Interior", *INSIDE_NAMES),
        rows=[
            (str(k), *(
                f"{value:.5g}" + (f" +- {s:.2g}" if s > 0 else "")
                for value, s in zip(
                    (i.fx, i.cx, i.cy, *i.distortion), (sigma[0] * i.fx, *sigma[1:]), strict=True
                )
            ))
            for k, (i, sigma) in enumerate(zip(result.interiors, result.interior_sigma, strict=True))
        ],
        numeric=frozenset(range(1, 9)),
    )
    control = Section(
        "Control points", "Adjusted less given coordinates.", columns=("Point", "X mm", "Y mm", "Z mm", "Stated sigma mm"),
        rows=[
            (str(p), *(f"{1000 * v:z.1f}" for v in result.points[p] - x), millimetres(float(s.max())))
            for p, x, s in zip(
                problem.control.point[:MOST_ROWS], problem.control.coordinates, problem.control.sigma, strict=False
            )
        ],
        numeric=frozenset({1, 2, 3, 4}),
    )
    images = Section(
        "Images", columns=("Image", "X m", "Y m", "Z m", "Sigma position mm", "Sigma rotation deg"),
        rows=[
            (c.name, *(f"{v:.3f}" for v in c.position), millimetres(math.sqrt(float(np.linalg.eigvalsh(q[3:, 3:])[-1]))),
             f"{math.degrees(math.sqrt(float(np.linalg.eigvalsh(q[:3, :3])[-1]))):.4f}")
            for c, q in list(zip(result.cameras, result.pose_covariance, strict=True))[:MOST_ROWS]
        ],
        numeric=frozenset(range(1, 6)),
    )
    headline = (
        f"{facts['images']} images, {facts['points']} tie points. Sigma 0 is {facts['sigma0']:.2f}; tie points are known to "
        f"{1000 * facts['point_sigma_median']:.1f} mm (median), {1000 * facts['point_sigma_p95']:.1f} mm (95 %)."
    )
    meta = [
        ("Redundancy", str(facts["redundancy"])), ("Residual", f"{facts['residual_rms_px']:.2f} px"),
        ("Taken out", f"{facts['rejected']} observations"), ("Left out", f"{left_out} points that fewer than two images show"),
        ("Sigmas", scaling(result)), ("Method", method),
    ]
    return write_page(folder, f"Bundle adjustment of {name}", "Bundle adjustment", headline, meta, [
        section for section in (groups, inside, control, images) if section.rows
    ])
