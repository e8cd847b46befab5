"""A bundle project as a plain JSON file: cameras, tie points, control points, and what is free.

::

    {"format": "bim_verify.bundle",
     "interiors": {"camera": {"width": 4000, "height": 3000, "f": 3000}},
     "cameras": [{"image": "a.jpg", "interior": "camera", "position": [x, y, z], "rotation": [[...], [...], [...]]}],
     "points": [[x, y, z], ...],
     "observations": [[camera, point, u, v], ...],          (rows of the lists; pixels of the image as it is)
     "sigma_px": 0.5,
     "control": [{"point": 0, "coordinates": [x, y, z], "sigma_m": 0.002}],
     "free": ["f", "cx", "cy", "k1", "k2"]}

A folder of COLMAP or a Bundler file can stand in the place of the JSON file.
``{"import": "sparse/0", "control": [...]}`` takes cameras, points and observations from a folder of COLMAP (text or binary)
instead, ``{"import": "bundle.out", "image_size": [4000, 3000]}`` from a Bundler file (Metashape and others export it), and
``{"import": "cameras.xml", "points": ..., "observations": ...}`` the cameras from a Metashape XML file.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import BimVerifyError
from ..json_in import read_json_object
from ..report.json_out import to_plain
from .bundle import BundleResult
from .bundle_problem import INSIDE_NAMES, BundleProblem, Control, ImageObservations
from .bundler import read_bundler
from .camera import Camera, Interior
from .cameras_file import (
    LARGEST_FILE,
    camera_to_plain,
    interior_to_plain,
    numbers,
    positive,
    read_camera_entries,
)
from .colmap import read_colmap
from .metashape import read_metashape_cameras

FORMAT, FORMAT_VERSION = "bim_verify.bundle", 1
SIGMA_PX = 1.0
CONTROL_SIGMA_M = 0.005
MOST_OBSERVATIONS = 50_000_000
Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def read_project(path: str | Path) -> BundleProblem:
    """Read a project file and what it imports, a COLMAP folder or a Bundler file. Raises BimVerifyError."""
    return problem_of(project_content(path), Path(path))


def project_content(path: str | Path) -> dict[str, Any]:
    """What a project file says; of a COLMAP folder or a Bundler file, that it is to be imported. Raises BimVerifyError."""
    source = Path(path)
    if source.is_dir() or source.suffix.lower() == ".out":
        return {"import": str(source.resolve())}
    return read_json_object(source, "a bundle project", LARGEST_FILE)


def problem_of(content: dict[str, Any], source: Path) -> BundleProblem:
    """What a project file's ``content`` asks to adjust. Raises BimVerifyError."""
    sigma = positive(content, "sigma_px", source.name, SIGMA_PX)
    place = _import_path(content, source)
    if place is None:
        problem = _own(content, tuple(known.camera for known in read_camera_entries(content, source)), source, sigma)
    elif place.is_dir():
        problem = read_colmap(place, sigma)
    elif place.suffix.lower() == ".xml":
        problem = _own(content, read_metashape_cameras(place), source, sigma)
    elif place.suffix.lower() == ".out":
        problem = read_bundler(place, sigma, numbers(content.get("image_size"), (2,)))
    else:
        raise BimVerifyError(
            f"{place} is neither a folder of COLMAP (cameras, images, points3D), nor a Metashape XML, nor a Bundler file "
            "(.out)."
        )
    control = _control(content, source, len(problem.points))
    free = content.get("free", list(problem.free))
    if not isinstance(free, list) or not all(isinstance(name, str) for name in free):
        raise BimVerifyError(f"{source}: free must be a list of names out of {', '.join(INSIDE_NAMES)}.")
    if len(control.point):
        problem = replace(problem, control=control)
    problem = replace(problem, free=tuple(free))
    problem.check()
    return problem


def imported_files(path: str | Path) -> list[str]:
    """The files that a project takes from elsewhere: that which it names, those of its folder, those beside a list of images.

    Raises BimVerifyError where the project cannot be read.
    """
    place = _import_path(project_content(path), Path(path))
    if place is None or not place.exists():
        return []
    inside = sorted(place.iterdir()) if place.is_dir() else [place, *sorted(place.parent.glob("*.txt"))]
    return [str(file) for file in inside if file.is_file()]


def _import_path(content: dict[str, Any], source: Path) -> Path | None:
    if "import" not in content:
        return None
    name = content["import"]
    if not isinstance(name, str) or not name:
        raise BimVerifyError(f"{source}: import must name a COLMAP folder, a Metashape XML or a Bundler file.")
    return source.parent / name


