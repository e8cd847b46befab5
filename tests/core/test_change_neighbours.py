"""Faces of neighbours that a removed element had covered are not the element at another place."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from bim_verify.core.change import look
from bim_verify.core.evidence.probe import probe
from bim_verify.core.evidence.scenery import AsBuilt
from bim_verify.core.evidence.verify import Findings
from bim_verify.core.jobs import change
from bim_verify.core.options import ChangeOptions
from bim_verify.core.progress import Progress
from bim_verify.core.simulation.box_building import box, building_model
from bim_verify.core.simulation.scene import Scene

from .verify_data import scan

OPTIONS = ChangeOptions(voxel=0.02, sigma=0.0013, sample_spacing=0.05, memory_gb=1.0)
PIER = 0
DEPTH_M = 0.15
"""Of a pier before the east wall: moved by that, its face lies in the wall's."""
MODEL = building_model([
    box("pier", (6.0 - DEPTH_M, 1.5, 0.0), (6.0, 2.5, 3.0)), box("east", (6.0, 0.0, 0.0), (6.2, 4.0, 3.0)),
    box("floor", (0.0, 0.0, -0.2), (6.2, 4.0, 0.0)), box("north", (0.0, 4.0, -0.2), (6.2, 4.2, 3.0)),
])
STATIONS = np.array([[2.0, 1.0, 1.3], [3.0, 3.0, 1.4]])


def scanned(pier: np.ndarray | None) -> Any:
    """``pier``: how far it moved; None: it does not stand."""
    corners = MODEL.vertices[MODEL.triangles]
    own = MODEL.triangle_element == PIER
    corners[own] += 0.0 if pier is None else pier
    keep = ~own | (pier is not None)
    return scan(Scene(corners[keep], MODEL.triangle_element[keep], [e.name for e in MODEL.elements]), stations=STATIONS)


@pytest.mark.parametrize("there", [False, True], ids=["gone", "moved"])
def test_a_place_that_only_faces_of_neighbours_make_is_no_place(there: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """The search is made to propose it. The pier itself, moved, is found where it stands."""
    real, shift = look.places, np.array([-0.06 if there else DEPTH_M, 0.0, 0.0])

    def proposed(scenery: Any, seen: Any, context: Any, progress: Progress) -> Findings:
        found = real(scenery, seen, context, progress)
        best = list(found.best)
        best[PIER] = dataclasses.replace(best[PIER], fit=dataclasses.replace(best[PIER].fit, vector=shift))
        as_built = AsBuilt.of(scenery.model, found.plans, best, context)
        best[PIER] = probe(scenery, [(PIER, shift)], as_built, context, Progress(), coarse=True)[PIER][0]
        assert best[PIER].share > context.thresholds.present_share
        return dataclasses.replace(found, best=best)

    monkeypatch.setattr(look, "places", proposed)
    pier = change(MODEL, [scanned(shift if there else None)], None, OPTIONS).elements[PIER]
    assert pier.moved == there, pier.reason
    assert pier.state == ("PARTIAL" if there else "DISAPPEARED"), pier.reason
