"""A fresh Blender around each test, a small house, a scan of it, and a verification that was made up."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

bpy = pytest.importorskip("bpy")

import numpy as np  # noqa: E402

import bim_verify  # noqa: E402
from bim_verify.bim_verify_addon.session import SESSION  # noqa: E402
from bim_verify.core import jobs  # noqa: E402
from bim_verify.core.model.elements import BuildingModel  # noqa: E402
from bim_verify.core.model.load import load_model  # noqa: E402
from bim_verify.core.results import VerificationResult  # noqa: E402

from ..core.factory import fabricate, make_ifc  # noqa: E402


@pytest.fixture(autouse=True)
def cache_folder(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    """Tessellations of the tests stay out of the user's cache."""
    monkeypatch.setenv("BIM_VERIFY_CACHE", str(tmp_path_factory.getbasetemp() / "cache"))


@pytest.fixture
def blender() -> Iterator[bpy.types.Scene]:
    """An empty Blender with the extension registered; the scene."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bim_verify.register()
    yield bpy.context.scene
    bim_verify.unregister()
    SESSION.clear()
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)


@pytest.fixture(scope="session")
def house(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three walls, a slab and a column."""
    return make_ifc(tmp_path_factory.mktemp("house") / "house.ifc")


@pytest.fixture(scope="session")
def house_model(house: Path) -> BuildingModel:
    """The same, loaded."""
    return load_model(house, cache=False, threads=1)


@pytest.fixture(scope="session")
def result(house_model: BuildingModel) -> VerificationResult:
    """Made-up verdicts that go round all five statuses."""
    return fabricate(house_model)


@pytest.fixture(scope="session")
def scan(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """2000 points in the house, no colours, no station."""
    path = tmp_path_factory.mktemp("scan") / "room.xyz"
    np.savetxt(path, np.random.default_rng(0).uniform(0.3, 2.5, (2000, 3)), fmt="%.6f")
    return path


Found = Callable[..., VerificationResult]


@pytest.fixture
def verification(monkeypatch: pytest.MonkeyPatch) -> Callable[[Found], None]:
    """Put a function in the place of ``core.jobs.verify``."""

    def replace(function: Found) -> None:
        monkeypatch.setattr(jobs, "verify", function)

    return replace


@pytest.fixture
def verified(
    blender: bpy.types.Scene, house: Path, scan: Path, result: VerificationResult,
    verification: Callable[[Found], None],
) -> bpy.types.Scene:  # fmt: skip
    """The small house with a scan, verified."""
    ops = bpy.ops.bim_verify
    verification(lambda *_: result)
    blender.bim_verify.display_vertices = 10_000
    ops.import_ifc(filepath=str(house))
    ops.import_scan(filepath=str(scan))
    assert ops.verify() == {"FINISHED"}
    return blender
