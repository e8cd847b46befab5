"""Photogrammetric input of a verification: whose errors are shared, how exact a usual point is, and the dense points."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import BimVerifyError
from ..imagery.block_points import BlockPoints
from ..scans.campaign import ScanSource, Station
from ..scans.open import open_scans
from ..sensing.presets import PRESETS
from .collect import PhotoCampaign
from .dense_points import DensePoints, TieAccuracy

Array = NDArray[np.float64]


def photo_campaign(stations: Sequence[Station], blocks: Sequence[BlockPoints], sigma: float) -> PhotoCampaign | None:
    """None without photos. ``sigma`` [m] of a scan's return; where there are photos only, that of a usual tie point counts."""
    if not any(s.block for s in stations):
        return None
    first: dict[str, int] = {}
    body = [first.setdefault(s.block, k) if s.block else k for k, s in enumerate(stations)]
    body.append(min(first.values()))
    if blocks and all(s.block for s in stations):
        sigma = float(np.median(np.concatenate([b.sigma for b in blocks])))
    return PhotoCampaign(np.array(body, dtype=np.int64), sigma)


def shared_sigma(blocks: Sequence[BlockPoints]) -> float:
    """What the tie points of the blocks share with their neighbours, root mean square, metres; zero without blocks."""
    return float(np.sqrt(np.mean(np.concatenate([b.shared_sigma**2 for b in blocks])))) if blocks else 0.0


def place_sigma(blocks: Sequence[BlockPoints]) -> float:
    """Of the least certain place of a block that no control and no model fixes, metres; zero where all are fixed."""
    return max((b.place_sigma for b in blocks), default=0.0)


def scale_sigma(blocks: Sequence[BlockPoints]) -> float:
    """Of the least certain scale of a block that no control and no model fixes, as a share of any length: what its cameras'
    positions leave open if their errors are independent. Zero where all are fixed."""
    return max((b.scale_sigma for b in blocks), default=0.0)


def adjusted_freely(place: float, stated: float | None = None) -> str:
    """What a block that nothing fixes means, and what to do, without a full stop; ``place`` [m] counts for it, or what was
    ``stated`` [m]."""
    counted = f"{1000 * place:.0f} mm, as its cameras' positions, are counted for that"
    if stated is not None:
        counted = f"{1000 * stated:.1f} mm are counted for that, as you stated"
    return (
        f"A block of photos has no control points and was adjusted freely, so it stands and is scaled as its cameras were "
        f"given: {counted}. Give control points, tie it to the model (bundle --edges)"
    )


def read_dense(
    paths: Sequence[str | Path], transform: Array, origin: Array, blocks: Sequence[BlockPoints], photo: PhotoCampaign | None,
    preset: str, memory_gb: float,
) -> DensePoints:
    """Dense points of files, in the model's local frame (``transform`` (4, 4) to the model's, less ``origin`` (3,)).

    Raises BimVerifyError when a file cannot be used, or when no tie points say how exact they are.
    """
    if photo is None or not blocks:
        raise BimVerifyError(
            "Dense points need the adjusted project that they were made with among the scans: its tie points say how exact "
            "they are."
        )
    turn, shift = transform[:3, :3], transform[:3, 3] - origin
    points, normals = [], []
    for path in paths:
        source: ScanSource = open_scans([path])
        for block in source.blocks(attributes=True):
            points.append((block.offsets + source.stations[block.station].position) @ turn.T + shift)
            normals.append(None if block.normal is None else block.normal @ turn.T.astype(np.float32))
    given = [n for n in normals if n is not None]
    normal = None
    if len(given) == len(normals):
        normal = np.concatenate(given)
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-6)
    ties = np.concatenate([b.points for b in blocks]) @ turn.T + shift
    covariance = np.concatenate([b.covariance for b in blocks])
    accuracy = TieAccuracy.of(ties, np.einsum("ij,pjk,lk->pil", turn, covariance, turn))
    fixed = PRESETS.get({"tie-points": "dense-points", "tie-points-fine": "dense-points-fine"}.get(preset, preset))
    return DensePoints(
        np.concatenate(points), normal, accuracy, int(photo.body[-1]), photo.sigma,
        fixed if preset != "derived" else None, memory_gb,
    )
