"""The fast path against a slow twin that looks at every return, and its independence of order, tiles and threads."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise

import numba
import numpy as np
import pytest
from numpy.typing import NDArray

from bim_verify.core.evidence.collect import Queries, StationIndexes, look
from bim_verify.core.evidence.fusion import dempster, from_log_commonality
from bim_verify.core.evidence.gather import (
    LEAST_COSINE,
    LEAST_RANGE_M,
    NEAR_CUT,
    SensorModel,
    StationEvidence,
    gather,
    mass_parameters,
)
from bim_verify.core.evidence.passed_beside import _nearest_return
from bim_verify.core.evidence.sightings import Sightings
from bim_verify.core.evidence.station_index import build_index, median_spacing, neighbour_angles, view_cone
from bim_verify.core.model.on_element import ElementSurfaces
from bim_verify.core.model.sample_surface import sample_surface
from bim_verify.core.progress import Progress
from bim_verify.core.scans.store import ReturnStore
from bim_verify.core.sensing.presets import PRESETS, MassParameters
from bim_verify.core.simulation.box_building import ArraySource, building_model, four_rooms, scan

Array = NDArray[np.float64]

STEP = math.radians(2.5)
SENSOR = SensorModel(sigma=0.0025, model_sigma=0.0075)
MODELS = {"derived": SENSOR} | {name: SensorModel(0.0025, 0.0075, fixed) for name, fixed in PRESETS.items()}


def unit(azimuth: Array, elevation: Array) -> Array:
    return np.column_stack([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])


def room_returns() -> Array:
    """A full sphere of rays, both poles included, in a room whose one half is ten times as far away; one sector lost. Rounded
    to what an index keeps."""
    azimuth, elevation = (
        a.ravel() for a in np.meshgrid(np.arange(0, 2 * np.pi, STEP), np.arange(-np.pi / 2, np.pi / 2 + 1e-9, STEP))
    )
    lost = (azimuth > 4.0) & (azimuth < 4.5) & (np.abs(elevation) < 1.2)
    ray = unit(azimuth[~lost], elevation[~lost])
    reach = np.min(np.array([2.0, 1.3, 1.1]) / np.maximum(np.abs(ray), 1e-9), axis=1)
    reach = np.where(ray[:, 1] > 0.4, 10 * reach, reach)
    returns = ray * (reach + np.random.default_rng(1).normal(0, 0.002, len(ray)))[:, None]
    return returns.astype(np.float32).astype(np.float64)


def room_queries(returns: Array, count: int = 500) -> tuple[Array, Array]:
    """Positions around returns, in front of them, behind them and between rays; near poles and the azimuth seam; some
    where nothing was measured, and some faces turned away or grazed."""
    random = np.random.default_rng(2)
    azimuth = np.arctan2(returns[:, 1], returns[:, 0])
    polar = np.flatnonzero(np.abs(returns[:, 2]) > 0.995 * np.linalg.norm(returns, axis=1))
    seam = np.flatnonzero((np.abs(azimuth) < STEP) | (np.abs(azimuth) > np.pi - STEP))
    near = np.concatenate([
        random.choice(polar, count // 6), random.choice(seam, count // 6),
        random.choice(len(returns), count - 2 * (count // 6)),
    ])  # fmt: skip
    p = returns[near]
    reach = np.linalg.norm(p, axis=1, keepdims=True)
    ray = p / reach
    side = random.normal(size=p.shape)
    side -= np.einsum("ij,ij->i", side, ray)[:, None] * ray
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    across = np.where(random.random((count, 1)) < 0.5, reach * STEP, 0.006) * np.abs(random.normal(0, 1, (count, 1)))
    along = np.where(random.random((count, 1)) < 0.7, 0.01, 0.3) * random.normal(size=(count, 1))
    query = p + along * ray + across * side
    query[:25] = unit(random.uniform(4.1, 4.4, 25), random.uniform(-0.5, 0.5, 25)) * random.uniform(0.2, 5, (25, 1))
    tilt = random.normal(size=p.shape)
    normal = -ray + random.uniform(0, 3, (count, 1)) * tilt / np.linalg.norm(tilt, axis=1, keepdims=True)
    return query, normal / np.linalg.norm(normal, axis=1, keepdims=True)


def parameters(query: Array, normal: Array, spacing: float, sensor: SensorModel) -> tuple[float, float, float] | None:
    """(c, lambda, kappa), or None where a position is too near or its face turned away."""
    distance = float(np.linalg.norm(query))
    cosine = -float(query @ normal) / distance
    if distance < LEAST_RANGE_M or cosine < LEAST_COSINE:
        return None
    fixed = sensor.fixed or MassParameters(0.0, 0.0, 0.0)
    return mass_parameters(
        distance, cosine, spacing, sensor.sigma, sensor.model_sigma, fixed.c, fixed.lam, fixed.kappa
    )


def all_masses(query: Array, returns: Array, c: float, lam: float, kappa: float) -> Array:
    """(N, 3) masses that every return in the query's half of space gives, straight from the formula."""
    reach = np.linalg.norm(returns, axis=1)
    ray = returns / reach[:, None]
    ahead = ray @ query > 0
    away = query - returns[ahead]
    dx = np.einsum("ij,ij->i", away, ray[ahead])
    dy2 = np.maximum(np.einsum("ij,ij->i", away, away) - dx**2, 0.0)
    g = np.exp(-kappa * dy2)
    with np.errstate(over="ignore"):
        upper, lower = 1 / (1 + np.exp(-lam * dx - c)), 1 / (1 + np.exp(-lam * dx + c))
    occ, emp = (upper - lower) * g, (1 - upper) * g
    return np.column_stack([occ, emp, 1 - occ - emp])


