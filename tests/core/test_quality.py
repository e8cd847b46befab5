"""Scan quality: spacing, noise, coverage, causes of missing area, levels, files."""

from __future__ import annotations

import dataclasses
import math
from functools import cache
from pathlib import Path

import ifcopenshell
import ifcopenshell.util.element
import numpy as np
import pytest

from bim_verify.core.errors import BimVerifyError
from bim_verify.core.jobs import quality
from bim_verify.core.progress import Progress
from bim_verify.core.quality import prediction
from bim_verify.core.quality.color import study_color
from bim_verify.core.quality.field_of_view import FieldOfViewCounter
from bim_verify.core.quality.levels import Need, corrective_actions, gsa_level, supported_loa
from bim_verify.core.quality.missing import half_lost
from bim_verify.core.quality.noise import fit_general_gaussian
from bim_verify.core.quality.options import QualityOptions
from bim_verify.core.quality.prediction import NOISES_M, SPACINGS_M, make_table
from bim_verify.core.quality.results import Measured, QualityResult
from bim_verify.core.quality.score import score_causes
from bim_verify.core.quality.write_ifc import PSET_NAME, write_quality_ifc
from bim_verify.core.scans.campaign import Grid, ReturnBlock, Station
from bim_verify.core.simulation.box_building import ArraySource, box, building_model
from bim_verify.core.simulation.campaign import Campaign, set_up
from bim_verify.core.simulation.scanner import PRESETS, Scanner, scan_station
from bim_verify.core.simulation.scene import Edit, Prop

from .templates import check_templates

STEP = math.radians(0.5)
SCANNER = dataclasses.replace(PRESETS["medium"], angular_step=STEP, sigma_range=0.002, sigma_signal=0.0, sigma_angle=0.0)
OPTIONS = QualityOptions(sample_spacing=0.1, cache=False)
ROOM = [
    box("floor", (-0.2, -0.2, -0.2), (6.2, 5.2, 0.0)), box("ceiling", (-0.2, -0.2, 2.8), (6.2, 5.2, 3.0)),
    box("south", (0.0, -0.2, 0.0), (6.0, 0.0, 2.8)), box("north", (0.0, 5.0, 0.0), (6.0, 5.2, 2.8)),
    box("west", (-0.2, -0.2, 0.0), (0.0, 5.2, 2.8)), box("east", (6.0, -0.2, 0.0), (6.2, 5.2, 2.8)),
    box("screen", (3.0, 0.0, 0.0), (3.1, 2.0, 2.8)),
]
STATIONS = np.array([[1.5, 2.5, 1.5], [1.8, 3.4, 1.4]])


@pytest.fixture(autouse=True)
def one_table(monkeypatch: pytest.MonkeyPatch) -> None:
    """All sizes share one table of errors: making all of them takes a minute."""
    monkeypatch.setattr(prediction, "make_table", lambda width, height: shared_table())
    monkeypatch.setattr(prediction, "_made", {})


@cache
def shared_table() -> prediction.ErrorTable:
    return make_table(0.4, 0.4)


def campaign(scanner: Scanner = SCANNER, props: tuple[Prop, ...] = (), edits: dict[int, Edit] | None = None) -> Campaign:
    model = building_model(ROOM, origin=(100.0, 200.0, 5.0))
    return Campaign(
        model=model, scanner=scanner, set_ups=tuple(set_up(f"S{k}", p, 3, k) for k, p in enumerate(STATIONS)),
        edits=edits or {}, props=props, seed=3,
    )


def source_of(made: Campaign) -> ArraySource:
    offsets, stations = [], []
    for k, s in enumerate(made.set_ups):
        returns = scan_station(made.scene, s.position, s.rotation, made.scanner, k)
        offsets.append(returns.offset @ s.rotation.T)
        stations.append(Station(s.name, s.position + made.model.origin, s.rotation))
    return ArraySource(tuple(stations), tuple(offsets))


@cache
def surveyed() -> tuple[Campaign, QualityResult]:
    made = campaign(props=(Prop("crate", "box", (0.6, 4.0, 0.5), (0.6, 0.6, 1.0)),))
    return made, quality(made.model, source_of(made), OPTIONS)


def element(result: QualityResult, name: str):  # type: ignore[no-untyped-def]
    return next(e for e in result.elements if e.name == name)


def test_noise_is_that_of_the_scanner_along_the_normal() -> None:
    _, result = surveyed()
    found = element(result, "west").measured
    assert found.noise == pytest.approx(0.002 * 0.85, rel=0.25)
    assert found.coverage > 0.35


def test_spacing_is_that_of_the_returns_counted_on_the_surface() -> None:
    made, result = surveyed()
    source = source_of(made)
    points = np.concatenate([s.position + o for s, o in zip(source.stations, source.offsets, strict=True)]) - made.model.origin
    middle = (np.abs(points[:, 0]) < 0.02) & (np.abs(points[:, 1] - 1.5) < 0.5) & (np.abs(points[:, 2] - 1.4) < 0.5)
    rows = np.flatnonzero(
        (result.samples.element == 4) & result.samples.exposed & (np.abs(result.samples.position[:, 0]) < 1e-6)
        & (np.abs(result.samples.position[:, 1] - 1.5) < 0.5) & (np.abs(result.samples.position[:, 2] - 1.4) < 0.5)
    )
    counted = 1.0 / math.sqrt(middle.sum() / 1.0)
    assert np.median(result.survey.spacing[rows]) == pytest.approx(counted, rel=0.1)


