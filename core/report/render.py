"""A small software renderer: the coloured model from given viewpoints, by ray casting, without any window or GPU."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ..model.elements import BuildingModel
from ..model.raycast import RayScene
from ..model.samples import SurfaceSamples
from .camera import Camera
from .palette import UNMEASURED, from_linear, to_bytes, to_linear
from .section import cut_mask

SUPERSAMPLE = 2
"""Rays across one pixel, in each direction."""
MIDDLE = slice(SUPERSAMPLE // 2, None, SUPERSAMPLE)
"""The ray of each pixel at which everything but the edges is computed."""
OCCLUSION_RAYS = 8
"""Rays per pixel that look for nearby surfaces."""
CUT_LIGHT = np.float32(0.16)
"""Light of solids on the cutting plane: dark, as an architect's section shows them."""
STRIP_RAYS = 3_000_000
"""Rays cast at once: what bounds the memory."""
CREASE_COS = 0.9
"""Two faces of one element meet in a drawn edge when their normals differ by more than 26 degrees."""
SAMPLE_LIFT_M = 0.04
"""Samples are looked up lifted along their normal, so that the two faces of a thin wall keep their own."""
ELEMENT_APART_M = 1e4
"""Samples of different elements are kept this far apart in the look-up, so that none borrows from its neighbour."""
SRGB_OF_LINEAR: NDArray[np.uint8] = to_bytes(from_linear(np.linspace(0.0, 1.0, 8192)))
"""sRGB 0..255 for 8192 steps of linear light."""


@dataclass(frozen=True)
class View:
    """What a camera sees, before any colour. S = supersampling; image rows and columns are H * S and W * S."""

    size: tuple[int, int]
    """(W, H) pixels."""
    camera: Camera
    triangle: NDArray[np.int32]
    """(H*S, W*S) rows of ``model.triangles``; -1 where nothing is."""
    element: NDArray[np.int32]
    """(H*S, W*S) rows of ``model.elements``; -1 where nothing is."""
    cut: NDArray[np.bool_]
    """(H*S, W*S) the cutting plane goes through a solid here."""
    position: NDArray[np.float32]
    """(H, W, 3) seen point at the pixel's middle, local frame."""
    light: NDArray[np.float32]
    """(H, W) share of the light that reaches the pixel's surface, 0..1."""
    ground: NDArray[np.float32]
    """(H, W) opacity of the shadow on the ground, 0 where the model itself is seen."""
    line: NDArray[np.float32]
    """(H*S, W*S) strength of the drawn edges, 0..1."""


def render_view(
    model: BuildingModel,
    camera: Camera,
    size: tuple[int, int] = (1280, 860),
    *,
    face_colors: NDArray[np.float64] | None = None,
    samples: SurfaceSamples | None = None,
    sample_colors: NDArray[np.float64] | None = None,
    background: tuple[float, float, float] | None = None,
    scene: RayScene | None = None,
) -> NDArray[np.uint8]:
    """Draw the model: ``face_colors`` (T, 3), or ``sample_colors`` (N, 3) of ``samples``; sRGB 0..1.

    Returns (H, W, 4) with a transparent background, or (H, W, 3) over ``background``.
    """
    view = trace_view(model, camera, size, scene=scene)
    if sample_colors is not None and samples is not None:
        pixels = SampleColors(samples).find(model, view).pixels(to_linear(sample_colors))
        return shade_view(view, pixels, background=background)
    if face_colors is None:
        raise ValueError("give face_colors, or samples with sample_colors")
    return shade_view(view, face_pixels(view, to_linear(face_colors)), background=background)


