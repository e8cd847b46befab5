"""Where scanners stood, said by the user: for one file, or for each of several."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bim_verify.core.errors import BimVerifyError
from bim_verify.core.jobs import change
from bim_verify.core.jobs.inputs import check_one_origin, opened
from bim_verify.core.options import ChangeOptions, InputOptions
from bim_verify.core.scans.open import open_scans
from bim_verify.core.scans.origins import origin_of, parse_origins

from .verify_data import house


def cloud(path: Path, shift: float = 0.0) -> Path:
    np.savetxt(path, np.random.default_rng(1).uniform(1.0, 3.0, (50, 3)) + shift, fmt="%.4f")
    return path


def test_one_place_or_one_for_each_file() -> None:
    assert parse_origins("--origin", []) is None
    assert parse_origins("--origin", ["1,-2,3.5"]) == (1.0, -2.0, 3.5)
    assert parse_origins("--origin", ["a=b.xyz=1,2,3", "c.xyz=4,5,6"]) == {"a=b.xyz": (1.0, 2.0, 3.0), "c.xyz": (4.0, 5.0, 6.0)}


@pytest.mark.parametrize(
    ("texts", "words"),
    [
        (["1,2"], "three numbers"), (["a.xyz=1,2"], "three numbers"), (["1,2,nan"], "finite"),
        (["1,2,3", "4,5,6"], "FILE=X,Y,Z for each"), (["1,2,3", "a.xyz=4,5,6"], "FILE=X,Y,Z for each"),
    ],
)
def test_what_is_no_place_is_refused(texts: list[str], words: str) -> None:
    with pytest.raises(BimVerifyError, match=words):
        parse_origins("--origin", texts)


def test_a_file_is_known_by_its_path_or_its_name(tmp_path: Path) -> None:
    path = cloud(tmp_path / "a.xyz")
    for name in (str(path), "a.xyz", str(tmp_path / "." / "a.xyz")):
        assert origin_of(path, {"b.xyz": (0.0, 0.0, 0.0), name: (1.0, 2.0, 3.0)}) == (1.0, 2.0, 3.0)
    assert origin_of(path, {"b.xyz": (0.0, 0.0, 0.0)}) is None and origin_of(path, None) is None


def test_each_file_gets_its_own_place_and_one_is_not_for_two(tmp_path: Path) -> None:
    a, b = cloud(tmp_path / "a.xyz"), cloud(tmp_path / "b.xyz", 0.5)
    source = open_scans([a, b], origin={"a.xyz": (0.0, 0.0, 1.0), "b.xyz": (5.0, 0.0, 1.0)})
    assert [s.position.tolist() for s in source.stations] == [[0.0, 0.0, 1.0], [5.0, 0.0, 1.0]]
    assert [s.known for s in open_scans([a, b], origin={"b.xyz": (5.0, 0.0, 1.0)}).stations] == [False, True]
    with pytest.raises(BimVerifyError, match=r"a.xyz, b.xyz name no scanner position.*--origin b.xyz=X,Y,Z"):
        open_scans([a, b], origin=(0.0, 0.0, 1.0))


def test_one_place_is_not_for_two_epochs(tmp_path: Path) -> None:
    a, b = cloud(tmp_path / "a.xyz"), cloud(tmp_path / "b.xyz", 0.5)
    options = InputOptions(origin=(0.0, 0.0, 1.0))
    with pytest.raises(BimVerifyError, match=r"b.xyz, a.xyz name no scanner position, and one was given for all"):
        change(house(), [[a]], [b], ChangeOptions(origin=(0.0, 0.0, 1.0), voxel=0.1, sample_spacing=0.2))
    check_one_origin([opened([a], options), opened([a], options)], options)  # the same scan twice stands where it stood
