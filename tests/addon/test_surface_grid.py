"""The surface grid: fine enough, the same surface, and values from the right samples."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from bim_verify.bim_verify_addon.surface_grid import (
    SurfaceGrid,
    build_grid,
    grid_within,
    interpolate,
    make_display,
    second_sides,
)
from bim_verify.core.model.elements import BuildingModel
from bim_verify.core.model.sample_surface import sample_surface
from bim_verify.core.results import SampleEvidence, VerificationResult


def evidence(deviation: NDArray[np.float64], occupied: NDArray[np.float64]) -> SampleEvidence:
    occ = occupied.astype(np.float32)
    zero = np.zeros_like(occ)
    return SampleEvidence(occ, zero, 1 - occ, zero, deviation.astype(np.float32), zero)


def areas(vertices: NDArray[np.float64], triangles: NDArray[np.int32]) -> NDArray[np.float64]:
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)


@pytest.fixture
def grid(house_model: BuildingModel) -> SurfaceGrid:
    return build_grid(house_model, np.full(len(house_model.elements), 0.1))


def test_no_edge_is_longer_than_asked_for(grid: SurfaceGrid) -> None:
    corner = grid.vertices[grid.triangles]
    assert np.linalg.norm(corner[:, (1, 2, 0)] - corner, axis=2).max() <= 0.1 + 1e-9


def test_surface_stays_the_same_element_by_element(grid: SurfaceGrid, house_model: BuildingModel) -> None:
    fine, coarse = areas(grid.vertices, grid.triangles), areas(house_model.vertices, house_model.triangles)
    start = house_model.triangle_start
    for e in range(len(house_model.elements)):
        own = slice(grid.triangle_start[e], grid.triangle_start[e + 1])
        assert fine[own].sum() == pytest.approx(coarse[start[e] : start[e + 1]].sum(), rel=1e-12)
        rows = grid.triangles[own]
        assert grid.vertex_start[e] == rows.min()
        assert grid.vertex_start[e + 1] == rows.max() + 1


def test_triangles_keep_their_orientation(grid: SurfaceGrid) -> None:
    a, b, c = (grid.vertices[grid.triangles[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    for k in range(3):
        assert np.allclose(normal, grid.normal[grid.triangles[:, k]], atol=1e-9)


@pytest.mark.parametrize("budget", [600, 20_000, 80_000])
def test_the_budget_is_a_bound_that_is_used(house_model: BuildingModel, budget: int) -> None:
    grid, edge = grid_within(house_model, 0.001, budget)
    assert 0.3 * budget < len(grid.vertices) <= budget
    corner = grid.vertices[grid.triangles]
    assert np.linalg.norm(corner[:, (1, 2, 0)] - corner, axis=2).max() <= edge.max() + 1e-9


def test_a_budget_below_the_corners_gives_the_corners(house_model: BuildingModel) -> None:
    grid, _ = grid_within(house_model, 0.001, 10)
    assert len(grid.triangles) == len(house_model.triangles)


def test_a_coarse_grid_is_said(result: VerificationResult) -> None:
    assert "Result vertices" in make_display(result, 600).note
    assert make_display(result, 50_000).note == ""


def test_an_element_found_elsewhere_shows_its_shift_where_nothing_was_measured(result: VerificationResult) -> None:
    row = next(k for k, v in enumerate(result.verdicts) if v.status == "DEVIATING")
    moved = replace(result.verdicts[row], displacement_vector=(0.03, 0.0, 0.0), displacement=0.03, significant=True)
    verdicts = tuple(moved if k == row else v for k, v in enumerate(result.verdicts))
    blind = replace(result.evidence, deviation=np.full(len(result.samples), np.nan, np.float32))
    shown = make_display(replace(result, verdicts=verdicts, evidence=blind), 20_000)
    own = slice(shown.grid.vertex_start[row], shown.grid.vertex_start[row + 1])
    assert np.allclose(shown.values.deviation[own], 0.03 * shown.grid.normal[own, 0], atol=1e-6)
    assert np.isnan(np.delete(shown.values.deviation, np.r_[own])).all()


def test_a_field_over_the_surface_is_carried_over(grid: SurfaceGrid, house_model: BuildingModel) -> None:
    samples = sample_surface(house_model, 0.05)
    occupied = samples.position[:, 2] / 10 + 0.5
    values = interpolate(grid, samples, evidence(samples.position[:, 0], occupied))
    assert np.abs(values.deviation - grid.vertices[:, 0]).max() < 0.1
    assert np.median(np.abs(values.deviation - grid.vertices[:, 0])) < 0.02
    assert np.abs(values.occupied - (grid.vertices[:, 2] / 10 + 0.5)).max() < 0.01
    assert np.allclose(values.occupied + values.empty + values.unknown, 1.0, atol=1e-6)


def test_the_two_sides_of_a_wall_do_not_mix(grid: SurfaceGrid, house_model: BuildingModel) -> None:
    samples = sample_surface(house_model, 0.05)
    side = np.sign(samples.normal @ np.array([0.3, 1.0, 0.5]))
    values = interpolate(grid, samples, evidence(side, np.ones(len(samples))))
    assert np.allclose(values.deviation, np.sign(grid.normal @ np.array([0.3, 1.0, 0.5])), atol=1e-6)


def test_unmeasured_stays_unmeasured(grid: SurfaceGrid, house_model: BuildingModel) -> None:
    samples = sample_surface(house_model, 0.05)
    half = samples.element < 2
    values = interpolate(grid, samples, evidence(np.where(half, 0.004, np.nan), half.astype(float)))
    first = slice(0, grid.vertex_start[2])
    assert np.allclose(values.deviation[first], 0.004)
    assert np.isnan(values.deviation[grid.vertex_start[2] :]).all()
    assert (values.unknown[grid.vertex_start[2] :] == 1.0).all()


def test_display_of_a_result_is_the_same_each_time(result: VerificationResult, tmp_path: Path) -> None:
    one, two = make_display(result, 20_000), make_display(result, 20_000)
    assert np.array_equal(one.grid.vertices, two.grid.vertices)
    assert np.array_equal(one.values.deviation, two.values.deviation, equal_nan=True)


def test_the_sides_of_a_sheet_are_shown_apart(result: VerificationResult) -> None:
    model = result.model
    there = model.triangles[model.triangle_start[0] : model.triangle_start[1]]
    twice = replace(
        model,
        triangles=np.concatenate([there, there[:, ::-1], model.triangles[len(there) :]]),
        triangle_element=np.concatenate([np.zeros(len(there), np.int32), model.triangle_element]),
    )
    assert second_sides(twice).sum() == len(there)
    assert not second_sides(model).any()
    grid = make_display(replace(result, model=twice), 20_000).grid
    sheet = slice(0, grid.vertex_start[1])
    box = [f(model.vertices[there.reshape(-1)], axis=0) for f in (np.min, np.max)]
    outside = np.maximum(box[0] - grid.vertices[sheet], grid.vertices[sheet] - box[1]).max(axis=1)
    outer = np.isclose(outside, 2.5e-4)
    assert 0.4 < outer.mean() < 0.6
    assert (outside[~outer] < 1e-9).all()
    others = slice(grid.vertex_start[1], None)
    for f in (np.min, np.max):
        expected = f(model.vertices[model.triangles[len(there) :]], axis=(0, 1))
        assert np.allclose(f(grid.vertices[others], axis=0), expected, atol=1e-12)
