"""Groups of new and gone voxels, and whether they last: told from voxels of made-up epochs."""

from __future__ import annotations

import numpy as np
import pytest

from bim_verify.core.change.clusters import Kind, find_clusters, persistence
from bim_verify.core.change.holders import Further
from bim_verify.core.change.results import Cluster, State
from bim_verify.core.change.voxels import Universe, compare, voxel_cloud
from bim_verify.core.occupancy.bricks import BrickTable
from bim_verify.core.occupancy.epoch import EMPTY, OCCUPIED, UNSEEN, Observation
from bim_verify.core.occupancy.grid import CELLS, VoxelGrid, keys_of, voxel_index

from .verify_data import house

MODEL = house()
GRID = VoxelGrid.for_model(MODEL.origin, 0.05)
SPACE = np.stack(np.meshgrid(*[np.arange(60, 92)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
TABLE = BrickTable(np.unique(keys_of(SPACE)[0]))
SHAPE = (len(TABLE), CELLS)
HERE = voxel_index(np.repeat(TABLE.keys, CELLS), np.tile(np.arange(CELLS), len(TABLE))).reshape(*SHAPE, 3)


def cube(corner: int) -> np.ndarray:
    """(B, 512) the voxels of a cube of 4 x 4 x 4."""
    return ((corner <= HERE) & (corner + 4 > HERE)).all(axis=-1)


def epoch(*cubes: np.ndarray, blind: np.ndarray | None = None) -> Observation:
    state = np.full(SHAPE, EMPTY, np.uint8)
    for there in cubes:
        state[there] = OCCUPIED
    if blind is not None:
        state[blind] = UNSEEN
    return Observation(TABLE, state)


def clusters(
    *epochs: Observation, reference: Observation | None = None, planned: np.ndarray | None = None, most: int = 100,
    element: np.ndarray | None = None, states: dict[int, State] | None = None,
) -> tuple[tuple[Cluster, ...], int]:
    """``element`` (B, 512): whose the voxels are, if more than the ``planned`` ones of the first element."""
    planned = np.zeros(SHAPE, np.bool_) if planned is None else planned
    element = np.where(planned, 0, -1) if element is None else element
    none, element = Further.of([], TABLE, np.int16), element.astype(np.int16)
    of = [(states or {}).get(row, "CONFIRMED") for row in range(len(MODEL.elements))]
    world = Universe(GRID, TABLE, element, none, planned, np.ones(SHAPE, np.bool_))
    nothing, everything = np.zeros(SHAPE, np.bool_), np.ones(SHAPE, np.bool_)
    cloud = voxel_cloud(world, compare(world, epochs[-1], reference), everything, nothing)
    held = np.full(len(of), 0.05**3)
    return find_clusters(MODEL, world, cloud, of, held, [(f"epoch {n + 1}", e) for n, e in enumerate(epochs)], reference, most)


THING, OTHER = cube(64), cube(80)
NONE, WITH = epoch(), epoch(THING)
BLIND = epoch(blind=THING)


@pytest.mark.parametrize("reference", [None, NONE])
@pytest.mark.parametrize(
    ("epochs", "lasts", "seen"),
    [
        ((WITH,), "unknown", ("epoch 1",)),
        ((WITH, WITH), "stays", ("epoch 1", "epoch 2")),
        ((NONE, WITH, WITH), "stays", ("epoch 2", "epoch 3")),
        ((BLIND, WITH), "unknown", ("epoch 2",)),
        ((WITH, BLIND, WITH), "stays", ("epoch 1", "epoch 3")),
        ((NONE, WITH), "unknown", ("epoch 2",)),
        ((WITH, NONE, WITH), "temporary", ("epoch 1", "epoch 3")),
        ((WITH, NONE), "temporary", ("epoch 1",)),
        ((WITH, NONE, NONE), "temporary", ("epoch 1",)),
    ],
)
def test_new_things_last_or_not_whatever_the_reference(
    epochs: tuple[Observation, ...], lasts: str, seen: tuple[str, ...], reference: Observation | None
) -> None:
    (found,), left_out = clusters(*epochs, reference=reference)
    assert found.kind == ("NEW" if epochs[-1] is WITH else "DISAPPEARED")
    assert (found.persistence, found.epochs, found.voxels, left_out) == (lasts, seen, 64, 0)
    assert found.size == pytest.approx((0.2, 0.2, 0.2)) and not found.inside
    assert found.center == pytest.approx(tuple(GRID.centers(np.array([64, 64, 64])) + 0.075))


def test_what_stood_in_the_reference_alone_is_temporary() -> None:
    (found,), _ = clusters(NONE, NONE, reference=WITH)
    assert (found.kind, found.persistence, found.epochs) == ("DISAPPEARED", "temporary", ("reference",))
    assert clusters(WITH, WITH, reference=WITH) == ((), 0)


@pytest.mark.parametrize(
    ("epochs", "lasts"),
    [((NONE,), "unknown"), ((WITH, NONE), "unknown"), ((WITH, NONE, NONE), "stays"), ((NONE, WITH, NONE), "temporary")],
)
def test_a_gap_in_what_is_planned(epochs: tuple[Observation, ...], lasts: str) -> None:
    (found,), _ = clusters(*epochs, planned=THING)
    assert (found.kind, found.inside, found.persistence) == ("DISAPPEARED", True, lasts)


def test_what_stood_where_nobody_looks_now_is_not_listed() -> None:
    assert clusters(WITH, BLIND) == ((), 0)


def test_each_thing_is_listed_with_the_epochs_that_saw_it() -> None:
    found, _ = clusters(epoch(THING, OTHER), epoch(OTHER), NONE, reference=WITH)
    assert [c.epochs for c in found] == [("reference", "epoch 1"), ("epoch 1", "epoch 2")]
    assert {c.persistence for c in found} == {"temporary"} and {c.kind for c in found} == {"DISAPPEARED"}


@pytest.mark.parametrize("kind", ["NEW", "DISAPPEARED"])
def test_one_epoch_says_nothing_of_what_lasts(kind: Kind) -> None:
    assert persistence(kind, True, [kind == "NEW"]) == "unknown"


def test_the_largest_are_listed_and_the_others_counted() -> None:
    corners = range(60, 80, 6)
    small = [cube(c) for c in corners]
    large = cube(84) | cube(85) | cube(86)
    found, left_out = clusters(epoch(*small, large), most=2)
    assert len(found) == 2 and left_out == len(corners) - 1
    assert [c.voxels for c in found] == sorted((c.voxels for c in found), reverse=True)
    all_of_them, none = clusters(epoch(*small, large))
    assert all_of_them[:2] == found and none == 0 and len(all_of_them) == 2 + left_out


SPECK = ((HERE == 72) | (HERE == 73)).all(axis=-1)
FIRST = np.where(THING | OTHER | SPECK, 0, -1)


@pytest.mark.parametrize(("state", "voxels"), [("PARTIAL", 128), ("CONFIRMED", 128), ("DISAPPEARED", 136)])
def test_what_is_gone_of_one_element_is_one_group_with_its_specks_only_if_all_of_it_is(state: State, voxels: int) -> None:
    (found,), _ = clusters(NONE, planned=FIRST >= 0, states={0: state})
    assert (found.kind, found.inside, found.voxels, found.element) == ("DISAPPEARED", True, voxels, MODEL.elements[0].global_id)
    assert found.volume == pytest.approx(voxels * 0.05**3) and found.size == pytest.approx((1.0, 1.0, 1.0))
    assert clusters(NONE, planned=SPECK, states={0: state}) == ((), 0)


def test_what_is_gone_of_two_elements_are_two_groups_though_they_touch() -> None:
    element = np.where(cube(68), 1, np.where(THING, 0, -1))
    found, _ = clusters(NONE, planned=element >= 0, element=element)
    assert sorted(c.element for c in found) == sorted(e.global_id for e in MODEL.elements[:2])
    assert [c.voxels for c in found] == [64, 64]


def test_what_touches_a_new_element_is_a_group_of_its_own() -> None:
    found, _ = clusters(epoch(THING, cube(68), OTHER), reference=NONE, planned=FIRST >= 0, states={0: "NEW"})
    assert [(c.kind, c.inside, c.voxels) for c in found] == [("NEW", True, 128), ("NEW", False, 64)]


@pytest.mark.parametrize("state, groups", [("NEW", [(True, 128)]), ("CONFIRMED", [(True, 64), (False, 64)])])
def test_what_is_new_beside_a_face_is_of_an_element_that_is_new(state: State, groups: list[tuple[bool, int]]) -> None:
    element = np.where(THING | cube(68), 0, -1)
    found, _ = clusters(epoch(THING, cube(68)), reference=NONE, planned=THING, element=element, states={0: state})
    assert sorted((c.inside, c.voxels) for c in found) == sorted(groups)
    volumes = [c.volume for c in found]
    assert volumes == pytest.approx([64 * 0.05**3] * len(found)), "what lies beside the solid is no volume of it"
