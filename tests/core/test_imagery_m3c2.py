"""M3C2: distances and levels of detection, against a plain computation and against another implementation."""

from __future__ import annotations

import numpy as np
import pytest

from bim_verify.core.errors import BimVerifyError
from bim_verify.core.imagery.m3c2 import m3c2


def clouds(shift: float, noise: float = 0.004) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Core points, normals and two clouds of a tilted wall; the second ``shift`` metres further along the normal."""
    rng = np.random.default_rng(2)
    n = np.array([0.6, -0.3, 0.2])
    n /= np.linalg.norm(n)
    u = np.cross(n, [0, 0, 1.0])
    u /= np.linalg.norm(u)
    v = np.cross(n, u)

    def wall(count: int, away: float) -> np.ndarray:
        a, b = rng.uniform(0, 1.5, (2, count))
        return a[:, None] * u + b[:, None] * v + (away + rng.normal(0, noise, count))[:, None] * n

    core = wall(80, 0.0)
    return core, np.repeat(n[None], len(core), 0), wall(9000, 0.0), wall(7000, shift)


def test_distances_are_those_of_a_plain_computation() -> None:
    core, normal, first, second = clouds(0.012)
    found = m3c2(core, normal, first, second, radius=0.06, reach=0.2, registration=0.001)
    for i in range(0, len(core), 9):
        sides = []
        for cloud in (first, second):
            t = (cloud - core[i]) @ normal[i]
            off = np.linalg.norm(cloud - core[i] - t[:, None] * normal[i], axis=1)
            sides.append(t[(np.abs(t) <= 0.2) & (off <= 0.06)])
        assert [len(s) for s in sides] == found.count[i].tolist()
        assert found.distance[i] == pytest.approx(sides[1].mean() - sides[0].mean(), abs=1e-12)
        error = np.sqrt(sum(s.var(ddof=1) / len(s) for s in sides))
        assert found.level[i] == pytest.approx(1.959964 * (error + 0.001), rel=1e-9)
    assert found.significant.all()


def test_the_same_cloud_twice_is_no_change_and_nothing_is_said_where_nothing_is() -> None:
    core, normal, first, _ = clouds(0.0)
    same = m3c2(core, normal, first, first, radius=0.06, reach=0.2)
    assert np.abs(same.distance).max() == 0.0 and not same.significant.any()
    far = m3c2(core + 50.0, normal, first, first, radius=0.06, reach=0.2)
    assert np.isnan(far.distance).all() and not far.significant.any()
    assert np.isnan(m3c2(core, normal, first, first[:0], radius=0.06, reach=0.2).distance).all()


def test_noise_alone_is_significant_in_one_of_twenty() -> None:
    core, normal, first, second = clouds(0.0)
    found = m3c2(core, normal, first, second, radius=0.03, reach=0.2)
    assert found.significant.mean() < 0.2


def test_lengths_that_make_no_sense_are_refused() -> None:
    core, normal, first, second = clouds(0.0)
    with pytest.raises(BimVerifyError, match="larger than zero"):
        m3c2(core, normal, first, second, radius=0.0, reach=0.2)


def test_it_agrees_with_another_implementation() -> None:
    other = pytest.importorskip("py4dgeo")
    core, normal, first, second = clouds(0.012)
    theirs = other.M3C2(
        epochs=(other.Epoch(first), other.Epoch(second)), corepoints=core, corepoint_normals=normal, cyl_radius=0.06,
        max_distance=0.2, registration_error=0.001,
    )
    distance, uncertainty = theirs.run()
    found = m3c2(core, normal, first, second, radius=0.06, reach=0.2, registration=0.001)
    assert np.abs(distance - found.distance).max() < 1e-6
    assert np.abs(uncertainty["lodetection"] - found.level).max() < 1e-6
