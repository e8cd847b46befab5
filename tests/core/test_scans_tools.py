"""Thinning, description, PLY writing, reading ahead."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import plyfile
import pytest
from numpy.typing import NDArray

from bim_verify.core.errors import BimVerifyError, Cancelled
from bim_verify.core.progress import Progress
from bim_verify.core.scans.campaign import Grid, ReturnBlock, Station
from bim_verify.core.scans.info import describe, format_description
from bim_verify.core.scans.open import open_scans
from bim_verify.core.scans.read_ahead import read_ahead
from bim_verify.core.scans.thin import thin
from bim_verify.core.scans.write_e57 import write_e57
from bim_verify.core.scans.write_ply import write_ply

from .scan_data import block_of, make_cloud, read_all, station


class Stream:
    """A source in memory that cuts its blocks as it is told."""

    def __init__(self, stations: list[Station], blocks: list[ReturnBlock], size: int) -> None:
        self.stations = tuple(stations)
        self.paths = ("stream.e57",)
        self.point_count = sum(len(block.offsets) for block in blocks)
        self._blocks, self._size = blocks, size

    def blocks(self, block_size: int = 0, *, attributes: bool = False) -> Iterator[ReturnBlock]:
        for block in self._blocks:
            for k in range(0, len(block.offsets), self._size):
                rows = slice(k, k + self._size)
                color = None if block.color is None else block.color[rows]
                yield ReturnBlock(block.station, block.offsets[rows], color=color)


def _wall_and_far_wall(count: int) -> tuple[list[Station], list[ReturnBlock]]:
    """Equal angular spacing onto two surfaces at 2 m and at 10 m."""
    rng = np.random.default_rng(1)
    u, v = rng.uniform(-0.5, 0.5, (2, count))
    distance = np.where(u < 0, 2.0, 10.0)
    offsets = distance[:, None] * np.column_stack([np.ones(count), u, v])
    color = rng.integers(0, 256, (count, 3)).astype(np.uint8)
    return [station(known=True)], [ReturnBlock(0, offsets, color=color)]


def test_thinned_cloud_does_not_depend_on_blocks_or_order() -> None:
    stations, blocks = _wall_and_far_wall(20_000)
    rows = np.random.default_rng(3).permutation(20_000)
    assert blocks[0].color is not None
    shuffled = [ReturnBlock(0, blocks[0].offsets[rows], color=blocks[0].color[rows])]
    first = thin(Stream(stations, blocks, 20_000), 500)
    for other in (Stream(stations, blocks, 77), Stream(stations, shuffled, 1000)):
        for a, b in zip(first, thin(other, 500), strict=True):
            assert a is not None
            np.testing.assert_array_equal(a, b)
    assert first[0].shape == (500, 3)
    assert not np.array_equal(first[0], thin(Stream(stations, blocks, 77), 500, seed=1)[0])


def test_thinning_says_how_far_it_is_and_stops_when_asked() -> None:
    stations, blocks = _wall_and_far_wall(5000)
    said: list[tuple[float, str]] = []
    progress = Progress(lambda done, text, left: said.append((done, text)), interval_s=0.0)
    thin(Stream(stations, blocks, 1000), 500, progress=progress)
    assert [done for done, _ in said] == pytest.approx([0.2, 0.4, 0.6, 0.8, 1.0])
    assert said[0][1] == "Reading stream.e57"
    progress.cancel.set()
    with pytest.raises(Cancelled):
        thin(Stream(stations, blocks, 1000), 500, progress=progress)


def test_thinned_points_are_returns_and_near_surfaces_do_not_take_all() -> None:
    stations, blocks = _wall_and_far_wall(20_000)
    xyz, number, color = thin(Stream(stations, blocks, 1000), 1000)
    everything = {tuple(row) for row in blocks[0].offsets + stations[0].position}
    assert all(tuple(row) in everything for row in xyz)
    assert color is not None
    assert not number.any()
    near = np.count_nonzero((xyz - stations[0].position)[:, 0] < 5)
    assert 15 <= near <= 75  # a share of 4 / (4 + 100) is expected: 38


def test_thin_keeps_all_points_of_a_small_cloud(tmp_path: Path) -> None:
    cloud = make_cloud(50)
    np.save(tmp_path / "a.npy", cloud.xyz)
    xyz, _, color = thin(open_scans([tmp_path / "a.npy"]), 1000)
    assert color is None
    np.testing.assert_array_equal(xyz[np.lexsort(xyz.T)], cloud.xyz[np.lexsort(cloud.xyz.T)])


def test_describe(tmp_path: Path) -> None:
    cloud = make_cloud(60)
    place = Station("Hall\x1b", np.array([1.0, 2.0, 3.0]), grid=Grid(6, 10), sensor="Scanner X",
                    acquired="2024-05-06T07:08:09Z")
    row, column = (index.astype(np.int32) for index in np.divmod(np.arange(60), 10))
    offsets = cloud.xyz - place.position
    offsets[7] = 0.0
    write_e57(tmp_path / "a.e57", [place], [ReturnBlock(0, offsets, cloud.intensity, None, row, column)])
    found = json.loads(json.dumps(describe(tmp_path / "a.e57")))
    kept = np.delete(cloud.xyz, 7, axis=0)
    assert (found["format"], found["points"], found["returns"]) == ("E57", 60, 59)
    assert found["dropped"] == {"invalid": 0, "zero": 1, "not_finite": 0}
    np.testing.assert_allclose(found["bounds"], [kept.min(axis=0), kept.max(axis=0)], atol=1e-12)
    (only,) = found["stations"]
    assert only["position"] == [1.0, 2.0, 3.0]
    assert only["grid"] == [6, 10]
    assert (only["intensity"], only["color"]) == (True, False)
    assert (only["sensor"], only["acquired"]) == ("Scanner X", "2024-05-06T07:08:09Z")
    assert only["farthest"] == pytest.approx(np.linalg.norm(kept - place.position, axis=1).max())
    only["name"] = "Hall\x1b[2J"
    text = format_description(found)
    assert "59 returns of 60 points (dropped: 1 zero)" in text
    assert "at 1.000, 2.000, 3.000 m" in text
    assert "\x1b" not in text


def test_describe_unknown_position(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", make_cloud(10).xyz)
    found = describe(tmp_path / "a.npy")
    assert found["stations"][0]["position"] is None
    assert "scanner position unknown" in format_description(found)


def test_written_ply_reads_in_another_library(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    count = 300_000
    fields: dict[str, NDArray] = {
        "x": rng.normal(size=count), "y": rng.normal(size=count), "z": rng.normal(size=count),
        "red": rng.integers(0, 256, count).astype(np.uint8), "m_occ": rng.random(count).astype(np.float32),
        "element": rng.integers(-1, 2**31 - 1, count), "seen": rng.random(count) < 0.5,
    }
    write_ply(tmp_path / "a.ply", fields, comments=["two\nlines"])
    ply = plyfile.PlyData.read(tmp_path / "a.ply")
    assert ply.comments == ["two lines"]
    assert [p.val_dtype for p in ply["vertex"].properties] == ["f8", "f8", "f8", "u1", "f4", "i4", "u1"]
    for name, values in fields.items():
        np.testing.assert_array_equal(ply["vertex"][name], values)
    np.testing.assert_array_equal(
        read_all(open_scans([tmp_path / "a.ply"])).xyz, np.column_stack([fields[axis] for axis in "xyz"])
    )


def test_ply_writer_refuses_what_ply_cannot_hold(tmp_path: Path) -> None:
    good = np.zeros(3)
    for fields in (
        {"x": good, "y": np.zeros(2)}, {"x y": good}, {"x": np.zeros((3, 3))}, {"x": np.full(3, 2**40)},
        {"x": np.zeros(3, complex)},
    ):
        with pytest.raises(ValueError, match=r".+"):
            write_ply(tmp_path / "a.ply", fields)
    with pytest.raises(BimVerifyError, match="does not exist"):
        write_ply(tmp_path / "no" / "a.ply", {"x": good})
    assert list(tmp_path.iterdir()) == []


def test_read_ahead_hands_on_items_and_errors() -> None:
    def items() -> Iterator[int]:
        yield from range(5)
        raise BimVerifyError("bad")

    got = []
    with pytest.raises(BimVerifyError, match="bad"):
        for item in read_ahead(items):
            got.append(item)
    assert got == list(range(5))


def test_read_ahead_ends_its_thread_when_the_receiver_stops() -> None:
    before = threading.active_count()
    closed = threading.Event()

    def items() -> Iterator[int]:
        try:
            yield from range(10**9)
        finally:
            closed.set()

    stream = read_ahead(items)
    assert [next(stream) for _ in range(3)] == [0, 1, 2]
    stream.close()  # type: ignore[attr-defined]
    assert closed.wait(5.0)
    assert threading.active_count() == before


def test_sources_can_be_read_twice_and_stopped_early(tmp_path: Path) -> None:
    cloud, place = make_cloud(100), station()
    write_e57(tmp_path / "a.e57", [place], [block_of(cloud, place)])
    source = open_scans([tmp_path / "a.e57"])
    stream = source.blocks(10)
    next(stream)
    stream.close()  # type: ignore[attr-defined]
    np.testing.assert_array_equal(read_all(source).xyz, read_all(source, 3).xyz)
