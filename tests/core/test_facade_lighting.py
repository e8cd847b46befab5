"""Light that changes across a facade is taken out; what stands on it stays."""

from __future__ import annotations

import numpy as np
import pytest

from bim_verify.core.facade.lighting import even_light


@pytest.mark.parametrize("dark", [0.0, 0.3])
def test_dark_ends_are_made_as_light_as_the_middle(dark: float) -> None:
    rng = np.random.default_rng(1)
    wall = np.full((300, 400, 3), 190.0)
    for x in range(30, 380, 90):
        wall[60:150, x : x + 45] = 70.0
    across = np.linspace(-1.0, 1.0, 400)[None, :, None]
    seen = np.clip(wall * (1.0 - dark * across**2) + rng.normal(0.0, 3.0, wall.shape), 0, 255).astype(np.uint8)
    even = even_light(seen, 40.0)
    columns = even[200:290].mean(axis=(0, 2))
    assert np.ptp(columns[10:-10]) < 0.05 * columns.mean()
    # windows are as dark against the wall as before
    assert even[80:130, 40:65].mean() / even[200:290, 40:65].mean() == pytest.approx(70 / 190, abs=0.06)


def test_a_picture_without_flat_places_is_left_as_it_is() -> None:
    noise = np.random.default_rng(2).integers(0, 255, (200, 200, 3)).astype(np.uint8)
    assert np.abs(even_light(noise, 12.0) - noise).mean() < 12.0