def test_causes_are_right_where_a_screen_and_a_crate_hide_the_walls() -> None:
    made, result = surveyed()
    score = score_causes(result, made)
    assert score.right / score.missing > 0.95
    assert score.named / score.hidden > 0.9
    assert result.clutter
    assert any(h.occluder.startswith("clutter") for h in element(result, "west").hidden + element(result, "north").hidden)
    screen = element(result, "screen").global_id
    assert any(h.occluder == screen for h in element(result, "east").hidden + element(result, "south").hidden)
    for e in result.elements:
        if e.measured.area > 0:
            assert e.measured.coverage + sum(e.measured.missing.values()) == pytest.approx(1.0)


def test_range_and_field_of_view_are_found_from_the_returns() -> None:
    near = campaign(dataclasses.replace(SCANNER, range_max=3.5, elevation_max=math.radians(20.0)))
    result = quality(near.model, source_of(near), OPTIONS)
    score = score_causes(result, near)
    assert score.right / score.missing > 0.9
    missing = result.whole.missing
    assert missing["out of range"] > 0.01 and missing["outside the field of view"] > 0.02


def test_what_rays_pass_is_seen_through_and_what_is_black_is_absorbed() -> None:
    made = campaign(edits={6: Edit("remove")})
    result = quality(made.model, source_of(made), OPTIONS)
    assert element(result, "screen").measured.missing["seen through"] > 0.3
    dark = campaign()
    dark.scene.reflectance[4] = 1e-6
    result = quality(dark.model, source_of(dark), OPTIONS)
    west = element(result, "west").measured
    assert west.missing["absorbed"] > 0.3 and west.coverage < 0.05


def test_results_do_not_depend_on_tiles(monkeypatch: pytest.MonkeyPatch) -> None:
    made, whole = surveyed()
    monkeypatch.setattr("bim_verify.core.scans.store.INDEX_BYTES_PER_RETURN", 40_000)
    tiled = quality(made.model, source_of(made), dataclasses.replace(OPTIONS, memory_gb=0.9))
    assert np.array_equal(whole.survey.best.state, tiled.survey.best.state)
    assert whole.whole.spacing == pytest.approx(tiled.whole.spacing, rel=1e-9)


def test_nine_factors_have_a_number_or_a_reason() -> None:
    _, result = surveyed()
    assert len(result.factors) == 9
    for factor in result.factors:
        assert factor.text and ((factor.value is not None) != factor.text.startswith("not measurable"))


def test_scans_elsewhere_are_an_error() -> None:
    made = campaign()
    source = source_of(made)
    away = tuple(dataclasses.replace(s, position=s.position + 400.0) for s in source.stations)
    with pytest.raises(BimVerifyError, match="No return"):
        quality(made.model, ArraySource(away, source.offsets), OPTIONS)


@pytest.mark.parametrize("beta", [1.0, 1.5, 2.0])
def test_general_gaussian_is_found(beta: float) -> None:
    random = np.random.default_rng(1)
    size = random.gamma(1.0 / beta, 1.0, 40_000) ** (1.0 / beta) * random.choice([-1.0, 1.0], 40_000)
    found = fit_general_gaussian(0.003 * size / size.std())
    assert found is not None
    assert found.beta == pytest.approx(beta, rel=0.08) and found.sigma == pytest.approx(0.003, rel=0.02)


def test_half_lost_finds_the_edge_from_which_on_most_are_lost() -> None:
    tally = np.array([[0, 5, 80, 95, 100], [100, 95, 20, 5, 0]])
    edges = np.geomspace(1.0, 16.0, 5)
    # 95 of 100 are answered in the bin around 2.83, 20 of 100 in the next: one half lies 0.6 bins on
    assert half_lost(tally, edges) == pytest.approx(2**1.5 * 2 ** (0.45 / 0.752), rel=0.01)
    assert half_lost(tally[::-1], edges) == math.inf
    assert half_lost(np.array([[80, 100], [20, 0]]), edges[:2]) == 1.0


def test_levels() -> None:
    assert gsa_level(0.002, 0.012, 1.0, 0.2) == 4 and gsa_level(0.002, 0.02, 1.0, 0.2) == 2
    assert gsa_level(0.06, 0.01, 1.0, 0.2) == 0 and gsa_level(0.002, 0.012, 0.1, 0.2) == 0
    assert supported_loa(0.002, 0.001, 0.9, 0.2) == 40 and supported_loa(0.002, 0.012, 0.9, 0.2) == 30
    assert supported_loa(0.002, 0.001, 0.1, 0.2) is None


