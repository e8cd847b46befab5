"""``cameras.json``: interior orientations, and the pose of every image with its standard deviation."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import BimVerifyError
from ..json_in import read_json_object
from .camera import Camera, Interior, from_omega_phi_kappa, rotation_vector
from .image_names import matching

FORMAT, FORMAT_VERSION = "bim_verify.cameras", 1
LARGEST_FILE = 256 * 2**20
LARGEST_SIDE_PX = 100_000
FARTHEST_COORDINATE_M = 1e8
POSITION_SIGMA_M = 0.15
ROTATION_SIGMA_RAD = math.radians(1.0)
"""Of a coarse pose whose file does not say it."""
ROUNDING = 1e-4
LARGEST_NUMBER = 1e300
LEAST_SIGMA, LARGEST_SIGMA = 1e-6, 1e4
"""Of a pose, metres or degrees."""
DISTORTION = ("k1", "k2", "p1", "p2", "k3")
Vector = NDArray[np.float64]


@dataclass(frozen=True)
class KnownCamera:
    """A camera and how well its pose is known: standard deviations per axis, metres and radians."""

    camera: Camera
    position_sigma: float = POSITION_SIGMA_M
    rotation_sigma: float = ROTATION_SIGMA_RAD


@dataclass(frozen=True)
class CameraList:
    """The content of a cameras file; ``frame`` says which frame its positions are in."""

    cameras: tuple[KnownCamera, ...]
    frame: str = "model"

    def of_image(self, path: str | Path) -> KnownCamera:
        """The camera of an image file, see ``camera_of``."""
        return self.cameras[camera_of(path, [k.camera.name for k in self.cameras])]


def camera_of(path: str | Path, names: Sequence[str]) -> int:
    """Row of the camera of an image file among their ``names`` (see ``image_names``). BimVerifyError unless it is just one."""
    found = matching(path, names)
    if len(found) > 1:
        raise BimVerifyError(f"{len(found)} cameras are called as the image {Path(path).name}; give every image one camera.")
    if not found:
        raise BimVerifyError(f"There is no camera for the image {Path(path).name}; cameras are named like {names[0]}.")
    return found[0]


def cameras_of(paths: Sequence[str | Path], names: Sequence[str]) -> list[int]:
    """Rows of the cameras of image files among their ``names``. BimVerifyError unless each image has one of its own."""
    rows = [camera_of(path, names) for path in paths]
    for number, row in enumerate(rows):
        if row in rows[:number]:
            first = Path(paths[rows.index(row)])
            raise BimVerifyError(
                f"{first} and {paths[number]} are both taken for the camera {names[row]}; name every image once, and give "
                "cameras of images in folders the folder's name too."
            )
    return rows


def read_cameras(path: str | Path, position_sigma: float | None = None, rotation_sigma: float | None = None) -> CameraList:
    """Read a cameras file (docs/photos.md describes it), or a Metashape XML export. Raises BimVerifyError.

    The sigmas [m], [rad] per axis count for cameras whose file does not say them.
    """
    position = POSITION_SIGMA_M if position_sigma is None else position_sigma
    rotation = ROTATION_SIGMA_RAD if rotation_sigma is None else rotation_sigma
    source = Path(path)
    if source.suffix.lower() == ".xml":
        from .metashape import read_metashape_cameras

        return CameraList(tuple(KnownCamera(camera, position, rotation) for camera in read_metashape_cameras(source)))
    content = read_json_object(source, "a cameras file", LARGEST_FILE)
    frame = content.get("frame", "model")
    if frame not in ("model", "map"):
        raise BimVerifyError(f"{source} gives the frame {str(frame)[:40]!r}; it must be model or map.")
    return CameraList(_entries(content, source, position, rotation), frame)


def read_camera_entries(content: dict[str, Any], source: Path) -> tuple[KnownCamera, ...]:
    """The cameras of a JSON object that has them as a cameras file has."""
    return _entries(content, source, POSITION_SIGMA_M, ROTATION_SIGMA_RAD)


def _entries(content: dict[str, Any], source: Path, position: float, rotation: float) -> tuple[KnownCamera, ...]:
    entries = content.get("cameras") or content.get("images")
    if not isinstance(entries, list) or not entries:
        raise BimVerifyError(f'{source} holds no list of cameras; write {{"cameras": [{{"image": "a.jpg", ...}}]}}.')
    shared = content.get("interiors", {})
    if not isinstance(shared, dict):
        raise BimVerifyError(f"{source}: interiors must be an object of named interior orientations.")
    return tuple(_known(entry, index, content, shared, source, position, rotation) for index, entry in enumerate(entries))


def camera_to_plain(camera: Camera) -> dict[str, Any]:
    """A camera as an entry of a cameras file."""
    return {
        "image": camera.name,
        "interior": interior_to_plain(camera.interior),
        "position": camera.position.tolist(),
        "rotation": camera.rotation.tolist(),
    }


def interior_to_plain(interior: Interior) -> dict[str, Any]:
    """An interior orientation as it stands in a cameras file, pixels."""
    return {
        "width": interior.width, "height": interior.height, "fx": interior.fx, "fy": interior.fy, "cx": interior.cx,
        "cy": interior.cy, **dict(zip(DISTORTION, interior.distortion, strict=True)),
    }


def read_interior(value: Any, where: str) -> Interior:
    """An interior orientation from its JSON object; ``where`` begins the sentence of an error."""
    if not isinstance(value, dict):
        raise BimVerifyError(f"{where} has no interior orientation; give its width, height and f in pixels.")
    width, height = number(value, "width", where), number(value, "height", where)
    if "f_mm" in value:
        number(value, "sensor_width_mm", where)
        f = number(value, "f_mm", where) / positive(value, "sensor_width_mm", where, 1.0) * width
    else:
        f = number(value, "f" if "f" in value else "fx", where)
    fy = number(value, "fy", where) if "fy" in value else f
    _check_size(width, height, f, fy, where)
    cx = number(value, "cx", where) if "cx" in value else (width - 1) / 2
    cy = number(value, "cy", where) if "cy" in value else (height - 1) / 2
    k1, k2, p1, p2, k3 = (number(value, name, where) if name in value else 0.0 for name in DISTORTION)
    interior = Interior(int(width), int(height), f, fy, cx, cy, (k1, k2, p1, p2, k3))
    check_lens(interior, where)
    return interior


def check_lens(interior: Interior, where: str) -> None:
    """Raise BimVerifyError when size and focal length cannot be those of a lens, or when the distortion folds within the image,
    so that it cannot be taken out."""
    _check_size(interior.width, interior.height, interior.fx, interior.fy, where)
    w, h = interior.width - 1.0, interior.height - 1.0
    rim = np.array([[x * w, y * h] for x in (0.0, 0.25, 0.5, 0.75, 1.0) for y in (0.0, 0.5, 1.0)])
    with np.errstate(over="ignore", invalid="ignore"):
        back = interior.distort(interior.undistort(rim))
    if not np.isfinite(back).all() or np.abs(back - rim).max() > 0.01:
        raise BimVerifyError(f"{where}: the lens distortion cannot be inverted within the image; check its coefficients.")


def _check_size(width: float, height: float, fx: float, fy: float, where: str) -> None:
    if not (1 <= width <= LARGEST_SIDE_PX and 1 <= height <= LARGEST_SIDE_PX and width % 1 == 0 and height % 1 == 0):
        raise BimVerifyError(f"{where}: width and height must be whole pixels, 1 to {LARGEST_SIDE_PX}.")
    for f in (fx, fy):
        if not 0.05 * width < f < 1000 * width:
            raise BimVerifyError(f"{where}: a focal length of {f:g} pixels does not go with an image {width:g} pixels wide.")


def _known(
    entry: Any, index: int, content: dict[str, Any], shared: dict[str, Any], source: Path, position: float, rotation: float
) -> KnownCamera:
    where = f"Camera {index + 1} of {source.name}"
    if not isinstance(entry, dict):
        raise BimVerifyError(f"{where} is not an object with an image, an interior and a pose.")
    name = entry.get("image") or entry.get("name")
    if not isinstance(name, str) or not name or len(name) > 1000:
        raise BimVerifyError(f"{where} names no image.")
    where = f"{where} ({name[:80]!r})"
    inside = entry.get("interior", content.get("interior", next(iter(shared.values())) if len(shared) == 1 else None))
    if isinstance(inside, str):
        if inside not in shared:
            raise BimVerifyError(f"{where} names the interior {inside[:80]!r}, which the file does not hold.")
        inside = shared[inside]
    camera = Camera(name, read_interior(inside, where), _rotation(entry, where), _position(entry, where))
    sigma = {
        key: positive(entry if key in entry else content, key, where, default)
        for key, default in (("position_sigma_m", position), ("rotation_sigma_deg", math.degrees(rotation)))
    }
    for key, value in sigma.items():
        if not LEAST_SIGMA <= value <= LARGEST_SIGMA:
            raise BimVerifyError(f"{where}: {key} must lie between {LEAST_SIGMA:g} and {LARGEST_SIGMA:g}, not {value:g}.")
    return KnownCamera(camera, sigma["position_sigma_m"], math.radians(sigma["rotation_sigma_deg"]))


def _position(entry: dict[str, Any], where: str) -> Vector:
    position = numbers(entry.get("position"), (3,))
    if position is None or np.abs(position).max() > FARTHEST_COORDINATE_M:
        raise BimVerifyError(f"{where} has no position [x, y, z] in metres.")
    return position


def _rotation(entry: dict[str, Any], where: str) -> Vector:
    """World to camera (x right, y down, z forward)."""
    if "rotation" in entry:
        turn = numbers(entry["rotation"], (3, 3))
        if turn is None:
            raise BimVerifyError(f"{where} has a rotation that is no 3 x 3 rotation matrix.")
        return proper_rotation(turn, where)
    if "omega_phi_kappa_deg" in entry:
        angles = numbers(entry["omega_phi_kappa_deg"], (3,))
        if angles is None:
            raise BimVerifyError(f"{where}: omega_phi_kappa_deg must be three angles in degrees.")
        omega, phi, kappa = np.radians(angles)
        return from_omega_phi_kappa(float(omega), float(phi), float(kappa))
    if "quaternion_wxyz" in entry:
        q = numbers(entry["quaternion_wxyz"], (4,))
        if q is None or not 0.5 < np.linalg.norm(q) < 2.0:
            raise BimVerifyError(f"{where}: quaternion_wxyz must be four numbers, of length one.")
        return rotation_of_quaternion(q)
    raise BimVerifyError(f"{where} has no direction; give rotation, omega_phi_kappa_deg or quaternion_wxyz.")


def proper_rotation(turn: Vector, where: str) -> Vector:
    """The rotation nearest to a matrix (3, 3) that is one but for rounding. Raises BimVerifyError where it is none."""
    if not np.isfinite(turn).all() or np.abs(turn @ turn.T - np.eye(3)).max() > ROUNDING or np.linalg.det(turn) < 0:
        raise BimVerifyError(f"{where} has a rotation that is no 3 x 3 rotation matrix.")
    left, _, right = np.linalg.svd(turn)
    return np.asarray(left @ right)


def rotation_of_quaternion(wxyz: Vector) -> Vector:
    """Rotation (3, 3) of a quaternion (4,), normalised first."""
    from scipy.spatial.transform import Rotation

    w, x, y, z = np.asarray(wxyz, dtype=np.float64)
    return np.asarray(Rotation.from_quat([x, y, z, w]).as_matrix())


def numbers(value: Any, shape: tuple[int, ...]) -> Vector | None:
    """The value as an array of that shape, or None if it is not one of finite numbers."""
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        return None
    return array if array.shape == shape and np.isfinite(array).all() else None


def number(entry: dict[str, Any], key: str, where: str) -> float:
    """A finite number of an object; BimVerifyError if it is none."""
    value = entry.get(key)
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not abs(value) <= LARGEST_NUMBER:
        raise BimVerifyError(f"{where}: {key} must be a number, not {str(value)[:40]!r}.")
    return float(value)


def positive(entry: dict[str, Any], key: str, where: str, default: float) -> float:
    """A number larger than zero, or the default where it is not given."""
    if key not in entry:
        return default
    value = number(entry, key, where)
    if value <= 0:
        raise BimVerifyError(f"{where}: {key} must be larger than zero.")
    return value


def shifted(known: KnownCamera, origin: Vector) -> KnownCamera:
    """The same camera with its position counted from ``origin`` (3,) [m]."""
    return replace(known, camera=replace(known.camera, position=known.camera.position - origin))


def turned(camera: Camera, like: Camera) -> float:
    """Angle [rad] between two cameras' directions, all axes."""
    return float(np.linalg.norm(rotation_vector(camera.rotation @ like.rotation.T)))
