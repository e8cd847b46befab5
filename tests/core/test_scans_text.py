"""Text formats: numbers, dialects, PTS with several clouds, PTX with poses and missing returns; and PCD's poses."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bim_verify.core.errors import BimVerifyError
from bim_verify.core.scans import text_rows as rows_module
from bim_verify.core.scans.campaign import Grid
from bim_verify.core.scans.open import open_scans
from bim_verify.core.scans.text_rows import Dialect, TextRows

from .scan_data import make_cloud, ptx_scan, read_all, station, text_rows, write_pcd


def test_numbers_are_read_to_the_last_place(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    values = np.concatenate([rng.normal(0, 10.0**k, 200) for k in range(-6, 8)]).reshape(-1, 4)
    values = np.vstack([values, [[1e3, -2.5e-3, 0.0, -0.0], [1e22, 1e-22, 3.0, 4.0]]])
    for spell in ("{:.17g}", "{:.6f}", "{!r}", "{:.3e}"):
        lines = [" ".join(spell.format(float(v)) for v in row) for row in values]
        (tmp_path / "a.txt").write_text("\n".join(lines))
        truth = np.array([[float(word) for word in line.split()] for line in lines])
        got = np.concatenate([part.copy() for part in TextRows(tmp_path / "a.txt").read(0, 4, 4, 100)])
        np.testing.assert_allclose(got, truth, rtol=4.5e-16, atol=0)
    (tmp_path / "b.txt").write_text("1e-300 -1e300 0e999 12345678901234567890123456789\n")
    (got,) = TextRows(tmp_path / "b.txt").read(0, 4, 4, 1)
    np.testing.assert_allclose(got, [[1e-300, -1e300, 0.0, 12345678901234567890123456789.0]], rtol=1e-14)


@pytest.mark.parametrize(
    ("text", "dialect"),
    [
        ("1.5 -2 3e1\n4 5 6\n", Dialect()),
        ("  1.5\t-2   +30.0  \r\n\r\n# note\r\n4 5 6", Dialect()),
        ("1.5,-2,3.0E+01\n// note\n4, 5 ,6\n", Dialect(",")),
        ("1,5;-2;30\n4;5;6\n", Dialect(";", ",")),
        ("% note\n1,5 -2 30,0\n4 5 6\n", Dialect("", ",")),
    ],
)
def test_dialects(tmp_path: Path, text: str, dialect: Dialect) -> None:
    (tmp_path / "a.txt").write_text(text)
    got = np.concatenate([part.copy() for part in TextRows(tmp_path / "a.txt", dialect).read(0, 3, 3, 10)])
    np.testing.assert_array_equal(got, [[1.5, -2, 30], [4, 5, 6]])
    assert TextRows(tmp_path / "a.txt", dialect).count(0) == 2


def test_rows_do_not_depend_on_the_size_of_pieces(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cloud = make_cloud(300)
    (tmp_path / "a.xyz").write_text("# x y z\n" + text_rows(cloud))
    (tmp_path / "b.ptx").write_text(ptx_scan(cloud, station(), 25))
    whole = [read_all(open_scans([tmp_path / name])) for name in ("a.xyz", "b.ptx")]
    for piece in (200, 1001):
        monkeypatch.setattr(rows_module, "_PIECE", piece)
        for name, truth in zip(("a.xyz", "b.ptx"), whole, strict=True):
            got = read_all(open_scans([tmp_path / name]))
            np.testing.assert_array_equal(got.xyz, truth.xyz)
            np.testing.assert_array_equal(got.color, truth.color)
    monkeypatch.setattr(rows_module, "_PIECE", 20)
    with pytest.raises(BimVerifyError, match="lines"):
        open_scans([tmp_path / "a.xyz"])


@pytest.mark.parametrize(
    ("text", "intensity", "color"),
    [
        ("X;Y;Z;R;G;B;Intensity\n1;2;3;10;20;30;0.5\n", 0.5, [10, 20, 30]),
        ("intensity,z,y,x\n0.5,3,2,1\n", 0.5, None),
        ('"x","y","z","nx","ny","nz"\n1,2,3,0.1,0.2,0.3\n', None, None),
        ("1 2 3 10 20 30\n", None, [10, 20, 30]),
        ("1 2 3 0.1 0.2 0.3\n", None, None),
        ("1 2 3 0.5\n", 0.5, None),
        ("1 2 3 0.5 10 20 30\n", 0.5, [10, 20, 30]),
        ("\ufeff1 2 3\n", None, None),
        ("x y z r g b\n1 2 3 0.5 0 1\n", None, [128, 0, 255]),
        ("Easting, Northing, Elevation, label\n1, 2, 3, wall\n", None, None),
        ("1,0 2,0 3,0\n", None, None),
    ],
)
def test_columns_are_found(tmp_path: Path, text: str, intensity: float | None, color: list[int] | None) -> None:
    (tmp_path / "a.csv").write_text(text, encoding="utf-8")
    got = read_all(open_scans([tmp_path / "a.csv"]))
    np.testing.assert_array_equal(got.xyz, [[1, 2, 3]])
    assert (None if got.intensity is None else got.intensity.tolist()) == (None if intensity is None else [intensity])
    assert (None if got.color is None else got.color.tolist()) == (None if color is None else [color])


def test_clouds_of_a_pts_file_are_stations(tmp_path: Path) -> None:
    clouds = [make_cloud(30, seed=1), make_cloud(40, seed=2)]
    (tmp_path / "a.pts").write_text("".join(f"{len(c.xyz)}\n{text_rows(c)}" for c in clouds))
    source = open_scans([tmp_path / "a.pts"])
    got = read_all(source)
    assert len(source.stations) == 2
    assert not any(place.known for place in source.stations)
    np.testing.assert_array_equal(got.station, np.repeat([0, 1], [30, 40]))
    np.testing.assert_array_equal(got.xyz, np.vstack([c.xyz for c in clouds]))


def test_ptx_scans_with_poses_and_missing_returns(tmp_path: Path) -> None:
    clouds = [make_cloud(60, seed=1), make_cloud(40, seed=2)]
    places = [station("a"), station("b", position=(-300.0, 40.0, 2.0))]
    missing = [np.zeros(60, bool), np.zeros(40, bool)]
    missing[0][[0, 5, 59]] = True
    text = "".join(ptx_scan(c, p, 10, m) for c, p, m in zip(clouds, places, missing, strict=True))
    (tmp_path / "a.ptx").write_text(text)
    source = open_scans([tmp_path / "a.ptx"])
    got = read_all(source, 17)
    assert source.dropped.zero == 3
    assert source.point_count == 100
    assert [place.grid for place in source.stations] == [Grid(6, 10), Grid(4, 10)]
    for place, truth in zip(source.stations, places, strict=True):
        assert place.known
        np.testing.assert_allclose(place.position, truth.position, rtol=0, atol=1e-12)
        np.testing.assert_allclose(place.rotation, truth.rotation, rtol=0, atol=1e-12)
    kept = [~m for m in missing]
    truth = np.vstack([c.xyz[k] for c, k in zip(clouds, kept, strict=True)])
    np.testing.assert_allclose(got.xyz, truth, rtol=0, atol=5e-9)
    order = np.concatenate([np.flatnonzero(kept[0]) % 6, np.flatnonzero(kept[1]) % 4])
    np.testing.assert_array_equal(got.row, order)
    columns = np.concatenate([np.flatnonzero(kept[0]) // 6, np.flatnonzero(kept[1]) // 4])
    np.testing.assert_array_equal(got.column, columns)


def test_ptx_that_is_not_rigid_is_refused(tmp_path: Path) -> None:
    lines = ptx_scan(make_cloud(10), station(), 5).splitlines()
    for k in (6, 7, 8):
        lines[k] = " ".join(str(2 * float(word)) for word in lines[k].split())
    (tmp_path / "a.ptx").write_text("\n".join(lines))
    with pytest.raises(BimVerifyError, match="scales"):
        open_scans([tmp_path / "a.ptx"])


def test_pcd_viewpoint_is_the_scanner(tmp_path: Path) -> None:
    cloud = make_cloud(60)
    write_pcd(tmp_path / "a.pcd", cloud, "binary_compressed", height=6, viewpoint="1 2 3 0.5 0.5 0.5 0.5")
    source = open_scans([tmp_path / "a.pcd"])
    (place,) = source.stations
    assert place.known
    assert place.grid == Grid(6, 10)
    np.testing.assert_array_equal(place.position, [1, 2, 3])
    np.testing.assert_allclose(place.rotation, [[0, 0, 1], [1, 0, 0], [0, 1, 0]], atol=1e-15)
    got = read_all(source, 7)
    np.testing.assert_allclose(got.xyz, cloud.xyz, rtol=0, atol=1e-14)
    np.testing.assert_array_equal(got.row, np.arange(60) // 10)
    np.testing.assert_array_equal(got.column, np.arange(60) % 10)
    write_pcd(tmp_path / "b.pcd", cloud, "ascii")
    assert not open_scans([tmp_path / "b.pcd"]).stations[0].known


def test_real_lzf_back_references(tmp_path: Path) -> None:
    """Overlapping and long references, as the packer of the library makes them."""
    from bim_verify.core.scans.pcd import _unpack_lzf

    packed = np.frombuffer(b"\x02abc" + bytes([5 << 5, 2]) + bytes([7 << 5, 20, 0]), np.uint8)
    plain = np.zeros(64, np.uint8)
    assert _unpack_lzf(packed, plain) == 39
    assert plain[:39].tobytes() == b"abc" + b"abcabca" + b"a" * 29
    for bad in (b"\x05ab", b"\x20\x05", b"\xe0", b"\x00a\xff\xff\x00"):
        assert _unpack_lzf(np.frombuffer(bad, np.uint8), plain) == -1
