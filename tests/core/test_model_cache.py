"""An unchanged model is never tessellated twice; a changed one always is."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import ifcopenshell.geom
import numpy as np
import pytest

from bim_verify.core.model import tessellation_cache
from bim_verify.core.model.elements import BuildingModel
from bim_verify.core.model.load import load_model

from .model_files import ModelFile, at


@pytest.fixture(autouse=True)
def cache_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("BIM_VERIFY_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.fixture
def path(tmp_path: Path) -> Path:
    made = ModelFile()
    made.product("IfcWall", "Wall", made.box(4.0, 0.2, 2.5), at(5000.0, 0.0, 0.0, 20.0))
    made.product("IfcPlate", "Sheet", made.sheet((0, 0, 0), (2, 0, 0), (2, 0, 1), (0, 0, 1)))
    made.map_conversion(Eastings=1.0, Northings=2.0, OrthogonalHeight=3.0)
    return made.write(tmp_path / "model.ifc")


def forbid_tessellation(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object, **__: object) -> None:
        raise AssertionError("tessellated again")

    monkeypatch.setattr(ifcopenshell.geom, "iterator", fail)


def same(first: BuildingModel, second: BuildingModel) -> None:
    for name, value in vars(first).items():
        other = getattr(second, name)
        if isinstance(value, np.ndarray):
            np.testing.assert_array_equal(value, other, err_msg=name)
            assert value.dtype == other.dtype
        elif name == "map_conversion":
            np.testing.assert_equal(dataclasses.asdict(value), dataclasses.asdict(other))
        else:
            assert value == other, name


def test_the_second_load_does_not_tessellate(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first = load_model(path, threads=1)
    forbid_tessellation(monkeypatch)
    same(first, load_model(path, threads=1))


def test_a_copy_under_another_name_is_found_too(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    load_model(path, threads=1)
    copy = tmp_path / "copy.ifc"
    copy.write_bytes(path.read_bytes())
    forbid_tessellation(monkeypatch)
    assert load_model(copy, threads=1).path == str(copy)


def test_other_content_and_other_tolerance_are_tessellated(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    load_model(path, threads=1)
    with monkeypatch.context() as inner:
        forbid_tessellation(inner)
        with pytest.raises(AssertionError, match="again"):
            load_model(path, threads=1, deflection=0.005)
        path.write_bytes(path.read_bytes().replace(b"'Wall'", b"'Well'"))
        with pytest.raises(AssertionError, match="again"):
            load_model(path, threads=1)
    assert "Well" in [e.name for e in load_model(path, threads=1).elements]


def test_without_the_cache_nothing_is_kept(path: Path, cache_folder: Path) -> None:
    load_model(path, threads=1, cache=False)
    assert not cache_folder.exists()


@pytest.mark.parametrize("damage", [b"", b"PK\x03\x04 no zip", None])
def test_a_damaged_cache_is_made_anew(path: Path, cache_folder: Path, damage: bytes | None) -> None:
    first = load_model(path, threads=1)
    (stored,) = cache_folder.glob("*.npz")
    whole = stored.read_bytes()
    stored.write_bytes(whole[: len(whole) // 2] if damage is None else damage)
    same(first, load_model(path, threads=1))
    assert stored.stat().st_size == len(whole)


def test_a_cache_that_cannot_be_written_is_no_error(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv("BIM_VERIFY_CACHE", str(tmp_path / "file" / "cache"))
    assert len(load_model(path, threads=1).elements) == 2


def test_the_oldest_go(path: Path, cache_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tessellation_cache, "KEEP_FILES", 2)
    for deflection in (0.001, 0.002, 0.003, 0.004):
        load_model(path, threads=1, deflection=deflection)
    assert len(list(cache_folder.glob("*"))) == 2
