"""E57: poses, number formats, invalid states, agreement with the reference library, damage."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pye57
import pytest
from numpy.typing import NDArray
from pye57 import libe57

from bim_verify.core.errors import BimVerifyError
from bim_verify.core.scans.campaign import Grid, ReturnBlock, Station
from bim_verify.core.scans.e57_header import gps_to_iso, iso_to_gps, quaternion_to_matrix
from bim_verify.core.scans.open import open_scans
from bim_verify.core.scans.write_e57 import matrix_to_quaternion, write_e57

from .scan_data import block_of, make_cloud, read_all, station

AXES = ("cartesianX", "cartesianY", "cartesianZ")
MakeNode = Callable[[Any], Any]
FieldSpec = tuple[str, MakeNode, NDArray]


def double(image: Any) -> Any:
    return libe57.FloatNode(image, 0.0, libe57.E57_DOUBLE)


def single(image: Any) -> Any:
    return libe57.FloatNode(image, 0.0, libe57.E57_SINGLE)


def integer(low: int, high: int) -> MakeNode:
    return lambda image: libe57.IntegerNode(image, low, low, high)


def scaled(low: int, high: int, scale: float, offset: float) -> MakeNode:
    return lambda image: libe57.ScaledIntegerNode(image, low, low, high, scale, offset)


def raw_e57(path: Path, fields: list[FieldSpec], extra: dict[str, MakeNode] | None = None) -> None:
    """One scan with any record, written by the reference library."""
    with pye57.E57(str(path), "w") as file:
        image = file.image_file
        scan = libe57.StructureNode(image)
        file.data3d.append(scan)
        scan.set("guid", libe57.StringNode(image, "{1}"))
        for name, make in (extra or {}).items():
            scan.set(name, make(image))
        prototype = libe57.StructureNode(image)
        buffers = libe57.VectorSourceDestBuffer()
        kept = []
        for name, make, values in fields:
            prototype.set(name, make(image))
            kept.append(np.ascontiguousarray(values))
            buffers.append(libe57.SourceDestBuffer(image, name, kept[-1], len(values), True, True))
        points = libe57.CompressedVectorNode(image, prototype, libe57.VectorNode(image, True))
        scan.set("points", points)
        writer = points.writer(buffers)
        writer.write(len(kept[0]))
        writer.close()


def structure(**values: float) -> MakeNode:
    def make(image: Any) -> Any:
        node = libe57.StructureNode(image)
        for name, value in values.items():
            kind = libe57.IntegerNode if isinstance(value, int) else libe57.FloatNode
            node.set(name, kind(image, value))
        return node

    return make


def cartesian(xyz: NDArray[np.float64]) -> list[FieldSpec]:
    return [(name, double, xyz[:, k]) for k, name in enumerate(AXES)]


@pytest.mark.parametrize("count", [1, 9, 200_000])
def test_decoder_equals_the_reference_library(tmp_path: Path, count: int) -> None:
    """Every width of integer, both floats, packets beyond one window, streams that do not keep step."""
    rng = np.random.default_rng(count)
    fields: list[FieldSpec] = [
        ("cartesianX", single, rng.normal(0, 20, count)),
        ("cartesianY", scaled(-(2**30), 2**30 - 1, 1e-5, 3.0), rng.uniform(-900, 900, count)),
        ("cartesianZ", scaled(-1000, 2**36, 1e-6, -2.5), rng.uniform(0, 6e4, count)),
        ("intensity", integer(0, 2**17 - 5), rng.integers(0, 2**17 - 5, count).astype(np.float32)),
        ("rowIndex", integer(0, 2**13), rng.integers(0, 2**13, count).astype(np.uint16)),
        ("columnIndex", integer(7, 7), np.full(count, 7, np.uint16)),
        ("colorRed", integer(0, 255), rng.integers(0, 256, count).astype(np.uint8)),
        ("colorGreen", integer(0, 1), rng.integers(0, 2, count).astype(np.uint8)),
        ("colorBlue", integer(3, 14), rng.integers(3, 15, count).astype(np.uint8)),
        ("cartesianInvalidState", integer(0, 2), np.zeros(count, np.int8)),
        ("timeStamp", integer(-(2**62), 2**62), rng.integers(-(2**62), 2**62, count).astype(np.longlong)),
    ]
    path = tmp_path / "a.e57"
    raw_e57(path, fields)
    with pye57.E57(str(path)) as file:
        truth = file.read_scan_raw(0, ignore_unsupported_fields=True)
    for block_size in (1_000_000, 70_001):
        got = read_all(open_scans([path]), block_size)
        np.testing.assert_array_equal(got.xyz, np.column_stack([truth[name] for name in AXES]))
        np.testing.assert_array_equal(got.intensity, truth["intensity"])
        np.testing.assert_array_equal(got.row, truth["rowIndex"])
        np.testing.assert_array_equal(got.column, truth["columnIndex"])
        assert got.color is not None
        np.testing.assert_array_equal(got.color[:, 0], truth["colorRed"])
        np.testing.assert_array_equal(got.color[:, 1], truth["colorGreen"] * 255)
        np.testing.assert_array_equal(got.color[:, 2], np.round((truth["colorBlue"] - 3.0) * (255 / 11)))


def test_posed_scans_come_back_in_the_scan_frame(tmp_path: Path) -> None:
    stations = [
        Station("first", np.array([1.0, 2.0, 3.0]), quaternion_to_matrix(0.2, -0.7, 0.4, 0.5), sensor="Some scanner",
                acquired="2024-05-06T07:08:09Z"),
        Station("second", np.array([400_000.25, 5_000_000.5, 120.0]), quaternion_to_matrix(-0.9, 0.1, 0.0, 0.3)),
    ]
    rng = np.random.default_rng(2)
    offsets = [rng.normal(0, 10, (n, 3)) for n in (300, 200)]
    parts = [(0, slice(0, 100)), (1, slice(0, 200)), (0, slice(100, 300))]
    write_e57(tmp_path / "a.e57", stations, (ReturnBlock(k, offsets[k][rows]) for k, rows in parts))
    source = open_scans([tmp_path / "a.e57"])
    for place, truth in zip(source.stations, stations, strict=True):
        assert place.known
        assert (place.name, place.sensor, place.acquired) == (truth.name, truth.sensor, truth.acquired)
        np.testing.assert_array_equal(place.position, truth.position)
        np.testing.assert_allclose(place.rotation, truth.rotation, rtol=0, atol=1e-15)
    blocks = list(source.blocks())
    assert [block.station for block in blocks] == [0, 1]
    for block, truth in zip(blocks, offsets, strict=True):
        np.testing.assert_allclose(block.offsets, truth, rtol=0, atol=1e-13)
    with pye57.E57(str(tmp_path / "a.e57")) as file:
        library = file.read_scan(0, ignore_missing_fields=True)
        np.testing.assert_allclose(
            np.column_stack([library[name] for name in AXES]), offsets[0] + stations[0].position, rtol=0, atol=1e-12
        )


def test_scaled_integers_are_within_half_a_step(tmp_path: Path) -> None:
    cloud, place = make_cloud(400), station()
    write_e57(tmp_path / "a.e57", [place], [block_of(cloud, place)], scaled_integer_m=1e-3)
    got = read_all(open_scans([tmp_path / "a.e57"]))
    error = (got.xyz - cloud.xyz) @ place.rotation
    assert np.abs(error).max() <= 0.5e-3 + 1e-9
    assert np.abs(error).max() > 0.4e-3


def test_the_same_returns_give_the_same_file(tmp_path: Path) -> None:
    cloud, place = make_cloud(100), station()
    whole = block_of(cloud, place)
    halves = [
        ReturnBlock(0, whole.offsets[rows], cloud.intensity[rows], cloud.color[rows])
        for rows in (slice(0, 30), slice(30, 100))
    ]
    write_e57(tmp_path / "a.e57", [place], [whole])
    write_e57(tmp_path / "b.e57", [place], halves)
    assert (tmp_path / "a.e57").read_bytes() == (tmp_path / "b.e57").read_bytes()


def test_grid_rows_and_columns_survive(tmp_path: Path) -> None:
    cloud = make_cloud(60)
    place = Station("A", np.zeros(3), grid=Grid(rows=8, columns=10))
    row, column = np.divmod(np.arange(60, dtype=np.int32), 10)
    block = ReturnBlock(0, cloud.xyz, row=row.astype(np.int32), column=column.astype(np.int32))
    write_e57(tmp_path / "a.e57", [place], [block])
    source = open_scans([tmp_path / "a.e57"])
    assert source.stations[0].grid == Grid(8, 10)
    got = read_all(source)
    np.testing.assert_array_equal(got.row, row)
    np.testing.assert_array_equal(got.column, column)


def test_grid_without_index_bounds_follows_from_the_points(tmp_path: Path) -> None:
    xyz = make_cloud(12).xyz
    row, column = np.divmod(np.arange(12, dtype=np.uint16), 4)
    fields = [*cartesian(xyz), ("rowIndex", integer(0, 2047), row), ("columnIndex", integer(0, 511), column)]
    raw_e57(tmp_path / "a.e57", fields)
    (place,) = open_scans([tmp_path / "a.e57"]).stations
    assert place.grid == Grid(3, 4)
    assert place.known


def test_a_station_without_returns_stays(tmp_path: Path) -> None:
    cloud, places = make_cloud(10), [station("A"), station("B", position=(9.0, 9.0, 9.0))]
    write_e57(tmp_path / "a.e57", places, [block_of(cloud, places[1], 1)])
    source = open_scans([tmp_path / "a.e57"])
    assert [place.name for place in source.stations] == ["A", "B"]
    np.testing.assert_array_equal(read_all(source).station, np.ones(10))


def test_unknown_station_without_pose(tmp_path: Path) -> None:
    cloud = make_cloud(30, shift=(3000.0, 0.0, 0.0))
    place = Station("cloud", np.array([3000.0, 0.0, 0.0]), known=False)
    write_e57(tmp_path / "a.e57", [place], [block_of(cloud, place)])
    source = open_scans([tmp_path / "a.e57"])
    assert not source.stations[0].known
    np.testing.assert_array_equal(source.stations[0].position, np.round(cloud.xyz[0]))
    np.testing.assert_allclose(read_all(source).xyz, cloud.xyz, rtol=0, atol=1e-11)
    placed = open_scans([tmp_path / "a.e57"], origin=(3000.0, 5.0, 1.0))
    assert placed.stations[0].known
    np.testing.assert_allclose(read_all(placed).xyz, cloud.xyz, rtol=0, atol=1e-11)


def test_spherical_coordinates(tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    distance, azimuth, elevation = rng.uniform(1, 40, 500), rng.uniform(-3.1, 3.1, 500), rng.uniform(-1.5, 1.5, 500)
    state = rng.integers(0, 3, 500).astype(np.int8)
    raw_e57(
        tmp_path / "a.e57",
        [
            ("sphericalRange", double, distance), ("sphericalAzimuth", double, azimuth),
            ("sphericalElevation", double, elevation), ("sphericalInvalidState", integer(0, 2), state),
        ],
    )
    source = open_scans([tmp_path / "a.e57"])
    got = read_all(source)
    level = distance * np.cos(elevation)
    truth = np.column_stack([level * np.cos(azimuth), level * np.sin(azimuth), distance * np.sin(elevation)])
    np.testing.assert_allclose(got.xyz, truth[state == 0], rtol=0, atol=1e-13)
    assert source.dropped.invalid == np.count_nonzero(state)
    assert source.stations[0].known


def test_invalid_zero_and_not_finite_are_dropped_with_their_attributes(tmp_path: Path) -> None:
    xyz = make_cloud(50).xyz
    state = np.zeros(50, np.int8)
    state[[1, 2]] = (1, 2)
    xyz[3] = 0.0
    xyz[4] = (5e-4, 0.0, -5e-4)
    xyz[5, 1] = np.nan
    marks = np.arange(50, dtype=np.float32)
    fields = [*cartesian(xyz), ("cartesianInvalidState", integer(0, 2), state), ("intensity", single, marks)]
    raw_e57(tmp_path / "a.e57", fields, {"pose": lambda image: libe57.StructureNode(image)})
    source = open_scans([tmp_path / "a.e57"])
    got = read_all(source, 7)
    np.testing.assert_array_equal(got.intensity, np.delete(marks, [1, 2, 3, 4, 5]))
    np.testing.assert_array_equal(got.xyz, np.delete(xyz, [1, 2, 3, 4, 5], axis=0))
    assert (source.dropped.invalid, source.dropped.zero, source.dropped.not_finite) == (2, 2, 1)


def test_all_invalid_is_an_error(tmp_path: Path) -> None:
    fields = [*cartesian(make_cloud(5).xyz), ("cartesianInvalidState", integer(0, 2), np.full(5, 2, np.int8))]
    raw_e57(tmp_path / "a.e57", fields)
    with pytest.raises(BimVerifyError, match="no valid return"):
        read_all(open_scans([tmp_path / "a.e57"]))


def test_colors_are_scaled_by_the_limits(tmp_path: Path) -> None:
    wide = np.array([0, 100, 511, 1023], np.uint16)
    colors: list[FieldSpec] = [
        (name, integer(0, 1023), wide) for name in ("colorRed", "colorGreen", "colorBlue")
    ]
    raw_e57(tmp_path / "a.e57", [*cartesian(make_cloud(4).xyz), *colors])
    got = read_all(open_scans([tmp_path / "a.e57"]))
    assert got.color is not None
    np.testing.assert_array_equal(got.color[:, 0], [0, 25, 127, 255])


def test_gps_time() -> None:
    assert gps_to_iso(0.0) == ""
    assert gps_to_iso(float("nan")) == ""
    assert gps_to_iso(1167264018.0) == "2017-01-01T00:00:00Z"
    assert gps_to_iso(1e9) == "2011-09-14T01:46:25Z"
    for text in ("1985-06-30T23:59:59Z", "2016-12-31T23:59:59Z", "2024-02-29T12:00:00Z"):
        assert gps_to_iso(iso_to_gps(text)) == text
    assert iso_to_gps("2024-02-29T12:00:00+02:00") == iso_to_gps("2024-02-29T10:00:00Z")


def test_quaternions_round_trip() -> None:
    rng = np.random.default_rng(6)
    for q in [*rng.normal(size=(50, 4)), np.array([0.0, 1, 0, 0]), np.array([0.0, 0, 0, -1]), np.array([1.0, 0, 0, 0])]:
        q = q / np.linalg.norm(q)
        matrix = quaternion_to_matrix(*q)
        np.testing.assert_allclose(matrix @ matrix.T, np.eye(3), atol=1e-14)
        np.testing.assert_allclose(quaternion_to_matrix(*matrix_to_quaternion(matrix)), matrix, atol=1e-14)


def _crc32c(data: bytes) -> int:
    crc = 0xFFFFFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0x82F63B78 if crc & 1 else 0)
    return crc ^ 0xFFFFFFFF


def _reseal(data: bytearray) -> bytes:
    """Put right checksums on all pages."""
    for page in range(0, len(data), 1024):
        data[page + 1020 : page + 1024] = struct.pack(">I", _crc32c(bytes(data[page : page + 1020])))
    return bytes(data)


@pytest.fixture
def small(tmp_path: Path) -> Path:
    path = tmp_path / "small.e57"
    raw_e57(path, cartesian(make_cloud(100).xyz))
    return path


def test_checksums_are_checked(small: Path) -> None:
    data = bytearray(small.read_bytes())
    data[1500] ^= 1
    small.write_bytes(data)
    with pytest.raises(BimVerifyError, match="checksum"):
        read_all(open_scans([small]))
    small.write_bytes(_reseal(data))
    assert len(read_all(open_scans([small])).xyz) > 0


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (b'recordCount="100"', b'recordCount="999"'),
        (b'fileOffset="48"', b'fileOffset="99"'),
        (b'fileOffset="48"', b'fileOffset="-9"'),
        (b"<points type=", b"<pointz type="),
        (b"cartesianX type", b"cartesianQ type"),
        (b'"Float"/>', b'"Flaot"/>'),
        (b"<e57Root ", b"<e57Boot "),
        (b'recordCount="100"', b'recordCount="1e9"'),
        (b'<?xml version="1.0" encoding="UTF-8"?>', b'<!DOCTYPE a [<!ENTITY b "cc">]>      '),
    ],
)
def test_hostile_headers_are_refused(small: Path, old: bytes, new: bytes) -> None:
    data = bytearray(small.read_bytes())
    plain = b"".join(bytes(data[k : k + 1020]) for k in range(0, len(data), 1024))
    assert old in plain
    assert len(old) >= len(new)
    plain = plain.replace(old, new.ljust(len(old)))
    pages = b"".join(plain[k : k + 1020] + bytes(4) for k in range(0, len(plain), 1020))
    small.write_bytes(_reseal(bytearray(pages)))
    with pytest.raises(BimVerifyError, match=r"small\.e57"):
        read_all(open_scans([small]))


def test_random_damage_under_right_checksums(small: Path) -> None:
    """Section and packet headers overwritten: an error in one sentence, or another cloud."""
    original = small.read_bytes()
    rng = np.random.default_rng(8)
    refused = 0
    for _ in range(60):
        data = bytearray(original)
        data[int(rng.integers(8, 100))] = int(rng.integers(0, 256))
        small.write_bytes(_reseal(data))
        try:
            read_all(open_scans([small]))
        except BimVerifyError as error:
            refused += 1
            assert "\n" not in str(error)
    assert refused > 10


def test_writer_leaves_nothing_behind_when_it_fails(tmp_path: Path) -> None:
    def blocks() -> Any:
        yield block_of(make_cloud(10), station())
        raise RuntimeError("stop")

    with pytest.raises(RuntimeError):
        write_e57(tmp_path / "a.e57", [station()], blocks())
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(BimVerifyError, match="does not exist"):
        write_e57(tmp_path / "no" / "a.e57", [station()], [])
