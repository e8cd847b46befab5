"""What a station says is kept only as far as the surface that it saw bears it out."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

from bim_verify.core.evidence.fuse_samples import fuse_samples
from bim_verify.core.evidence.sightings import Sightings
from bim_verify.core.results import SampleEvidence

ZONE, CAP, SIGMA, WINDOW = 0.015, 0.99, 0.002, 0.025


def sightings(deviation: list[float], occupied: float = 0.9, empty: float = 0.05, cosine: float = 1.0) -> Sightings:
    """Each query seen once, by four returns of one station."""
    count = len(deviation)
    one = np.ones(count)
    return Sightings(
        sample=np.arange(count, dtype=np.int32), station=np.zeros(count, np.int16), deviation=np.array(deviation),
        count=np.full(count, 4, np.int32), cosine=np.full(count, cosine, np.float32), distance=np.full(count, 5, np.float32),
        point=np.zeros((count, 3), np.float32), glass=np.zeros(count, np.bool_),
        log_masses=np.log(np.column_stack([(1 - empty) * one, (1 - occupied) * one, (1 - occupied - empty) * one])),
        on_face=np.ones(count, np.bool_), face_normal=np.zeros((count, 3), np.float32), residual=np.array(deviation),
        explained=np.zeros(count, np.bool_), photo=np.zeros((count, 0)),
    )


def fused(seen: Sightings, shared: float = 0.0) -> SampleEvidence:
    return fuse_samples(len(seen), seen, "station", ZONE, shared, CAP, SIGMA, WINDOW)




@pytest.mark.parametrize("deviation", [0.0, 0.01, 0.0145, 0.0155, 0.03, -0.0145, -0.0155, -0.1])
@pytest.mark.parametrize("shared", [0.0, 0.004])
def test_masses_are_kept_with_the_probability_of_where_the_surface_lies(deviation: float, shared: float) -> None:
    found = fused(sightings([deviation]), shared)
    place = norm(deviation, np.hypot(SIGMA / 2, shared))
    within, beyond = place.cdf(ZONE) - place.cdf(-ZONE), place.cdf(-ZONE)
    assert found.m_occ[0] == pytest.approx(CAP * 0.9 * within, abs=1e-6)
    assert found.m_emp[0] == pytest.approx(CAP * 0.05 * beyond, abs=1e-6)
    assert found.m_occ[0] + found.m_emp[0] + found.m_unk[0] == pytest.approx(1.0, abs=1e-6)


def test_grazing_returns_from_a_surface_elsewhere_prove_nothing_of_the_plan() -> None:
    """Their occupied zone is wide, so alone they would call it occupied; the surface stands 4 cm in front of it."""
    found = fused(sightings([0.04], cosine=0.2))
    assert found.m_occ[0] < 1e-6 and found.m_emp[0] < 1e-6 and found.m_unk[0] > 0.999


def test_no_station_alone_is_believed_beyond_the_cap() -> None:
    assert fused(sightings([0.0], occupied=0.949999, empty=0.05)).m_occ[0] <= CAP
