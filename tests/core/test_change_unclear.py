"""Returns in the air behind an edge, surfaces too close to be told apart, and a round pile that moved."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from bim_verify.core.change import look
from bim_verify.core.change.unclear import split_beams, without_unclear
from bim_verify.core.evidence.decide import Place
from bim_verify.core.evidence.displacement import NOTHING
from bim_verify.core.evidence.probe import probe
from bim_verify.core.evidence.sightings import BEYOND, Sightings
from bim_verify.core.evidence.verify import Findings
from bim_verify.core.jobs import change
from bim_verify.core.model.elements import BuildingModel, Element
from bim_verify.core.model.on_element import ElementSurfaces
from bim_verify.core.model.raycast import RayScene
from bim_verify.core.model.sample_surface import sample_surface
from bim_verify.core.options import ChangeOptions
from bim_verify.core.progress import Progress
from bim_verify.core.simulation.box_building import box, building_model
from bim_verify.core.simulation.scene import Scene

from .test_change import a_sighting
from .verify_data import scan

SIGMA_M, WINDOW_M = 0.002, 0.03
STRIP, BOARD = 0, 1
BESIDE = building_model([
    box("strip", (3.0, 1.0, 0.0), (3.04, 1.04, 1.0)), box("board", (2.9, 1.04, 0.0), (3.04, 1.06, 1.0)),
    box("back", (3.04, 0.0, 0.0), (3.06, 2.0, 1.0)),
])
"""A strip in the corner of two boards; the one beside it stands out 10 cm farther than the strip."""
STATION = np.array([[0.0, 1.03, 0.5]])


def strip_sample(model: BuildingModel) -> tuple[Any, int]:
    samples = sample_surface(model, 0.02)
    return samples, int(np.flatnonzero((samples.element == STRIP) & (samples.normal[:, 0] < -0.5))[0])


@pytest.mark.parametrize("y, registration, split", [
    (1.038, 0.0, True), (1.034, 0.0, False), (1.034, 0.002, True), (1.02, 0.0, False),
])
def test_a_beam_of_which_a_part_meets_the_board_before_may_return_from_in_between(
    y: float, registration: float, split: bool
) -> None:
    """At 2 m a beam has a radius of 3.3 mm; the board begins at y = 1.04."""
    samples, of = strip_sample(BESIDE)
    seen = a_sighting(of, np.array([3.0, y, 0.5]))
    start = np.array([[0.0, y, 0.5]])
    found = split_beams(
        seen, np.ones(1, np.bool_), samples, start, RayScene(BESIDE), SIGMA_M, registration, frozenset()
    )
    assert (found.row.tolist(), found.other.tolist()) == (([0], [BOARD]) if split else ([], []))
    assert not found.farther.any()
    whole = split_beams(
        seen, np.ones(1, np.bool_), samples, start, RayScene(BESIDE), SIGMA_M, registration, frozenset({(STRIP, BOARD)})
    )
    assert not len(whole.row), "what meets the whole meets its part"


@pytest.mark.parametrize("behind, passes", [(0.005, False), (0.007, True)])
def test_a_surface_just_behind_shows_nothing_of_what_lies_on_it(behind: float, passes: bool) -> None:
    """Farther than three sigmas it does: 6 mm."""
    samples, of = strip_sample(BESIDE)
    seen = a_sighting(of, np.array([3.0 + behind, 1.02, 0.5]))
    seen = Sightings(**{**vars(seen), "deviation": np.array([-behind]), "explained": np.ones(1, np.bool_)})
    plan = [Place(np.zeros(3), 1.0, 0.0, 0.0, 1.0, 10, 10, (0,), NOTHING) for _ in BESIDE.elements]
    context = cast(Any, SimpleNamespace(sigma=SIGMA_M, window=WINDOW_M))
    scenery = cast(Any, SimpleNamespace(surfaces=ElementSurfaces(BESIDE)))
    found = without_unclear(scenery, Findings(plan, list(plan), samples, seen, {}), 0.02, context).seen
    assert bool(found.on_face[0] & (found.state(WINDOW_M)[0] == BEYOND)) == passes


RADIUS_M, FACETS = 0.18, 24
YARD = building_model([
    box("ground", (-0.2, -0.2, -0.2), (6.2, 4.2, 0.0)), box("fence", (6.0, -0.2, 0.0), (6.2, 4.2, 3.0)),
    box("hedge", (-0.2, 4.0, 0.0), (6.2, 4.2, 3.0)),
])


def with_pile() -> BuildingModel:
    """A yard, and a round pile of 24 facets in it."""
    angle = np.linspace(0.0, 2.0 * np.pi, FACETS, endpoint=False)
    ring = np.column_stack([3.0 + RADIUS_M * np.cos(angle), 2.0 + RADIUS_M * np.sin(angle)])
    low, high = (np.column_stack([ring, np.full(FACETS, z)]) for z in (0.0, 2.5))
    here, there = np.arange(FACETS), np.roll(np.arange(FACETS), -1)
    middle = np.broadcast_to([3.0, 2.0, 2.5], (FACETS, 3))
    corners = np.concatenate([
        np.stack([low[here], low[there], high[there]], 1), np.stack([low[here], high[there], high[here]], 1),
        np.stack([high[here], high[there], middle], 1), np.stack([low[there], low[here], middle - [0.0, 0.0, 2.5]], 1),
    ])
    count = len(corners)
    first = len(YARD.vertices)
    return dataclasses.replace(
        YARD,
        elements=(*YARD.elements, Element(f"{'pile':_<22}", 99, "IfcPile", "pile", "")),
        vertices=np.concatenate([YARD.vertices, corners.reshape(-1, 3)]),
        triangles=np.concatenate([YARD.triangles, first + np.arange(3 * count, dtype=np.int32).reshape(-1, 3)]),
        triangle_element=np.concatenate([YARD.triangle_element, np.full(count, len(YARD.elements), np.int32)]),
        closed=np.append(YARD.closed, True), transparent=np.concatenate([YARD.transparent, np.zeros(count, np.bool_)]),
    )


@pytest.mark.parametrize("nearer", [True, False], ids=["where the fit leads", "where a facet points"])
def test_a_round_pile_that_moved_sideways_is_found(nearer: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Only a place that a facet proposed, 40 degrees off the shift, was tried."""
    model, shift = with_pile(), np.array([0.115, 0.035, 0.0])
    aside = np.array([[0.77, -0.64, 0.0], [0.64, 0.77, 0.0], [0.0, 0.0, 1.0]]) @ shift
    corners, pile = model.vertices[model.triangles], len(model.elements) - 1
    corners[model.triangle_element == pile] += shift
    stations = np.array([[1.0, 1.0, 1.3], [5.0, 3.0, 1.4], [1.2, 3.2, 1.3]])
    source = scan(Scene(corners, model.triangle_element, [e.name for e in model.elements]), stations=stations)
    real = look.places

    def proposed(scenery: Any, seen: Any, context: Any, progress: Progress) -> Findings:
        found = real(scenery, seen, context, progress)
        tried = {pile: probe(scenery, [(pile, aside)], None, context, Progress(), coarse=True)[pile]}
        return dataclasses.replace(found, best=list(found.plans), tried=tried)

    monkeypatch.setattr(look, "places", proposed)
    if not nearer:
        monkeypatch.setattr(look, "nearer_places", lambda scenery, found, context: found.best)
    options = ChangeOptions(voxel=0.04, sigma=0.0013, sample_spacing=0.05, memory_gb=1.0)
    found = change(model, [source], None, options).elements[pile]
    assert found.moved == nearer, found.reason
    if nearer:
        assert found.state == "PARTIAL"
        assert found.shift == pytest.approx(float(np.linalg.norm(shift)), abs=0.005)