def measured(**missing: float) -> Measured:
    empty = dict.fromkeys(
        ("seen through", "absorbed", "too grazing", "out of range", "outside the field of view", "occluded"), 0.0
    )
    return Measured(1.0, 1.0 - sum(missing.values()), 0.02, 0.03, 1.5, 0.002, 0.5, 1.0, 5.0, 1.0, {**empty, **missing}, None)


def test_corrective_actions_follow_from_what_is_lacking() -> None:
    hidden = measured(**{"occluded": 0.5, "too grazing": 0.2})
    assert corrective_actions(hidden, Need(True, 1.0, False)) == ("AO", "RA")
    assert corrective_actions(measured(**{"out of range": 0.4}), Need(True, 1.0, False)) == ("RD",)
    assert corrective_actions(measured(), Need(False, 2.0, False)) == ("IR",)
    assert corrective_actions(measured(), Need(False, 9.0, False)) == ("RD", "IN")
    assert corrective_actions(measured(), Need(False, 1.0, False)) == ()


def test_predicted_errors_grow_with_spacing_and_noise() -> None:
    table = make_table(0.8, 0.8)
    assert table.surface.shape == (len(SPACINGS_M), len(NOISES_M))
    assert table.expected("outline", 0.04, 0.001) > 2 * table.expected("outline", 0.01, 0.001)
    assert table.expected("surface", 0.02, 0.02) > 3 * table.expected("surface", 0.02, 0.002)
    assert math.isnan(make_table(0.05, 0.05).expected("outline", 0.2, 0.001))
    between = table.expected("outline", 0.0125, 0.0015)
    ends = [table.expected("outline", s, n) for s in (0.01, 0.015) for n in (0.001, 0.002)]
    assert min(ends) <= between <= max(ends)


def test_field_of_view_counts_limits_and_gaps() -> None:
    azimuth, elevation = np.meshgrid(np.radians(np.arange(0, 300, 0.5)), np.radians(np.arange(-50, 30, 0.5)))
    away = np.stack([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)], axis=-1)
    counter = FieldOfViewCounter(np.eye(3))
    counter.add(4.0 * away.reshape(-1, 3))
    view = counter.result()
    assert math.degrees(view.elevation_min) == pytest.approx(-50, abs=0.3)
    ask = np.array([[math.cos(a), math.sin(a), 0.0] for a in np.radians([150.0, 330.0])])
    assert view.outside(ask, 0.0, view.elevation_min, view.elevation_max).tolist() == [False, True]


class ColoredSource(ArraySource):
    """One organised scan with a colour that lies ``shift`` columns off."""

    shift = 3

    def blocks(self, block_size: int = 262_144, *, attributes: bool = False):  # type: ignore[no-untyped-def]
        rows, columns = np.meshgrid(np.arange(120), np.arange(160), indexing="ij")
        random = np.random.default_rng(2)
        picture = np.kron(random.random((12, 16)), np.ones((10, 10)))
        grey = (255 * np.roll(picture, self.shift, axis=1)).astype(np.uint8).ravel()
        yield ReturnBlock(
            0, np.ones((rows.size, 3)), intensity=picture.ravel().astype(np.float32), color=np.repeat(grey[:, None], 3, axis=1),
            row=rows.ravel().astype(np.int32), column=columns.ravel().astype(np.int32),
        )


def test_a_shift_of_the_colour_is_measured_in_steps() -> None:
    station = Station("S", np.zeros(3), grid=Grid(120, 160))
    found = study_color(ColoredSource((station,), (np.ones((19200, 3)),)), [0.002], Progress())
    assert found.shift_rad == pytest.approx(3 * 0.002, rel=0.1)


def test_property_sets_in_the_units_of_the_file(tmp_path: Path) -> None:
    from bim_verify.core.model.load import load_model
    from bim_verify.core.simulation.demo import demo_campaign
    from bim_verify.core.simulation.house import write_demo_house

    write_demo_house(tmp_path / "house.ifc")
    model = load_model(tmp_path / "house.ifc", cache=False)
    made = demo_campaign(model, 1)
    made = dataclasses.replace(made, scanner=dataclasses.replace(made.scanner, angular_step=math.radians(1.5)))
    result = quality(model, source_of(made), dataclasses.replace(OPTIONS, sample_spacing=0.3))
    write_quality_ifc(tmp_path / "house.ifc", result, tmp_path / "out.ifc")
    file = ifcopenshell.open(str(tmp_path / "out.ifc"))
    told = element(result, "Kitchen wall")
    sets = ifcopenshell.util.element.get_psets(file.by_guid(told.global_id))
    check_templates(file, PSET_NAME)
    written = sets[PSET_NAME]
    assert {
        "PointSpacing", "Noise", "Coverage", "OccludedRatio", "IncidenceP95", "PredictedError", "GsaLevel", "CorrectiveAction"
    } <= set(written)
    assert written["PointSpacing"] * model.length_unit_m == pytest.approx(told.measured.spacing)
    assert written["GsaLevel"] == told.gsa_level
    with pytest.raises(BimVerifyError, match="never written"):
        write_quality_ifc(tmp_path / "house.ifc", result, tmp_path / "house.ifc")