def _own(content: dict[str, Any], cameras: tuple[Camera, ...], source: Path, sigma: float) -> BundleProblem:
    interiors = tuple(dict.fromkeys(c.interior for c in cameras))
    inside_of = np.array([interiors.index(c.interior) for c in cameras], dtype=np.int64)
    points = numbers_list(content.get("points"), 3, f"{source}: points")
    rows = numbers_list(content.get("observations"), (4, 5), f"{source}: observations")
    if (np.abs(rows[:, :2]) > MOST_OBSERVATIONS).any() or (rows[:, :2] % 1 != 0).any():
        raise BimVerifyError(f"{source}: an observation's camera and point must be whole numbers (rows of the lists).")
    index = rows[:, :2].astype(np.int64)
    spread = rows[:, 4] if rows.shape[1] == 5 else np.full(len(rows), sigma)
    observed = ImageObservations(index[:, 0], index[:, 1], np.ascontiguousarray(rows[:, 2:4]), spread)
    return BundleProblem(cameras, interiors, inside_of, points, observed)


def numbers_list(value: Any, width: int | tuple[int, ...], where: str) -> Floats:
    """A list of rows of finite numbers; BimVerifyError if it is none."""
    widths = (width,) if isinstance(width, int) else width
    try:
        rows = np.array(value if isinstance(value, list) else None, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        rows = np.zeros(0)
    if rows.ndim != 2 or rows.shape[1] not in widths or not np.isfinite(rows).all() or len(rows) > MOST_OBSERVATIONS:
        raise BimVerifyError(f"{where} must be a list of rows of {' or '.join(map(str, widths))} numbers.")
    return rows


def _control(content: dict[str, Any], source: Path, points: int) -> Control:
    entries = content.get("control", [])
    if not isinstance(entries, list):
        raise BimVerifyError(f"{source}: control must be a list of points with coordinates.")
    index, coordinates, sigmas = [], [], []
    for number, entry in enumerate(entries):
        where = f"Control point {number + 1} of {source.name}"
        place = numbers(entry.get("coordinates"), (3,)) if isinstance(entry, dict) else None
        row = entry.get("point") if isinstance(entry, dict) else None
        if place is None or not isinstance(row, int) or isinstance(row, bool) or not 0 <= row < points:
            raise BimVerifyError(f"{where} needs a point (0 to {points - 1}) and coordinates [x, y, z] in metres.")
        sigma = numbers(entry.get("sigma_m"), (3,))
        if sigma is None:
            sigma = np.full(3, positive(entry, "sigma_m", where, CONTROL_SIGMA_M))
        if row in index:
            raise BimVerifyError(f"{where} names point {row}, which is a control point already; give each point once.")
        index.append(row)
        coordinates.append(place)
        sigmas.append(sigma)
    return Control(
        np.array(index, dtype=np.int64), np.array(coordinates).reshape(-1, 3), np.array(sigmas).reshape(-1, 3)
    )


def adjusted_project(
    problem: BundleProblem, result: BundleResult, method: str, left_out: Ints | None = None
) -> dict[str, Any]:
    """The adjusted project: a project file again, with covariances beside.

    ``left_out`` are rows of points of the project as it was given that are not in ``problem``.
    """
    names = [f"interior_{k}" for k in range(len(result.interiors))]
    cameras = []
    for k, camera in enumerate(result.cameras):
        entry = camera_to_plain(camera)
        entry["interior"] = names[int(problem.inside_of[k])]
        entry["covariance"] = result.pose_covariance[k]
        cameras.append(entry)
    o = problem.observed
    plain: dict[str, Any] = to_plain({
        "format": FORMAT, "format_version": FORMAT_VERSION, "method": method,
        "covariance_order": ["rotation about the camera's x, y, z [rad]", "position along x, y, z [m]"],
        "interiors": {
            name: interior_to_plain(i) | {"sigma": dict(zip(INSIDE_NAMES, _in_pixels(i, s), strict=True))}
            for name, i, s in zip(names, result.interiors, result.interior_sigma, strict=True)
        },
        "cameras": cameras,
        "points": result.points,
        "point_covariance": result.point_covariance[:, [0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]],
        "point_covariance_order": ["xx", "xy", "xz", "yy", "yz", "zz"],
        "point_shared_sigma": result.shared_sigma,
        "observations": np.column_stack([o.camera, o.point, o.pixel, o.sigma]),
        "residuals_px": result.residual,
        "weights": result.weight,
        "control": [
            {"point": int(p), "coordinates": x, "sigma_m": s, "residual_m": result.points[p] - x}
            for p, x, s in zip(problem.control.point, problem.control.coordinates, problem.control.sigma, strict=True)
        ],
        "free": problem.free,
        "variance_factor": result.variance_factor,
        "covariance_scale": result.covariance_scale,
        "points_left_out": [] if left_out is None else left_out,
        "redundancy": result.redundancy,
        "groups": [
            {
                "name": g.name, "observations": g.observations, "redundancy": g.redundancy, "variance_component": g.factor,
                "sigma_multiplied_by": g.stretch,
            }
            for g in result.groups
        ],
        "rounds": result.rounds,
    })
    return plain


def _in_pixels(interior: Interior, sigma: Floats) -> Floats:
    return np.concatenate([[sigma[0] * interior.fx], sigma[1:]])