def twin(returns: Array, query: Array, normal: Array, spacing: float, sensor: SensorModel) -> Array:
    """(N, 3) masses of each query from all returns."""
    logs = np.zeros((len(query), 3))
    for i in range(len(query)):
        if (found := parameters(query[i], normal[i], spacing, sensor)) is None:
            continue
        m = all_masses(query[i], returns, *found)
        sure = np.clip(np.column_stack([1 - m[:, 1], 1 - m[:, 0], m[:, 2]]), 1e-15, 1.0)
        logs[i] = np.log(sure).sum(axis=0)
    return from_log_commonality(*logs.T)[0]


def fused(evidence: StationEvidence) -> Array:
    return from_log_commonality(evidence.log_occ, evidence.log_emp, evidence.log_unk)[0]


@pytest.fixture(scope="module")
def returns() -> Array:
    return room_returns()


@pytest.mark.parametrize("name", list(MODELS))
def test_agrees_with_all_returns(name: str, returns: Array) -> None:
    query, normal = room_queries(returns)
    index = build_index(returns, STEP)
    evidence = gather(index, query, normal, MODELS[name])
    masses = fused(evidence)
    slow = twin(returns, query, normal, STEP, MODELS[name])
    np.testing.assert_allclose(masses, slow, atol=1e-6)
    occupied, empty, unknown = (masses > 0.5).sum(axis=0)
    assert min(occupied, empty, unknown) >= 10, "the queries must try all three outcomes"
    assert len(np.unique(np.round(evidence.cosine[evidence.cosine > LEAST_COSINE], 1))) >= 8
    assert evidence.distance.max() > 8 * evidence.distance.min()


def test_agrees_with_fusing_one_return_after_the_other(returns: Array) -> None:
    query, normal = room_queries(returns)
    masses = fused(gather(build_index(returns, STEP), query, normal, SENSOR))
    tried = 0
    for i in np.flatnonzero((masses[:, 2] < 0.9) & (masses.max(axis=1) < 0.9999))[:10]:
        m = all_masses(query[i], returns, *(parameters(query[i], normal[i], STEP, SENSOR) or ()))
        one = np.array([0.0, 0.0, 1.0])
        for body in m[m[:, 2] < 1.0]:
            one = dempster(one, body)
        np.testing.assert_allclose(masses[i], one, atol=1e-6)
        tried += 1
    assert tried >= 5


def test_the_nearest_ray_and_the_deviation_are_those_of_all_returns(returns: Array) -> None:
    query, normal = room_queries(returns)
    index = build_index(returns, STEP)
    evidence = gather(index, query, normal, SENSOR)
    point = index.returns.astype(np.float64)
    ray = point / np.linalg.norm(point, axis=1, keepdims=True)
    seen = 0
    for i in range(len(query)):
        if evidence.cosine[i] < LEAST_COSINE or evidence.distance[i] < LEAST_RANGE_M:
            assert evidence.nearest[i] == -1
            continue
        along = ray @ query[i]
        dy = np.where(along > 0, np.linalg.norm(np.cross(query[i] - point, ray), axis=1), np.inf)
        near = dy <= NEAR_CUT * evidence.distance[i] * STEP
        assert (evidence.nearest[i] >= 0) == near.any()
        if not near.any():
            assert np.isnan(evidence.deviation[i])
            continue
        seen += 1
        assert evidence.nearest_dy[i] == pytest.approx(dy.min(), abs=1e-7)
        away = (point - query[i]) @ normal[i]
        level = away[evidence.nearest[i]]
        same = near & (np.abs(away - level) <= max(4.0 * SENSOR.sigma * evidence.cosine[i], 0.004))
        assert evidence.count[i] == same.sum()
        assert evidence.deviation[i] == pytest.approx(away[same].mean(), abs=1e-9)
    assert seen > 300


