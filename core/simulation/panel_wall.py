"""A retaining wall of facing panels, built in code and moved panel by panel, for scans with known truth.

Wall frame: x along the wall, y out of its face (towards the scanner), z up; metres. Joints are open to a backing behind
the panels, and panel edges are chamfered as precast ones are.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from .scene import Scene, Unevenness

Array = NDArray[np.float64]
Relief = Literal["plain", "ridges", "bricks"]

RIDGE_PITCH_M, RIDGE_DEPTH_M = 0.15, 0.008
COURSE_M, COURSE_GROOVE_M, COURSE_DEPTH_M = 0.15, 0.012, 0.006


@dataclass(frozen=True)
class WallDesign:
    """What the wall is made of. Lengths in metres."""

    columns: int = 3
    rows: int = 4
    panel_width: float = 1.5
    panel_height: float = 1.5
    joint: float = 0.020
    """Opening between the panels' side faces."""
    chamfer: float = 0.020
    """Of the panels' edges, at 45 degrees; 0 for sharp edges."""
    thickness: float = 0.14
    relief: Relief = "ridges"
    backing: bool = True
    """Whether something stands behind the joints; else beams go through them and do not come back."""

    def lower_edge(self, row: int) -> float:
        """Height of a panel's lower side face."""
        return row * (self.panel_height + self.joint)

    def joint_height(self, row: int) -> float:
        """Height of the middle of the joint above panel ``row``."""
        return self.lower_edge(row + 1) - self.joint / 2

    def left_edge(self, column: int) -> float:
        """Where a panel's left side face stands; the wall's middle is x = 0."""
        return (column - self.columns / 2) * (self.panel_width + self.joint) + self.joint / 2


@dataclass(frozen=True)
class PanelMove:
    """Rigid movement of one panel across the wall: turned about the x axis through its lower front edge, then shifted."""

    lateral: float = 0.0
    """Metres out of the face."""
    vertical: float = 0.0
    """Metres, up positive; a settlement is negative."""
    tilt: float = 0.0
    """Radians; positive leans the panel's top outward."""

    def apply(self, points: Array, pivot_z: float) -> Array:
        """(N, 3) points of the panel as built, moved."""
        c, s = math.cos(self.tilt), math.sin(self.tilt)
        y, z = points[:, 1], points[:, 2] - pivot_z
        return np.column_stack([points[:, 0], c * y + s * z + self.lateral, -s * y + c * z + pivot_z + self.vertical])


STILL = PanelMove()


def uniform(design: WallDesign, *, lateral: float = 0.0, vertical: float = 0.0) -> list[PanelMove]:
    """All panels of a column move alike."""
    return [PanelMove(lateral, vertical)] * design.rows


def leaning(design: WallDesign, tilts: Sequence[float]) -> list[PanelMove]:
    """Each panel turned by its own angle [rad] and standing on the one below: a chain that bends the column."""
    moves, pivot_y, pivot_z = [], 0.0, 0.0
    for row, tilt in enumerate(tilts):
        moves.append(PanelMove(pivot_y, pivot_z - design.lower_edge(row), tilt))
        step = design.panel_height + design.joint
        pivot_y, pivot_z = pivot_y + step * math.sin(tilt), pivot_z + step * math.cos(tilt)
    return moves


def joint_shift(design: WallDesign, moves: Sequence[PanelMove], row: int) -> Array:
    """(2,) true lateral and vertical movement [m] of the joint above panel ``row``: the mean of its two edges."""
    upper, lower = design.lower_edge(row + 1), design.lower_edge(row) + design.panel_height
    edges = ((lower, moves[row], design.lower_edge(row)), (upper, moves[row + 1], upper))
    shifts = []
    for height, move, pivot in edges:
        point = np.array([[0.0, 0.0, height]])
        shifts.append((move.apply(point, pivot) - point)[0, 1:])
    return np.mean(shifts, axis=0)


def build_wall(
    design: WallDesign,
    moves: dict[int, Sequence[PanelMove]] | None = None,
    *,
    present: dict[int, int] | None = None,
    filled: Sequence[tuple[int, int]] = (),
    unevenness: Unevenness | None = None,
    surroundings: bool = True,
) -> Scene:
    """The wall as a scene. ``moves``: column -> movements by row; ``present``: column -> panels that stand (default all).

    ``filled``: (column, row) of joints that are closed flush with the panels (a repair), above panel ``row``.
    """
    moves, present = moves or {}, present or {}
    parts: list[Array] = []
    names: list[str] = []
    owners: list[NDArray[np.int32]] = []

    def add(corners: Array, name: str) -> None:
        owners.append(np.full(len(corners), len(names), np.int32))
        parts.append(corners)
        names.append(name)

    for column in range(design.columns):
        standing = present.get(column, design.rows)
        for row in range(standing):
            move = moves.get(column, [STILL] * design.rows)[row]
            base = _panel(design) + np.array([design.left_edge(column), 0.0, design.lower_edge(row)])
            moved = move.apply(base.reshape(-1, 3), design.lower_edge(row)).reshape(-1, 3, 3)
            add(moved, f"panel {column}/{row}")
            if (column, row) in filled and row + 1 < standing:
                add(_filling(design, column, row, move), f"filling {column}/{row}")
        if design.backing:
            add(_backing(design, column, moves.get(column), standing), f"backing {column}")
    if surroundings:
        half = design.columns * (design.panel_width + design.joint) / 2 + 3.0
        add(_quad((-half, 0.4, -0.02), (half, 0.4, -0.02), (half, 40.0, -0.02), (-half, 40.0, -0.02)), "ground")
    reflectance = np.full(len(names), 0.4)
    return Scene(np.concatenate(parts), np.concatenate(owners), names, reflectance=reflectance, unevenness=unevenness)


