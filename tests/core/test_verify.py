"""The whole way from returns to verdicts, on a small house whose truth is known."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import laspy
import numpy as np
import pytest

from bim_verify.core.errors import BimVerifyError
from bim_verify.core.jobs import verify
from bim_verify.core.report.json_out import result_to_json
from bim_verify.core.results import ElementVerdict, VerificationResult
from bim_verify.core.scans.campaign import Station
from bim_verify.core.scans.write_e57 import write_e57
from bim_verify.core.simulation.box_building import ArraySource
from bim_verify.core.simulation.scanner import Scanner
from bim_verify.core.simulation.scene import Prop

from .verify_data import OPTIONS, REMOVED, SCANNER, STATIONS, built, by_name, house, scan, shifted, verified

CRATE = Prop("crate", "box", (11.0, 3.64, 0.6), (1.0, 0.66, 1.2))
"""Hides the valve and a part of the north wall."""
SHELF = Prop("shelf", "box", (8.0, 3.72, 0.8), (2.2, 0.5, 1.6))
"""Stands 3 cm before the north wall."""
MOVED = {"column": (0.04, 0.0, 0.0), "plate": (0.0, 0.0, 0.03), "east": (0.02, 0.0, 0.0), "post": (0.0, -0.008, 0.0)}
EDITS = {"cupboard": REMOVED, "ceiling": REMOVED} | {name: shifted(*by) for name, by in MOVED.items()}
STANDING = {"partition": (((6.0, 0.0, 0.0), (6.2, 1.7, 3.0)),)}
"""The rest of the partition was demolished."""


@pytest.fixture(scope="module")
def source() -> ArraySource:
    return scan(built(EDITS, (CRATE, SHELF), STANDING))


@pytest.fixture(scope="module")
def result(source: ArraySource) -> VerificationResult:
    return verified(source)


@pytest.fixture(scope="module")
def verdicts(result: VerificationResult) -> dict[str, ElementVerdict]:
    return by_name(result)


@pytest.mark.parametrize("name", ["floor", "slab", "west", "south"])
def test_what_was_built_as_planned_is_confirmed(name: str, verdicts: dict[str, ElementVerdict]) -> None:
    v = verdicts[name]
    assert v.status == "CONFIRMED" and v.significant is False
    assert v.achieved_loa in ("LOA30", "LOA40", "LOA50") and v.confirmed_ratio[30] > 0.95
    assert v.displacement is not None and v.displacement < 0.001
    assert abs(v.belief_occupied + v.belief_empty + v.belief_unknown - 1.0) < 1e-6


@pytest.mark.parametrize("name", sorted(MOVED))
def test_a_shift_is_found_within_a_millimetre(name: str, verdicts: dict[str, ElementVerdict]) -> None:
    """The plate moved by its own thickness: its underside is now where its top was planned."""
    v, true = verdicts[name], np.array(MOVED[name])
    far = np.linalg.norm(true) > 0.015
    assert v.status == ("DEVIATING" if far else "CONFIRMED")
    assert v.displacement_vector is not None and v.displacement is not None and v.displacement_sigma is not None
    np.testing.assert_allclose(v.displacement_vector, true, atol=0.001)
    assert v.displacement == pytest.approx(float(np.linalg.norm(v.displacement_vector)))
    assert 0 < v.displacement_sigma < 0.001
    assert v.significant is (name != "post"), "8 mm are within what LOA30 says of the plan itself"


def test_what_was_removed_is_absent(verdicts: dict[str, ElementVerdict]) -> None:
    """Behind the ceiling its slab shows, and behind the cupboard the wall: they are no sign that it moved."""
    for name in ("cupboard", "ceiling"):
        v = verdicts[name]
        assert v.status == "ABSENT" and v.achieved_loa == "NONE", v.reason
        assert v.displacement is None and v.significant is None and v.deviation_median is None
        assert v.belief_empty > 0.3 > v.belief_occupied


def test_what_nobody_saw_is_not_observed(verdicts: dict[str, ElementVerdict]) -> None:
    for name in ("buried", "valve"):
        v = verdicts[name]
        assert v.status == "NOTOBSERVED" and v.coverage < 0.02 and v.stations == (), v.reason
    hidden = by_name(verified(scan(built(EDITS | {"valve": REMOVED}, (CRATE, SHELF), STANDING), seed=2)))
    assert hidden["valve"].status == "NOTOBSERVED", "removed, but behind a crate: nobody can know"


def test_clutter_before_a_wall_hides_it_and_proves_nothing_else(verdicts: dict[str, ElementVerdict]) -> None:
    v = verdicts["north"]
    assert v.status in ("CONFIRMED", "PARTIAL") and v.significant is False, v.reason
    assert v.displacement is not None and v.displacement < 0.001
    assert v.coverage < verdicts["south"].coverage


def test_a_partly_demolished_wall_is_partial(verdicts: dict[str, ElementVerdict]) -> None:
    v = verdicts["partition"]
    assert v.status == "PARTIAL", v.reason
    assert 0.2 < v.belief_occupied < 0.6 and v.belief_empty > 0.3
    assert v.displacement is not None and v.displacement < 0.002


def test_nothing_was_done_and_everything_is_confirmed() -> None:
    found = by_name(verified(scan(built({}), seed=3)))
    assert {v.status for n, v in found.items() if n != "buried"} == {"CONFIRMED"}
    assert found["buried"].status == "NOTOBSERVED"
    assert not any(v.significant for v in found.values())


def same_verdicts(
    first: VerificationResult, second: VerificationResult, within: float = 1e-4, *, coverage: bool = True
) -> None:
    for a, b in zip(first.verdicts, second.verdicts, strict=True):
        assert (a.name, a.status, a.significant) == (b.name, b.status, b.significant)
        assert (a.displacement_vector is None) == (b.displacement_vector is None)
        if a.displacement_vector is not None and b.displacement_vector is not None:
            np.testing.assert_allclose(a.displacement_vector, b.displacement_vector, atol=within)
        assert not coverage or a.coverage == pytest.approx(b.coverage, abs=0.01)


def numbers(result: VerificationResult) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(json.dumps(result_to_json(result), allow_nan=False))
    del found["timings"], found["options"]["threads"], found["scans"]["paths"]
    return found


def same_numbers(first: VerificationResult, second: VerificationResult) -> None:
    assert numbers(first) == numbers(second)
    for name, value in vars(first.evidence).items():
        np.testing.assert_array_equal(value, getattr(second.evidence, name), err_msg=name)


def test_verifying_twice_gives_the_same_numbers(source: ArraySource, result: VerificationResult) -> None:
    same_numbers(result, verified(source))


@pytest.mark.parametrize("threads", [1, 2])
def test_threads_change_no_number(threads: int, source: ArraySource, result: VerificationResult) -> None:
    same_numbers(result, verified(source, threads=threads))


def test_little_memory_changes_no_number(source: ArraySource, result: VerificationResult) -> None:
    again = verified(source, memory_gb=0.004)
    same_numbers(result, dataclasses.replace(again, options=result.options))


def test_the_order_of_returns_changes_no_number(source: ArraySource, result: VerificationResult) -> None:
    random = np.random.default_rng(9)
    mixed = ArraySource(source.stations, tuple(random.permutation(o, axis=0) for o in source.offsets))
    same_numbers(result, verified(mixed))


def test_the_order_of_stations_changes_no_verdict(source: ArraySource, result: VerificationResult) -> None:
    same_verdicts(result, verified(ArraySource(source.stations[::-1], source.offsets[::-1])))


def to_e57(path: Path, source: ArraySource) -> Path:
    write_e57(path, source.stations, source.blocks())
    return path


def part(source: ArraySource, stations: Sequence[int], rows: slice = slice(None)) -> ArraySource:
    return ArraySource(tuple(source.stations[k] for k in stations), tuple(source.offsets[k][rows] for k in stations))


def test_one_file_or_two_give_the_same_verdicts(source: ArraySource, result: VerificationResult, tmp_path: Path) -> None:
    whole = verified([to_e57(tmp_path / "whole.e57", source)])
    same_verdicts(result, whole)
    halves = [
        to_e57(tmp_path / "a.e57", part(source, range(5), slice(0, None, 2))),
        to_e57(tmp_path / "b.e57", part(source, range(5), slice(1, None, 2))),
    ]
    assert len(verified(halves).stations) == 5
    same_verdicts(whole, verified(halves))
    by_station = [
        to_e57(tmp_path / "d.e57", part(source, [3, 4])), to_e57(tmp_path / "c.e57", part(source, [0, 1, 2])),
    ]  # fmt: skip
    same_verdicts(whole, verified(by_station))


def to_ptx(path: Path, source: ArraySource) -> Path:
    with path.open("w") as stream:
        for station, offsets in zip(source.stations, source.offsets, strict=True):
            x, y, z = station.position
            stream.write(f"{len(offsets)}\n1\n{x} {y} {z}\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n{x} {y} {z} 1\n")
            np.savetxt(stream, np.column_stack([offsets, np.full(len(offsets), 0.5)]), fmt="%.5f")
    return path


def test_ptx_gives_the_same_verdicts(source: ArraySource, result: VerificationResult, tmp_path: Path) -> None:
    same_verdicts(result, verified([to_ptx(tmp_path / "scan.ptx", source)]))


def write_points(path: Path, points: np.ndarray) -> Path:
    if path.suffix == ".npy":
        np.save(path, points)
    elif path.suffix == ".las":
        header = laspy.LasHeader(point_format=0, version="1.2")
        header.scales, header.offsets = np.full(3, 1e-5), np.round(points[0])
        las = laspy.LasData(header)
        las.x, las.y, las.z = points.T
        las.write(path)
    else:
        with path.open("w") as stream:
            if path.suffix == ".pts":
                stream.write(f"{len(points)}\n")
            np.savetxt(stream, points, fmt="%.6f")
    return path


@pytest.fixture(scope="module")
def alone(source: ArraySource) -> tuple[ArraySource, VerificationResult]:
    one = part(source, [0])
    return one, verified(one)


@pytest.mark.parametrize("suffix", [".pts", ".npy", ".las", ".xyz"])
def test_formats_without_a_station_give_the_same_verdicts(
    suffix: str, alone: tuple[ArraySource, VerificationResult], tmp_path: Path
) -> None:
    one, expected = alone
    position = one.stations[0].position
    path = write_points(tmp_path / f"scan{suffix}", one.offsets[0] + position)
    x, y, z = position.tolist()
    same_verdicts(expected, verified([path], origin=(x, y, z)))
    with pytest.raises(BimVerifyError, match=f"scan\\{suffix} names no scanner position.*--origin"):
        verified([path])


def test_a_thousand_kilometres_from_the_origin(source: ArraySource, result: VerificationResult, tmp_path: Path) -> None:
    away = (1_000_000.0, 200_000.0, 300.0)
    stations = tuple(dataclasses.replace(s, position=s.position + away) for s in source.stations)
    moved = ArraySource(stations, source.offsets)
    same_verdicts(result, verified(moved, house(away)))
    same_verdicts(result, verified([to_e57(tmp_path / "far.e57", moved)], house(away)))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_registration_error_is_estimated_from_the_stations(seed: int) -> None:
    true = 0.003
    many = np.concatenate([STATIONS, STATIONS + np.array([0.35, -0.45, 0.1])])
    found = verified(scan(built({}), stations=many, pose_noise=true, seed=seed, scanner=coarse(SCANNER)))
    assert true / 2 < found.stations[0].registration_sigma < 2 * true
    assert {v.registration_sigma for v in found.verdicts} == {found.stations[0].registration_sigma}


def test_without_a_registration_error_none_is_found() -> None:
    assert verified(scan(built({}), scanner=coarse(SCANNER))).stations[0].registration_sigma < 0.0005


def coarse(scanner: Scanner) -> Scanner:
    return dataclasses.replace(scanner, angular_step=np.radians(1.5))


def test_a_given_registration_error_is_used(source: ArraySource) -> None:
    found = by_name(verified(source, registration_sigma=0.004))
    assert found["west"].registration_sigma == 0.004
    sigma = found["west"].displacement_sigma
    assert sigma is not None and 0.001 < sigma < 0.0045


@cache
def a_few_moved() -> ArraySource:
    return scan(built({
        "partition": shifted(x=0.03), "cupboard": shifted(x=0.02), "post": shifted(x=0.2), "plate": REMOVED,
    }))


def test_a_place_less_certain_than_the_level_is_not_called_another_shape() -> None:
    found = by_name(verified(a_few_moved(), registration_sigma=0.009))  # LOA30: 7.5 mm is its sigma, 15 mm its bound
    assert {found[name].status for name in ("partition", "cupboard", "post")} == {"DEVIATING"}
    assert found["plate"].status == "ABSENT"
    for name in ("west", "south", "floor", "column", "valve"):
        assert found[name].status == "PARTIAL" and "known to 9 mm only" in found[name].reason
        assert found[name].confirmed_ratio[20] > 0.9 and found[name].achieved_loa == "LOA20"


def test_a_place_less_certain_than_the_bound_decides_nothing_but_a_significant_shift() -> None:
    found = by_name(verified(a_few_moved(), registration_sigma=0.05))
    for name in ("west", "south", "floor", "column", "valve", "partition", "cupboard"):
        assert found[name].status == "PARTIAL" and "known to 50 mm only" in found[name].reason
    assert found["post"].significant and found["post"].status == "DEVIATING"
    assert found["plate"].status == "ABSENT"


def test_what_may_stand_farther_off_than_it_was_looked_for_is_not_absent() -> None:
    found = by_name(verified(a_few_moved(), registration_sigma=0.15))
    assert found["plate"].status == "PARTIAL" and "known to 150 mm only" in found["plate"].reason
    assert "ABSENT" not in {v.status for v in found.values()}


def test_the_named_rules_reach_the_same_verdicts(source: ArraySource, result: VerificationResult) -> None:
    """Dempster's rule over all returns claims most. The default takes back what grazing returns say of a surface that is
    elsewhere, Yager's rule what is in conflict."""
    dempster, yager = (verified(source, fusion=rule) for rule in ("dempster", "yager"))
    for found in (dempster, yager):
        same_verdicts(result, found, coverage=False)
        e = found.evidence
        np.testing.assert_allclose(e.m_occ + e.m_emp + e.m_unk, 1.0, atol=1e-6)
    for default, most, careful in zip(result.verdicts, dempster.verdicts, yager.verdicts, strict=True):
        assert default.coverage <= most.coverage + 1e-3
        assert careful.coverage <= most.coverage + 1e-3


def test_a_named_preset(source: ArraySource) -> None:
    found = verified(source, preset="tls")
    assert by_name(found)["cupboard"].status == "ABSENT" and found.method.endswith("station/tls")
    with pytest.raises(BimVerifyError, match="no preset 'nothing'"):
        verified(source, preset="nothing")


def test_a_scan_that_is_elsewhere_is_refused(source: ArraySource) -> None:
    stations = tuple(dataclasses.replace(s, position=s.position + np.array([1000.0, 0.0, 0.0])) for s in source.stations)
    with pytest.raises(BimVerifyError, match=r"nearest station stands \d+ m from it"):
        verified(ArraySource(stations, source.offsets))


def test_a_station_of_unknown_place_is_refused(source: ArraySource) -> None:
    nowhere = ArraySource((Station("S", np.zeros(3), known=False),), source.offsets[:1], paths=("cloud.ply",))
    with pytest.raises(BimVerifyError, match=r"cloud\.ply names no scanner position"):
        verify(house(), nowhere, OPTIONS)