def trace_view(
    model: BuildingModel, camera: Camera, size: tuple[int, int], *, scene: RayScene | None = None
) -> View:
    """Cast all rays of a picture of ``size`` (width, height) pixels; the result can be coloured many times."""
    scene = scene or RayScene(model)
    width, height = size
    fine = (height * SUPERSAMPLE, width * SUPERSAMPLE)
    triangle = np.empty(fine, dtype=np.int32)
    distance = np.empty(fine, dtype=np.float32)
    rows = max(STRIP_RAYS // fine[1], 1)
    forward = np.tile(camera.forward.astype(np.float32), (rows * fine[1], 1))
    for begin in range(0, fine[0], rows):
        part = np.arange(begin, min(begin + rows, fine[0]))
        origin = _ray_origins(camera, size, part).reshape(-1, 3)
        distance_part, triangle_part = scene.first_hit(origin, forward[: len(origin)])
        distance[part] = distance_part.reshape(-1, fine[1])
        triangle[part] = triangle_part.reshape(-1, fine[1])
    element = np.where(triangle >= 0, model.triangle_element[triangle], np.int32(-1))
    inside = cut_mask(model, camera, (fine[1], fine[0]))
    cut = inside >= 0
    if cut.any():
        element[cut] = inside[cut]
        triangle[cut] = model.triangle_start[inside[cut]]
        distance[cut] = 0.0

    facing = scene.normal.astype(np.float32)
    facing[facing @ camera.forward.astype(np.float32) > 0] *= -1
    start = _ray_origins(camera, size, np.arange(SUPERSAMPLE // 2, fine[0], SUPERSAMPLE))[:, MIDDLE]
    seen = element[MIDDLE, MIDDLE] >= 0
    surface = seen & ~cut[MIDDLE, MIDDLE]
    along = np.where(seen, distance[MIDDLE, MIDDLE], np.float32(0.0))
    position = start + along[..., None] * camera.forward.astype(np.float32)
    light = _light(model, scene, camera, position, facing[triangle[MIDDLE, MIDDLE]], surface)
    ground = _ground_shadow(model, scene, camera, start, ~seen)
    line = _edges(facing, element, triangle, cut, distance, camera.width / fine[1])
    return View(size, camera, triangle, element, cut, position, light, ground, line)


def face_pixels(view: View, face_colors: NDArray[np.float64]) -> NDArray[np.float32]:
    """(T, 3) colours of the triangles, linear light, to (H*S, W*S, 3)."""
    return face_colors.astype(np.float32)[view.triangle]


class SampleColors:
    """Finds for every seen point the colour of the samples around it, of the same element and side."""

    def __init__(self, samples: SurfaceSamples) -> None:
        self._tree = cKDTree(
            _apart(samples.position + SAMPLE_LIFT_M * samples.normal, samples.element),
            balanced_tree=False, compact_nodes=False,
        )

    def find(self, model: BuildingModel, view: View, *, nearest: int = 4, threads: int = -1) -> SamplePixels:
        """Look up once, colour many times: the ``nearest`` samples of every pixel's middle, weighted by closeness."""
        element = view.element[MIDDLE, MIDDLE]
        seen = np.flatnonzero(element.ravel() >= 0)
        row = np.zeros((len(seen), nearest), dtype=np.int32)
        weight = np.zeros((len(seen), nearest), dtype=np.float32)
        for begin in range(0, len(seen), 250_000):
            part = slice(begin, begin + 250_000)
            at = seen[part]
            corner = model.vertices[model.triangles[view.triangle[MIDDLE, MIDDLE].ravel()[at]]]
            normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
            normal /= np.linalg.norm(normal, axis=1, keepdims=True)
            key = _apart(view.position.reshape(-1, 3)[at] + SAMPLE_LIFT_M * normal, element.ravel()[at])
            distance, row[part] = self._tree.query(key, k=nearest, workers=threads)
            weight[part] = 1.0 / np.maximum(distance, 1e-4) ** 2
        weight /= np.maximum(weight.sum(axis=1, keepdims=True), np.float32(1e-12))
        return SamplePixels(view, seen, np.minimum(row, self._tree.n - 1), weight)


@dataclass(frozen=True)
class SamplePixels:
    """Which samples colour which pixel of a view."""

    view: View
    pixel: NDArray[np.int64]
    """(P,) flat indices of the pixels that see something."""
    row: NDArray[np.int32]
    """(P, K) rows of the samples."""
    weight: NDArray[np.float32]
    """(P, K) adding up to 1."""

    def pixels(self, sample_colors: NDArray[np.floating]) -> NDArray[np.float32]:
        """(N, 3) colours of the samples, linear light, to (H*S, W*S, 3)."""
        linear = sample_colors.astype(np.float32)
        width, height = self.view.size
        color = np.zeros((height * width, 3), dtype=np.float32)
        for k in range(self.row.shape[1]):
            color[self.pixel] += self.weight[:, [k]] * linear[self.row[:, k]]
        pixels = _grow(color.reshape(height, width, 3), self.view.element[MIDDLE, MIDDLE], self.view.element)
        pixels[self.view.cut] = to_linear(UNMEASURED)
        return pixels


def shade_view(
    view: View, pixels: NDArray[np.float32], *, background: tuple[float, float, float] | None = None
) -> NDArray[np.uint8]:
    """Light, edges and anti-aliasing over the colours ``pixels`` (H*S, W*S, 3), linear light.

    Returns (H, W, 4) with a transparent background, or (H, W, 3) over ``background`` (sRGB 0..1).
    """
    width, height = view.size
    light = np.repeat(np.repeat(view.light, SUPERSAMPLE, axis=0), SUPERSAMPLE, axis=1)
    light[view.cut] = CUT_LIGHT
    alpha = (view.element >= 0).astype(np.float32)
    light *= (1.0 - view.line) * alpha
    premultiplied = np.zeros((height, width, 3), dtype=np.float32)
    opacity = np.zeros((height, width), dtype=np.float32)
    for dy in range(SUPERSAMPLE):
        for dx in range(SUPERSAMPLE):
            here = np.s_[dy::SUPERSAMPLE, dx::SUPERSAMPLE]
            premultiplied += pixels[here] * light[here][..., None]
            opacity += alpha[here]
    premultiplied /= SUPERSAMPLE**2
    opacity /= SUPERSAMPLE**2
    if background is not None:
        behind = to_linear(background).astype(np.float32) * (1.0 - view.ground)[..., None]
        return _bytes(premultiplied + (1.0 - opacity)[..., None] * behind)
    shadow = view.ground * (1.0 - opacity)
    total = opacity + shadow
    straight = premultiplied / np.maximum(total, np.float32(1e-6))[..., None]
    return np.concatenate([_bytes(straight), np.rint(total * 255).astype(np.uint8)[..., None]], axis=-1)


def _ray_origins(camera: Camera, size: tuple[int, int], rows: NDArray[np.int64]) -> NDArray[np.float32]:
    """Starts (R, W*S, 3) of the rays of R rows of the supersampled picture; on the cutting plane if there is one."""
    width, height = size
    step = camera.width / (width * SUPERSAMPLE)
    u = (np.arange(width * SUPERSAMPLE) + 0.5) * step - camera.width / 2
    v = height * SUPERSAMPLE * step / 2 - (rows + 0.5) * step
    start = camera.center - camera.reach * camera.forward
    left = start + v[:, None] * camera.up
    if camera.cut_z is not None and camera.forward[2] < -1e-6:
        left += np.maximum((camera.cut_z - left[:, 2:]) / camera.forward[2], 0.0) * camera.forward
    across = u[:, None] * camera.right
    return left.astype(np.float32)[:, None, :] + across.astype(np.float32)[None, :, :]


def _light(
    model: BuildingModel,
    scene: RayScene,
    camera: Camera,
    position: NDArray[np.float32],
    normal: NDArray[np.float32],
    surface: NDArray[np.bool_],
) -> NDArray[np.float32]:
    """Share of light (H, W): a lamp at the viewer's upper left, a sky, and less of both in corners."""
    lamp = camera.right * -0.45 + camera.up * 0.75 - camera.forward * 0.75
    lamp /= np.linalg.norm(lamp)
    free = np.ones(surface.shape, dtype=np.float32)
    free[surface] = _open_share(scene, camera, position[surface], normal[surface], _shadow_radius(model), surface)
    free = _smooth(free, position, normal, surface, camera.width / surface.shape[1])
    slope = np.clip(normal @ lamp.astype(np.float32), 0.0, 1.0)
    sky = 0.5 + 0.5 * normal[..., 2]
    light = (0.30 + 0.16 * sky) * (0.25 + 0.75 * free) + 0.62 * slope * (0.45 + 0.55 * free)
    return np.minimum(light, np.float32(1.0)).astype(np.float32)


def _ground_shadow(
    model: BuildingModel, scene: RayScene, camera: Camera, start: NDArray[np.float32], empty: NDArray[np.bool_]
) -> NDArray[np.float32]:
    """Opacity (H, W) of the shadow that the model throws on the level below it; none under a cut model."""
    shadow = np.zeros(empty.shape, dtype=np.float32)
    if camera.forward[2] > -0.05 or camera.cut_z is not None:
        return shadow
    low, high = model.bounds
    radius = _shadow_radius(model)
    down = (low[2] - start[..., 2]) / np.float32(camera.forward[2])
    foot = (start + down[..., None] * camera.forward.astype(np.float32)).astype(np.float32)
    near = empty.copy()
    for axis in (0, 1):
        near &= (foot[..., axis] > low[axis] - radius) & (foot[..., axis] < high[axis] + radius)
    up = np.zeros_like(foot)
    up[..., 2] = 1.0
    shadow[near] = 1.0 - _open_share(scene, camera, foot[near], up[near], radius, near)
    return np.float32(0.55) * _smooth(shadow, foot, up, near, 1.0)


def _shadow_radius(model: BuildingModel) -> float:
    """How far away a surface still takes light, metres."""
    low, high = model.bounds
    return float(np.clip(0.12 * np.linalg.norm(high - low), 0.2, 3.0))


def _open_share(
    scene: RayScene,
    camera: Camera,
    position: NDArray[np.float32],
    normal: NDArray[np.float32],
    radius: float,
    mask: NDArray[np.bool_],
) -> NDArray[np.float32]:
    """Share of the half-sphere over each position (N,) that is free within ``radius`` metres.

    The directions turn with the pixel in a 4 x 4 pattern, which ``_smooth`` averages out.
    """
    row, column = np.nonzero(mask)
    phase = (row % 4) * 4 + column % 4
    axes = np.eye(3, dtype=np.float32)
    helper = np.where(np.abs(normal[:, [2]]) < 0.9, axes[2], axes[0])
    tangent = np.cross(normal, helper)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    second = np.cross(normal, tangent)
    origin = position + np.float32(1e-3) * normal
    free = np.zeros(len(position), dtype=np.float32)
    for k in range(OCCLUSION_RAYS):
        turn = 2 * np.pi * ((k * 0.61803398875 + np.arange(16) / 16.0) % 1.0)
        out = np.sqrt((k + 0.5) / OCCLUSION_RAYS)
        direction = (out * np.cos(turn)).astype(np.float32)[phase, None] * tangent
        direction += (out * np.sin(turn)).astype(np.float32)[phase, None] * second
        direction += np.float32(np.sqrt(1.0 - out**2)) * normal
        distance, triangle = scene.first_hit(origin, direction, radius)
        blocked = triangle >= 0
        if camera.cut_z is not None:
            blocked &= origin[:, 2] + np.where(blocked, distance, 0.0) * direction[:, 2] < camera.cut_z
        free += np.where(blocked, distance * np.float32(1.0 / radius), np.float32(1.0))
    return free / np.float32(OCCLUSION_RAYS)


@njit(cache=True, nogil=True)
def _smooth(
    values: NDArray[np.float32],
    position: NDArray[np.float32],
    normal: NDArray[np.float32],
    mask: NDArray[np.bool_],
    pixel: float,
) -> NDArray[np.float32]:
    """Mean over 5 x 5 pixels of the same smooth surface, ``pixel`` metres apart; only where ``mask`` is set."""
    height, width = values.shape
    out = values.copy()
    for y in range(height):
        for x in range(width):
            if not mask[y, x]:
                continue
            nx, ny, nz = normal[y, x]
            px, py, pz = position[y, x]
            total, count = 0.0, 0
            for j in range(max(0, y - 2), min(height, y + 3)):
                for i in range(max(0, x - 2), min(width, x + 3)):
                    if not mask[j, i]:
                        continue
                    if nx * normal[j, i, 0] + ny * normal[j, i, 1] + nz * normal[j, i, 2] < 0.95:
                        continue
                    step = nx * (position[j, i, 0] - px) + ny * (position[j, i, 1] - py) + nz * (position[j, i, 2] - pz)
                    if abs(step) < pixel:
                        total += values[j, i]
                        count += 1
            if count:
                out[y, x] = total / count
    return out


def _edges(
    normal: NDArray[np.float32],
    element: NDArray[np.int32],
    triangle: NDArray[np.int32],
    cut: NDArray[np.bool_],
    distance: NDArray[np.float32],
    pixel: float,
) -> NDArray[np.float32]:
    """Strength of drawn edges, 0..1: between elements, at creases, at steps in depth."""
    line = np.zeros(element.shape, dtype=np.float32)
    depth = np.where(np.isfinite(distance), distance, np.float32(1e6))
    for a, b in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
        other = (element[a] != element[b]) | (cut[a] != cut[b])
        crease = ~other & (triangle[a] != triangle[b]) & (element[a] >= 0)
        at = np.nonzero(crease)
        bend = np.einsum("ij,ij->i", normal[triangle[a][at]], normal[triangle[b][at]])
        step = np.abs(depth[a][at] - depth[b][at]) > 40 * pixel
        strength = np.where(other, np.float32(0.78), np.float32(0.0))
        strength[at] = np.where(step, 0.62, np.where(bend < CREASE_COS, 0.38, 0.0))
        line[a] = np.maximum(line[a], strength)
        line[b] = np.maximum(line[b], strength)
    return line


def _apart(position: NDArray[np.floating], element: NDArray[np.int32]) -> NDArray[np.float64]:
    apart = np.array(position, dtype=np.float64)
    apart[:, 0] += ELEMENT_APART_M * element
    return apart


def _grow(
    color: NDArray[np.float32], element: NDArray[np.int32], fine: NDArray[np.int32]
) -> NDArray[np.float32]:
    """Pixel colours to the supersampled picture; along edges each ray takes a neighbouring pixel of its own element."""
    grown = np.repeat(np.repeat(color, SUPERSAMPLE, axis=0), SUPERSAMPLE, axis=1)
    own = np.repeat(np.repeat(element, SUPERSAMPLE, axis=0), SUPERSAMPLE, axis=1)
    row, column = np.nonzero((own != fine) & (fine >= 0))
    open_ = np.ones(len(row), dtype=np.bool_)
    height, width = element.shape
    for dy, dx in ((0, 1), (0, -1), (1, 0), (-1, 0), (1, 1), (1, -1), (-1, 1), (-1, -1)):
        y = np.clip(row // SUPERSAMPLE + dy, 0, height - 1)
        x = np.clip(column // SUPERSAMPLE + dx, 0, width - 1)
        fits = open_ & (element[y, x] == fine[row, column])
        grown[row[fits], column[fits]] = color[y[fits], x[fits]]
        open_ &= ~fits
    return grown


def _bytes(linear: NDArray[np.floating]) -> NDArray[np.uint8]:
    """Linear light to sRGB 0..255."""
    c = np.rint(np.clip(linear, 0.0, 1.0) * (len(SRGB_OF_LINEAR) - 1)).astype(np.int32)
    return SRGB_OF_LINEAR[c]
