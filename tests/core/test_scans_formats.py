"""Every format gives the same returns, whole or in small blocks, and says clearly when it is damaged."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from bim_verify.core.errors import BimVerifyError
from bim_verify.core.scans.open import open_scans
from bim_verify.core.scans.write_e57 import write_e57

from .scan_data import (
    Cloud,
    block_of,
    make_cloud,
    ply_header,
    ptx_scan,
    read_all,
    station,
    text_rows,
    vertex_table,
    write_las,
    write_pcd,
    write_ply_file,
)


def _write_e57(path: Path, cloud: Cloud) -> None:
    write_e57(path, [station()], [block_of(cloud, station())])


def _write_pts(path: Path, cloud: Cloud) -> None:
    path.write_text(f"{len(cloud.xyz)}\n" + text_rows(cloud))


def _write_csv(path: Path, cloud: Cloud) -> None:
    path.write_text("X,Y,Z,Intensity,R,G,B\n" + text_rows(cloud, ","))


def _write_npy(path: Path, cloud: Cloud) -> None:
    np.save(path, np.column_stack([cloud.xyz, cloud.intensity, cloud.color]))


WRITERS: dict[str, tuple[str, Callable[[Path, Cloud], None], float]] = {
    "e57": ("a.e57", _write_e57, 1e-12),
    "las": ("a.las", write_las, 1e-9),
    "laz": ("a.laz", write_las, 1e-9),
    "ply ascii": ("a.ply", lambda p, c: write_ply_file(p, c, "ascii"), 0.0),
    "ply little": ("a.ply", lambda p, c: write_ply_file(p, c, "binary_little_endian"), 0.0),
    "ply big": ("a.ply", lambda p, c: write_ply_file(p, c, "binary_big_endian"), 0.0),
    "pcd ascii": ("a.pcd", lambda p, c: write_pcd(p, c, "ascii"), 0.0),
    "pcd binary": ("a.pcd", lambda p, c: write_pcd(p, c, "binary"), 0.0),
    "pcd compressed": ("a.pcd", lambda p, c: write_pcd(p, c, "binary_compressed"), 0.0),
    "pts": ("a.pts", _write_pts, 0.0),
    "ptx": ("a.ptx", lambda p, c: p.write_text(ptx_scan(c, station(), 25)), 5e-9),
    "xyz": ("a.xyz", lambda p, c: p.write_text("// X Y Z I R G B\n" + text_rows(c)), 0.0),
    "csv": ("a.csv", _write_csv, 0.0),
    "npy": ("a.npy", _write_npy, 0.0),
}


@pytest.fixture(params=WRITERS)
def written(request: pytest.FixtureRequest, tmp_path: Path) -> tuple[Path, Cloud, float]:
    name, write, resolution = WRITERS[request.param]
    cloud = make_cloud()
    write(tmp_path / name, cloud)
    return tmp_path / name, cloud, resolution


def test_returns_come_back_within_the_resolution(written: tuple[Path, Cloud, float]) -> None:
    path, cloud, resolution = written
    source = open_scans([path])
    got = read_all(source)
    assert source.point_count == len(cloud.xyz)
    assert source.dropped.total == 0
    np.testing.assert_allclose(got.xyz, cloud.xyz, rtol=0, atol=resolution + 1e-14)
    assert got.intensity is not None
    assert got.color is not None
    np.testing.assert_array_equal(got.intensity, cloud.intensity)
    np.testing.assert_array_equal(got.color, cloud.color)


@pytest.mark.parametrize("block_size", [1, 7, 499, 500])
def test_blocks_equal_the_whole(written: tuple[Path, Cloud, float], block_size: int) -> None:
    source = open_scans([written[0]])
    whole = read_all(source)
    parts = read_all(source, block_size)
    np.testing.assert_array_equal(parts.xyz, whole.xyz)
    np.testing.assert_array_equal(parts.intensity, whole.intensity)
    np.testing.assert_array_equal(parts.color, whole.color)


def test_without_attributes_only_offsets_are_read(written: tuple[Path, Cloud, float]) -> None:
    source = open_scans([written[0]])
    got = read_all(source, attributes=False)
    assert got.intensity is None
    assert got.color is None
    assert got.row is None
    np.testing.assert_array_equal(got.xyz, read_all(source).xyz)


def test_truncated_file_is_an_error(written: tuple[Path, Cloud, float]) -> None:
    path = written[0]
    data = path.read_bytes()
    # A table that declares no count: its last row loses y and z.
    uncounted = path.suffix in (".xyz", ".csv")
    path.write_bytes(data[: data.rstrip().rfind(b"\n") + 5 if uncounted else int(len(data) * 0.9)])
    with pytest.raises(BimVerifyError, match=path.name) as caught:
        read_all(open_scans([path]))
    assert "\n" not in str(caught.value)


def test_content_decides_before_the_suffix(written: tuple[Path, Cloud, float]) -> None:
    path, cloud, resolution = written
    other = path.with_suffix(".scan")
    path.rename(other)
    np.testing.assert_allclose(read_all(open_scans([other])).xyz, cloud.xyz, rtol=0, atol=resolution + 1e-14)


def test_points_that_are_no_returns_are_counted(tmp_path: Path) -> None:
    cloud = make_cloud(20)
    cloud.xyz[3] = 0.0
    cloud.xyz[4, 1] = np.nan
    cloud.xyz[5, 2] = np.inf
    for name, write in (
        ("a.npy", _write_npy), ("a.pts", _write_pts), ("a.csv", _write_csv),
        ("a.ply", lambda p, c: write_ply_file(p, c, "ascii")), ("a.pcd", lambda p, c: write_pcd(p, c, "binary")),
    ):
        write(tmp_path / name, cloud)
        source = open_scans([tmp_path / name])
        for _ in range(2):
            got = read_all(source, 6)
            assert (source.dropped.zero, source.dropped.not_finite, source.dropped.invalid) == (1, 2, 0)
            np.testing.assert_array_equal(got.intensity, np.delete(cloud.intensity, [3, 4, 5]))


def test_withheld_las_points_are_invalid(tmp_path: Path) -> None:
    import laspy

    write_las(tmp_path / "a.las", make_cloud(20))
    las = laspy.read(tmp_path / "a.las")
    las.withheld[[2, 7]] = 1
    las.write(tmp_path / "a.las")
    source = open_scans([tmp_path / "a.las"])
    assert len(read_all(source).xyz) == 18
    assert source.dropped.invalid == 2


def test_las_colors_written_as_bytes_are_kept(tmp_path: Path) -> None:
    import laspy

    cloud = make_cloud(20)
    write_las(tmp_path / "a.las", cloud)
    las = laspy.read(tmp_path / "a.las")
    las.red, las.green, las.blue = cloud.color.astype(np.uint16).T
    las.write(tmp_path / "a.las")
    np.testing.assert_array_equal(read_all(open_scans([tmp_path / "a.las"])).color, cloud.color)


def test_far_clouds_get_a_local_origin(tmp_path: Path) -> None:
    cloud = make_cloud(50, shift=(500_000.0, 4_000_000.0, 300.0))
    _write_pts(tmp_path / "far.pts", cloud)
    source = open_scans([tmp_path / "far.pts"])
    (place,) = source.stations
    assert not place.known
    np.testing.assert_array_equal(place.position, np.round(cloud.xyz[0]))
    block = next(source.blocks())
    assert np.abs(block.offsets).max() < 50.0
    np.testing.assert_allclose(block.offsets + place.position, cloud.xyz, rtol=0, atol=1e-9)


def test_origin_places_only_unknown_stations(tmp_path: Path) -> None:
    cloud = make_cloud(50)
    _write_csv(tmp_path / "a.csv", cloud)
    _write_e57(tmp_path / "b.e57", cloud)
    source = open_scans([tmp_path / "a.csv", tmp_path / "b.e57"], origin=(3.0, 4.0, 5.0))
    assert [place.known for place in source.stations] == [True, True]
    np.testing.assert_array_equal(source.stations[0].position, [3.0, 4.0, 5.0])
    np.testing.assert_array_equal(source.stations[1].position, station().position)
    assert source.point_count == 100
    got = read_all(source)
    np.testing.assert_allclose(got.xyz, np.vstack([cloud.xyz, cloud.xyz]), rtol=0, atol=1e-12)
    np.testing.assert_array_equal(got.station, np.repeat([0, 1], 50))


def test_a_return_at_the_scanner_is_none(tmp_path: Path) -> None:
    (tmp_path / "a.xyz").write_text("1 2 3\n4 5 6\n1.0005 2 3\n1.002 2 3\n")
    source = open_scans([tmp_path / "a.xyz"], origin=(1.0, 2.0, 3.0))
    assert len(read_all(source).xyz) == 2
    assert source.dropped.zero == 2


def test_order_of_stations_is_order_of_files(tmp_path: Path) -> None:
    for name in ("b", "a"):
        _write_pts(tmp_path / f"{name}.pts", make_cloud(10))
    source = open_scans([tmp_path / "b.pts", tmp_path / "a.pts"])
    assert [place.name for place in source.stations] == ["b", "a"]
    assert source.paths == (str(tmp_path / "b.pts"), str(tmp_path / "a.pts"))


def test_a_scan_in_two_files_is_one_station(tmp_path: Path) -> None:
    cloud = make_cloud(100)
    place = station()
    write_e57(tmp_path / "whole.e57", [place], [block_of(cloud, place)])
    whole = block_of(cloud, place)
    for name, rows in (("first", slice(0, 30)), ("second", slice(30, 100))):
        part = type(whole)(0, whole.offsets[rows], None, None)
        write_e57(tmp_path / f"{name}.e57", [place], [part])
    split = open_scans([tmp_path / "first.e57", tmp_path / "second.e57"])
    assert len(split.stations) == 1
    np.testing.assert_array_equal(
        read_all(split, attributes=False).xyz, read_all(open_scans([tmp_path / "whole.e57"]), attributes=False).xyz
    )


@pytest.mark.parametrize(
    ("name", "data"),
    [
        ("empty.e57", b""),
        ("text.e57", b"hello, this is no scan\n"),
        ("text.xyz", b"hello, this is no scan\nand no numbers come\n"),
        ("zip.las", b"PK\x03\x04" + bytes(100)),
        ("model.ifc", b"ISO-10303-21;\nHEADER;\n"),
        ("short.las", b"LASF" + bytes(20)),
        ("short.npy", b"\x93NUMPY\x01\x00"),
        ("none.pts", b"0\n"),
        ("none.ply", b"ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nproperty float y\nproperty float z\n"
                     b"end_header\n"),
        ("flat.ply", b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n1\n"),
        ("list.ply", b"ply\nformat ascii 1.0\nelement vertex 1\nproperty list uchar int a\nend_header\n1\n"),
        ("headless.ply", b"ply\nformat ascii 1.0\nelement vertex 1\n"),
        ("unknown.ply", b"ply\nformat ascii 1.0\nelement vertex 1\nproperty half x\nend_header\n1\n"),
        ("zeros.xyz", b"0 0 0\n0 0 0\n"),
        ("words.xyz", b"1 2 3\n4 five 6\n"),
        ("many.pts", b"99999999999\n1 2 3\n"),
        ("odd.pts", b"1\n1 2 3\nsurprise\n"),
        ("kind.pcd", b"VERSION 0.7\nFIELDS x y z\nSIZE 3 4 4\nTYPE F F F\nWIDTH 1\nHEIGHT 1\nDATA binary\nabcdefghijk"),
        ("bomb.pcd", b"VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 300000000\nHEIGHT 1\n"
                     b"DATA binary_compressed\n\x04\x00\x00\x00\x00\xa4\x93\xd6aaaa"),
    ],
)
def test_bad_files_are_refused_in_one_sentence(tmp_path: Path, name: str, data: bytes) -> None:
    (tmp_path / name).write_bytes(data)
    with pytest.raises(BimVerifyError, match=name) as caught:
        read_all(open_scans([tmp_path / name]))
    assert "\n" not in str(caught.value)


def test_missing_files_and_folders_are_refused(tmp_path: Path) -> None:
    with pytest.raises(BimVerifyError, match=r"gone\.e57"):
        open_scans([tmp_path / "gone.e57"])
    with pytest.raises(BimVerifyError, match="folder"):
        open_scans([tmp_path])
    with pytest.raises(BimVerifyError, match="at least one"):
        open_scans([])


def test_a_file_that_goes_away_is_an_error(written: tuple[Path, Cloud, float]) -> None:
    source = open_scans([written[0]])
    written[0].unlink()
    with pytest.raises(BimVerifyError, match=written[0].name):
        read_all(source)


def test_declared_counts_are_not_trusted(tmp_path: Path) -> None:
    table = vertex_table(make_cloud(3))
    header = ply_header("binary_little_endian", table, count=10**15)
    (tmp_path / "big.ply").write_bytes(header.encode() + bytes(4) + table.tobytes())
    with pytest.raises(BimVerifyError, match="cut off"):
        open_scans([tmp_path / "big.ply"])


def test_objects_in_npy_are_never_unpickled(tmp_path: Path) -> None:
    np.save(tmp_path / "evil.npy", np.array([{"a": 1}], dtype=object), allow_pickle=True)
    with pytest.raises(BimVerifyError, match="evil"):
        open_scans([tmp_path / "evil.npy"])
    np.save(tmp_path / "flat.npy", np.zeros((5, 2)))
    with pytest.raises(BimVerifyError, match="shape"):
        open_scans([tmp_path / "flat.npy"])


def test_random_damage_never_raises_anything_else(written: tuple[Path, Cloud, float]) -> None:
    """Bytes overwritten at random, in the header above all: an error in one sentence, or another cloud."""
    path, _, _ = written
    data = np.frombuffer(path.read_bytes(), np.uint8)
    rng = np.random.default_rng(5)
    for _ in range(40):
        broken = data.copy()
        reach = len(data) if rng.random() < 0.3 else min(600, len(data))
        broken[rng.integers(0, reach, rng.integers(1, 8))] = rng.integers(0, 256)
        path.write_bytes(broken.tobytes())
        try:
            read_all(open_scans([path]))
        except BimVerifyError as error:
            assert "\n" not in str(error)