def same_evidence(first: StationEvidence, second: StationEvidence) -> None:
    for name in ("log_occ", "log_emp", "log_unk", "nearest_dy", "deviation", "count", "cosine", "distance"):
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name), err_msg=name)


def test_the_order_of_returns_changes_no_bit(returns: Array) -> None:
    query, normal = room_queries(returns)
    index = build_index(returns)
    evidence = gather(index, query, normal, SENSOR)
    for seed in range(3):
        mixed = build_index(np.random.default_rng(seed).permutation(returns, axis=0))
        assert mixed.spacing_rad == index.spacing_rad
        again = gather(mixed, query, normal, SENSOR)
        same_evidence(evidence, again)
        found = evidence.nearest >= 0
        np.testing.assert_array_equal(index.returns[evidence.nearest[found]], mixed.returns[again.nearest[found]])


@pytest.fixture
def threads() -> Iterator[None]:
    before = numba.get_num_threads()
    yield
    numba.set_num_threads(before)


@pytest.mark.skipif(numba.config.NUMBA_NUM_THREADS < 2, reason="one processor only")
def test_the_number_of_threads_changes_no_bit(returns: Array, threads: None) -> None:
    query, normal = room_queries(returns)
    found = []
    for count in (1, 2):
        numba.set_num_threads(count)
        index = build_index(returns)
        found.append((index, gather(index, query, normal, SENSOR)))
    np.testing.assert_array_equal(found[0][0].returns, found[1][0].returns)
    same_evidence(found[0][1], found[1][1])
    np.testing.assert_array_equal(found[0][1].nearest, found[1][1].nearest)


def test_no_returns_and_no_queries() -> None:
    nothing = gather(build_index(np.zeros((0, 3)), STEP), np.ones((2, 3)), -np.ones((2, 3)) / math.sqrt(3), SENSOR)
    np.testing.assert_array_equal(fused(nothing), [[0, 0, 1]] * 2)
    assert (nothing.nearest == -1).all()
    assert len(gather(build_index(np.ones((1, 3)), STEP), np.zeros((0, 3)), np.zeros((0, 3)), SENSOR).log_occ) == 0


@pytest.mark.parametrize("step_deg", [0.2, 0.5, 2.0])
def test_spacing_of_a_regular_grid(step_deg: float) -> None:
    step = math.radians(step_deg)
    azimuth, elevation = np.meshgrid(np.arange(0, 2 * np.pi, step), np.arange(-0.2, 0.2, step))
    ray = unit(azimuth.ravel(), elevation.ravel())
    index = build_index(ray * np.random.default_rng(0).uniform(1, 50, (len(ray), 1)))
    assert index.spacing_rad == pytest.approx(step, rel=0.05)
    direction, angle = neighbour_angles(index, len(ray))
    assert len(direction) == len(angle) > 1000 or len(direction) == len(ray)
    assert np.nanpercentile(angle, 10) == pytest.approx(step, rel=0.1)


def test_what_lies_within_a_spacing_of_a_return_lies_within_the_cone_of_view() -> None:
    rng = np.random.default_rng(3)
    for width in (0.2, 0.7, 3.0):
        returns = rng.uniform([-width, -width, 1.0], [width, width, 1.0], (500, 3)) * rng.uniform(1, 5, (500, 1))
        index = build_index(returns)
        axis, cosine = view_cone(index, 1.1)
        ray = index.returns / np.linalg.norm(index.returns, axis=1, keepdims=True)
        aside = np.cross(ray, rng.normal(size=ray.shape))
        aside /= np.linalg.norm(aside, axis=1, keepdims=True)
        reach = np.arcsin(1.1 * index.spacing_rad)
        assert ((np.cos(reach) * ray + np.sin(reach) * aside) @ axis >= cosine).all()
        assert cosine > np.cos(np.arctan(1.5 * width) + 3 * reach)
    around = rng.normal(size=(500, 3))
    assert view_cone(build_index(np.concatenate([around, -around])), 1.1)[1] <= -1.0
    assert view_cone(build_index(np.zeros((0, 3)), 0.1), 1.1)[1] > 1.0


def test_spacing_of_nothing_is_unknown() -> None:
    assert math.isnan(median_spacing(np.array([np.nan, 0.0])))


