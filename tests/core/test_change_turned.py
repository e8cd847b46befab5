"""What stands in the place of something that is gone is not taken for it."""

from __future__ import annotations

import dataclasses
import math
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from bim_verify.core.change.look import _sight
from bim_verify.core.evidence.decide import Context, Place
from bim_verify.core.evidence.displacement import Shift
from bim_verify.core.evidence.left_place import PlannedPlaces
from bim_verify.core.evidence.own_evidence import OwnEvidence
from bim_verify.core.evidence.station_index import build_index
from bim_verify.core.evidence.thresholds import Thresholds
from bim_verify.core.evidence.turned_surface import AROUND_SPACINGS, _normals
from bim_verify.core.jobs import change
from bim_verify.core.options import ChangeOptions
from bim_verify.core.simulation.scene import Edit, Prop

from .verify_data import PLAN, REMOVED, SCANNER, STATIONS, built, house, scan

OPTIONS = ChangeOptions(voxel=0.04, sigma=0.0013, sample_spacing=0.05, memory_gb=1.0)
FINE = dataclasses.replace(SCANNER, angular_step=math.radians(0.4))
THROUGH_IT = Prop("crate", "box", (1.4, 0.9, 0.8), (1.0, 0.5, 1.6))
"""Its sides cut through the place of the plate."""
UPON_IT = Prop("crate", "box", (1.4, 0.9, 1.13), (0.6, 0.3, 0.4))


@pytest.mark.parametrize(
    "edits, prop, state", [({"plate": REMOVED}, THROUGH_IT, "DISAPPEARED"), ({}, UPON_IT, "CONFIRMED")],
    ids=["a crate in its place", "a crate upon it"],
)
def test_a_crate_is_not_taken_for_the_plate_in_whose_place_it_stands(edits: dict[str, Edit], prop: Prop, state: str) -> None:
    source = scan(built(edits, (prop,)), seed=5, scanner=FINE, stations=STATIONS[:3])
    plate = next(e for e in change(house(), [source], None, OPTIONS).elements if e.name == "plate")
    assert plate.state == state, plate.reason


SPACING_RAD = 0.004


def normals(surface: str, asked: tuple[float, float]) -> np.ndarray:
    """Around the return at (y, z) of the rays through x = 3 m that meet ``surface``."""
    y, z = (a.ravel() for a in np.meshgrid(*2 * (np.arange(-0.3, 0.3, 3.0 * SPACING_RAD),), indexing="ij"))
    reach = {"turned": 1.0 / (1.0 + y / 3.0), "corner": 1.0 + np.abs(y), "wire": np.where(np.abs(y) < 0.007, 1.0, 2.0)}[surface]
    points = reach[:, None] * np.column_stack([np.full(len(y), 3.0), y, z])
    points = points + np.random.default_rng(1).normal(0.0, 0.001, points.shape)
    index = build_index(points, SPACING_RAD)
    near = np.argmin(np.hypot(y - asked[0], z - asked[1]))
    return np.asarray(_normals(
        points[near][None], index.returns, index.bin_start, index.row_start, AROUND_SPACINGS * SPACING_RAD, 0.0025
    ))[0]


def test_the_returns_around_tell_how_a_surface_is_turned_unless_they_lie_on_no_plane() -> None:
    """The rays meet the plane x + y = 3 m, faces that meet at y = 0, and a wire with a wall far behind it."""
    assert normals("turned", (0.0, 0.0)) == pytest.approx(-np.array([1.0, 1.0, 0.0]) / math.sqrt(2.0), abs=0.1)
    assert np.isfinite(normals("corner", (0.2, 0.0))).all() and np.isnan(normals("corner", (0.0, 0.0))).all()
    assert np.isnan(normals("wire", (0.0, 0.0))).all()


@pytest.mark.parametrize("at, beyond, seen", [(0.19, 0.81, "GONE"), (0.9, 0.1, "STANDS")])
def test_a_place_that_voxels_do_not_tell_from_the_planned_one_is_judged_as_the_planned_one(
    at: float, beyond: float, seen: str
) -> None:
    """A slide may fit a pane that ends where a mullion was: it says nothing against the beams that pass the mullion's place."""
    row = list(PLAN).index("post")
    fit = Shift(np.array([0.003, 0.0, 0.0]), np.eye(3) * 1e-6, np.eye(3), np.eye(3)[:1], 0.001)
    plan = Place(np.zeros(3), at, beyond, 0.0, 2.0, 100, 250, (0,), fit)
    best = dataclasses.replace(plan, shift=np.array([0.15, 0.0, 0.0]), beyond=0.0, rays=300)
    area = np.zeros(len(PLAN))
    area[row] = 1.0
    own = OwnEvidence(
        at * area, 0 * area, beyond * area, 0 * area, (250 * at * area).astype(int), (250 * beyond * area).astype(int),
        *2 * ((0 * area).astype(int),),
    )
    context = cast(Context, SimpleNamespace(
        thresholds=Thresholds(), window=0.0275, loa=30, sigma=0.0025, registration_sigma=0.001
    ))
    found = _sight(house(), row, plan, best, 2.0, 0.0227, context, own, own, -1, cast(PlannedPlaces, cast(Any, None)))
    assert found.seen == seen, found.reason
