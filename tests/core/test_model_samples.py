"""Query positions: how many, where, for how much surface, and which of them anybody could see."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bim_verify.core.model.elements import BuildingModel
from bim_verify.core.model.load import load_model
from bim_verify.core.model.sample_surface import FEWEST, sample_surface
from bim_verify.core.model.samples import SurfaceSamples
from bim_verify.core.simulation.box_building import box, building_model

from .model_files import ModelFile, area_of, at, corners_of


def boxes(*corners: tuple[tuple[float, float, float], tuple[float, float, float]]) -> BuildingModel:
    return building_model([box(f"{k}", low, high) for k, (low, high) in enumerate(corners)])


def of(samples: SurfaceSamples, element: int) -> np.ndarray:
    return np.flatnonzero(samples.element == element)


def test_areas_add_up_to_the_surface(tmp_path: Path) -> None:
    made = ModelFile()
    wall = made.product("IfcWall", "Wall", made.box(4.0, 0.2, 2.5))
    made.opening(wall, made.box(1.0, 0.4, 1.2), at(1.5, -0.1, 0.9))
    made.product("IfcColumn", "Post", made.round_column(0.15, 2.5), at(6.0))
    made.product("IfcPlate", "Sheet", made.sheet((0, 0, 0), (2, 0, 0), (2, 0, 1), (0, 0, 1)), at(9.0))
    model = load_model(made.write(tmp_path / "model.ifc"), cache=False, threads=1)
    for spacing in (0.02, 0.3):
        samples = sample_surface(model, spacing)
        assert (np.diff(samples.element) >= 0).all()
        for row, element in enumerate(model.elements):
            found = samples.area[of(samples, row)]
            assert found.sum() == pytest.approx(area_of(corners_of(model, element.name)), rel=1e-9)
            assert np.ptp(found) < 1e-12, "each stands for the same area"


def test_positions_lie_on_their_triangles_with_outward_normals() -> None:
    model = boxes(((0, 0, 0), (2, 1, 0.2)))
    samples = sample_surface(model, 0.05)
    corner = model.vertices[model.triangles[samples.triangle]]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    np.testing.assert_allclose(samples.normal, normal, atol=1e-12)
    assert np.abs(np.einsum("ij,ij->i", samples.position - corner[:, 0], normal)).max() < 1e-12
    assert (np.einsum("ij,ij->i", samples.position - [1.0, 0.5, 0.1], samples.normal) > 0).all()
    low, high = model.bounds
    assert (samples.position >= low - 1e-12).all() and (samples.position <= high + 1e-12).all()


def test_each_face_gets_its_share() -> None:
    samples = sample_surface(boxes(((0, 0, 0), (2, 1, 0.2))), 0.02)
    for axis, area in ((0, 0.2), (1, 0.4), (2, 2.0)):
        for sign in (-1, 1):
            assert samples.area[samples.normal[:, axis] * sign > 0.9].sum() == pytest.approx(area, rel=0.01)
    top = samples.position[samples.normal[:, 2] > 0.9]
    counts = np.histogram2d(top[:, 0], top[:, 1], bins=(8, 4), range=((0, 2), (0, 1)))[0]
    assert counts.min() > 0.8 * counts.mean() and counts.max() < 1.2 * counts.mean()


def test_spacing_decides_the_number_but_a_small_element_gets_enough() -> None:
    model = boxes(((0, 0, 0), (2, 1, 0.2)), ((5, 0, 0), (5.05, 0.05, 0.05)))
    samples = sample_surface(model, 0.02)
    assert len(of(samples, 0)) == pytest.approx(5.2 / 0.02**2, rel=0.001)
    assert len(of(samples, 1)) == FEWEST >= 400
    assert len(of(sample_surface(model, 1.0), 0)) == FEWEST


def test_a_large_model_stays_within_the_most() -> None:
    model = boxes(((0, 0, 0), (200, 100, 20)), ((300, 0, 0), (300.05, 0.05, 0.05)))
    samples = sample_surface(model, 0.02, most=50_000)
    assert 45_000 < len(samples) <= 50_000 + 2 * FEWEST
    assert len(of(samples, 1)) == FEWEST


def test_faces_in_contact_are_not_exposed() -> None:
    model = boxes(((0, 0, 0), (2, 2, 0.2)), ((0.5, 0.5, 0.2), (1.5, 1.5, 1.2)))
    samples = sample_surface(model, 0.05)
    p, n = samples.position, samples.normal
    under = (samples.element == 1) & (n[:, 2] < -0.9)
    top = (samples.element == 0) & (n[:, 2] > 0.9)
    covered = top & (np.abs(p[:, :2] - 1.0) < 0.5).all(axis=1)
    assert not samples.exposed[under].any()
    assert not samples.exposed[covered].any()
    assert samples.exposed[top & ~covered].mean() > 0.95
    assert samples.exposed[(samples.element == 1) & (n[:, 2] > 0.9)].all()


@pytest.mark.parametrize(("gap", "visible"), [(0.002, False), (0.02, False), (1.0, True)])
def test_a_gap_is_exposed_when_a_scanner_could_look_into_it(gap: float, visible: bool) -> None:
    samples = sample_surface(boxes(((0, 0, 0), (2, 0.2, 2)), ((0, 0.2 + gap, 0), (2, 0.4 + gap, 2))), 0.05)
    facing = (samples.element == 0) & (samples.normal[:, 1] > 0.9)
    middle = facing & (np.abs(samples.position[:, 0] - 1) < 0.7) & (np.abs(samples.position[:, 2] - 1) < 0.7)
    assert (samples.exposed[middle].mean() > 0.99) == visible
    if not visible:
        assert not samples.exposed[middle].any()


def test_what_another_element_encloses_is_not_exposed() -> None:
    samples = sample_surface(boxes(((0, 0, 0), (2, 2, 2)), ((0.5, 0.5, 0.5), (1.5, 1.5, 1.5))), 0.1)
    assert samples.exposed[samples.element == 0].all()
    assert not samples.exposed[samples.element == 1].any()


def test_the_same_model_gives_the_same_positions_wherever_it_stands() -> None:
    near = boxes(((0, 0, 0), (2, 1, 0.2)))
    far = building_model([box("0", (0, 0, 0), (2, 1, 0.2))], origin=(1e6, 5e6, 0))
    for name, value in vars(sample_surface(near, 0.05)).items():
        np.testing.assert_array_equal(getattr(sample_surface(far, 0.05), name), value)