def _panel(design: WallDesign) -> Array:
    """(T, 3, 3) a panel with its lower left front corner (before chamfering) at the origin."""
    w, h, c = design.panel_width, design.panel_height, design.chamfer
    xs = _knots(w, c, RIDGE_PITCH_M if design.relief == "ridges" else 0.0, RIDGE_PITCH_M / 3)
    zs = _knots(h, c, COURSE_M if design.relief == "bricks" else 0.0, COURSE_GROOVE_M)
    x, z = np.meshgrid(xs, zs, indexing="ij")
    edge = np.minimum.reduce([x, w - x, z, h - z])
    y = -np.maximum(c - edge, 0.0)
    if design.relief == "ridges":
        y = np.minimum(y, np.where(edge >= c, -RIDGE_DEPTH_M * _in_groove(x, w, c, RIDGE_PITCH_M, RIDGE_PITCH_M / 3), 0.0))
    if design.relief == "bricks":
        y = np.minimum(y, np.where(edge >= c, -COURSE_DEPTH_M * _in_groove(z, h, c, COURSE_M, COURSE_GROOVE_M), 0.0))
    grid = np.stack([x, y, z], axis=-1)
    a, b, d, e = grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]
    front = np.concatenate([np.stack([a, b, d], axis=2), np.stack([a, d, e], axis=2)]).reshape(-1, 3, 3)
    rim = [grid[:, 0], grid[-1, :], grid[::-1, -1], grid[0, ::-1]]
    sides = []
    for line in rim:
        back = line.copy()
        back[:, 1] = -design.thickness
        sides += [np.stack([line[:-1], back[:-1], line[1:]], axis=1), np.stack([line[1:], back[:-1], back[1:]], axis=1)]
    return np.concatenate([front, *sides])


def _knots(length: float, chamfer: float, pitch: float, groove: float) -> Array:
    knots = [0.0, chamfer, length - chamfer, length]
    if pitch:
        for middle in _grooves(length, chamfer, pitch):
            knots += [middle - groove / 2 - 0.003, middle - groove / 2, middle + groove / 2, middle + groove / 2 + 0.003]
    return np.unique(np.round([k for k in knots if 0 <= k <= length], 6))


def _grooves(length: float, chamfer: float, pitch: float) -> Array:
    """Middles of the grooves that a panel's face has between its chamfers."""
    count = int((length - 2 * chamfer) / pitch)
    return np.asarray(length / 2 + (np.arange(count) - (count - 1) / 2) * pitch)


def _in_groove(at: Array, length: float, chamfer: float, pitch: float, groove: float) -> Array:
    away = np.abs(at[..., None] - _grooves(length, chamfer, pitch)).min(axis=-1)
    return (away <= groove / 2 + 1e-6).astype(np.float64)


def _filling(design: WallDesign, column: int, row: int, move: PanelMove) -> Array:
    x = design.left_edge(column)
    low = design.lower_edge(row) + design.panel_height - design.chamfer
    high = design.lower_edge(row + 1) + design.chamfer
    quad = _quad((x, 0.0, low), (x + design.panel_width, 0.0, low), (x + design.panel_width, 0.0, high), (x, 0.0, high))
    return move.apply(quad.reshape(-1, 3), design.lower_edge(row)).reshape(-1, 3, 3)


def _backing(design: WallDesign, column: int, moves: Sequence[PanelMove] | None, standing: int) -> Array:
    """What closes the joints at the back: it follows the panels, as the fabric behind them does."""
    x0 = design.left_edge(column) - design.joint
    x1 = x0 + design.panel_width + 2 * design.joint
    strips = []
    for row in range(standing):
        move = moves[row] if moves else STILL
        low, high = design.lower_edge(row) - design.joint, design.lower_edge(row) + design.panel_height + design.joint
        back = -design.thickness
        quad = _quad((x0, back, low), (x1, back, low), (x1, back, high), (x0, back, high))
        strips.append(move.apply(quad.reshape(-1, 3), design.lower_edge(row)).reshape(-1, 3, 3))
    return np.concatenate(strips)


def _quad(a: Sequence[float], b: Sequence[float], c: Sequence[float], d: Sequence[float]) -> Array:
    return np.array([[a, b, c], [a, c, d]], dtype=np.float64)
