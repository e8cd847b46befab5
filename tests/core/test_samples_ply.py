"""The samples PLY, read back by another library."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bim_verify.core.errors import BimVerifyError
from bim_verify.core.report.samples_ply import write_samples
from plyfile import PlyData

from .factory import small_result

TYPES = {
    **dict.fromkeys(("x", "y", "z", "nx", "ny", "nz"), "<f8"),
    **dict.fromkeys(("red", "green", "blue"), "|u1"),
    **dict.fromkeys(("m_occ", "m_emp", "m_unk", "conflict", "deviation", "sigma"), "<f4"),
    "element": "<i4",
}


def test_read_back(tmp_path: Path) -> None:
    result = small_result(tmp_path)
    result = replace(result, model=replace(result.model, origin=np.array([500000.0, 4000000.0, 100.0])))
    write_samples(tmp_path / "s.ply", result)
    ply = PlyData.read(str(tmp_path / "s.ply"))
    assert not ply.text and ply.byte_order == "<"
    rows = ply["vertex"].data
    assert {name: rows.dtype[name].str for name in rows.dtype.names} == TYPES
    xyz = np.stack([rows["x"], rows["y"], rows["z"]], axis=1)
    assert np.array_equal(xyz, result.samples.position + result.model.origin)
    assert np.array_equal(rows["element"], result.samples.element)
    assert np.array_equal(rows["nz"], result.samples.normal[:, 2])
    for name in ("m_occ", "m_emp", "m_unk", "conflict", "deviation", "sigma"):
        assert np.array_equal(rows[name], getattr(result.evidence, name), equal_nan=True)


def test_colour_says_what_is_believed(tmp_path: Path) -> None:
    result = small_result(tmp_path)
    write_samples(tmp_path / "s.ply", result)
    rows = PlyData.read(str(tmp_path / "s.ply"))["vertex"].data
    rgb = np.stack([rows["red"], rows["green"], rows["blue"]], axis=1).astype(int)
    occupied, empty, unknown = (rgb[rows[name] > 0.9] for name in ("m_occ", "m_emp", "m_unk"))
    assert min(len(occupied), len(empty), len(unknown)) > 0
    assert (occupied.argmax(axis=1) == 1).all()
    assert (empty.argmax(axis=1) == 0).all()
    assert (unknown.argmax(axis=1) == 2).all()


def test_missing_folder_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(BimVerifyError, match="does not exist"):
        write_samples(tmp_path / "none" / "s.ply", small_result(tmp_path))