def test_parameters_follow_distance_and_incidence() -> None:
    def at(distance: float, cosine: float) -> tuple[float, float, float]:
        return mass_parameters(distance, cosine, 0.001, 0.0025, 0.0075, 0.0, 0.0, 0.0)

    c, lam, kappa = at(10.0, 1.0)
    assert kappa == pytest.approx(math.log(2) / 0.01**2)
    assert lam == pytest.approx(math.pi / math.sqrt(3) / math.hypot(0.0025, 0.0075))
    assert c / lam == pytest.approx(2 * math.hypot(0.0025, 0.0075))
    zone = [(lambda p: p[0] / p[1])(at(10.0, math.cos(math.radians(a)))) for a in (0, 30, 60, 75, 80)]
    assert all(b > a for a, b in pairwise(zone)), "grazing incidence widens the occupied zone"
    assert at(20.0, 1.0)[2] == pytest.approx(kappa / 4)
    assert mass_parameters(10.0, 0.5, 0.001, 0.0025, 0.0075, 3.0, 600.0, 20000.0) == (3.0, 600.0, 20000.0)


@pytest.fixture(scope="module")
def campaign() -> tuple[ArraySource, Queries, ElementSurfaces]:
    """Two stations in a building of boxes, their rays up to the zenith, where all tiles meet."""
    model = building_model(four_rooms())
    source = scan(model, np.array([[3.1, 1.9, 1.5], [6.2, 2.9, 1.7]]), step_deg=1.0, noise=0.002, seed=1)
    samples = sample_surface(model, 0.25)
    queries = Queries(
        np.arange(len(samples)), samples.position, samples.normal, samples.element, samples.triangle,
        np.zeros((len(samples), 3)),
    )
    return source, queries, ElementSurfaces(model)


def seen_with(campaign: tuple[ArraySource, Queries, ElementSurfaces], memory_gb: float) -> tuple[Sightings, int, bool]:
    source, queries, surfaces = campaign
    with ReturnStore(source, memory_gb) as store:
        stations = StationIndexes(store, np.zeros(3))
        seen = look(stations, queries, surfaces, SENSOR, Progress())
        return seen, sum(1 for _ in store.tiles(0, 0.1)), store.fits


@pytest.mark.parametrize(("bytes_per_return", "in_memory"), [(31.5, True), (15, False), (2.5, False)])
def test_tiles_and_spilling_to_disk_change_no_bit(
    campaign: tuple[ArraySource, Queries, ElementSurfaces], bytes_per_return: float, in_memory: bool
) -> None:
    memory_gb = bytes_per_return * campaign[0].point_count / 1e9
    whole, tiles, fits = seen_with(campaign, 3.0)
    assert fits and tiles == 1 and len(whole) > 5000
    parts, tiles, fits = seen_with(campaign, memory_gb)
    assert tiles > 1 and fits == in_memory
    for name in vars(whole):
        np.testing.assert_array_equal(getattr(parts, name), getattr(whole, name), err_msg=name)


def nearest_with(campaign: tuple[ArraySource, Queries, ElementSurfaces], memory_gb: float) -> tuple[np.ndarray, int]:
    """(K, 3) the first station's nearest return within 0.5 m of places 0.4 m before the queries; and how many tiles it has."""
    source, queries, _ = campaign
    place = queries.position + 0.4 * queries.normal
    near = np.full((len(place), 3), np.nan)
    with ReturnStore(source, memory_gb) as store:
        stations = StationIndexes(store, np.zeros(3))
        asked = np.zeros(len(near), np.int16)
        for rows, _, offset, index in stations.around(asked, place, SENSOR, Progress(), within=0.5):
            found = _nearest_return(offset, index.returns, index.bin_start, index.row_start, 0.5)
            near[rows[found >= 0]] = index.returns[found[found >= 0]]
        return near, sum(1 for _ in store.tiles(0, 0.1))


def test_the_nearest_return_does_not_hang_on_tiles(campaign: tuple[ArraySource, Queries, ElementSurfaces]) -> None:
    """0.5 m are a wider angle, close to the station, than the sensor model asks for."""
    whole, tiles = nearest_with(campaign, 3.0)
    assert tiles == 1 and np.isfinite(whole[:, 0]).sum() > 500
    parts, tiles = nearest_with(campaign, 1 * campaign[0].point_count / 1e9)
    assert tiles > 1
    np.testing.assert_array_equal(parts, whole)


def test_blocks_in_any_order_change_no_bit(campaign: tuple[ArraySource, Queries, ElementSurfaces]) -> None:
    source, queries, surfaces = campaign
    random = np.random.default_rng(5)
    mixed = ArraySource(source.stations, tuple(random.permutation(o, axis=0) for o in source.offsets))
    whole, _, _ = seen_with(campaign, 3.0)
    again, _, _ = seen_with((mixed, queries, surfaces), 3.0)
    for name in vars(whole):
        np.testing.assert_array_equal(getattr(again, name), getattr(whole, name), err_msg=name)
