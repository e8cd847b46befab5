"""The report page: whole, self-contained, safe with hostile names; its CSV, charts and pictures."""

from __future__ import annotations

import base64
import csv
import hashlib
import io
import itertools
import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from bim_verify.core.errors import BimVerifyError
from bim_verify.core.report import charts, html, palette, pictures
from bim_verify.core.report.camera import view_of_box
from bim_verify.core.report.csv_out import elements_csv, guard
from bim_verify.core.report.render import render_view
from bim_verify.core.report.rows import element_rows
from bim_verify.core.report.section import cut_mask
from bim_verify.core.results import STATUSES, Decision, ElementPhotos, VerificationResult

from .factory import small_result

HOSTILE = (
    "</script><script>alert(1)</script>", '"><img src=x onerror=alert(1)>', "=HYPERLINK(\"http://evil\")", "{{ 7*7 }}",
    "\u202egnp.exe\ud800",
)


class Page(HTMLParser):
    """Tags with their attributes, and the text of each script and style."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.raw: list[tuple[str, str]] = []
        self._open: str | None = None
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        self._open = tag if tag in ("script", "style") else None

    def handle_data(self, data: str) -> None:
        if self._open:
            self.raw.append((self._open, data))
            self._open = None


@pytest.fixture(scope="module")
def hostile_result(tmp_path_factory: pytest.TempPathFactory) -> VerificationResult:
    result = small_result(tmp_path_factory.mktemp("model"))
    verdicts = tuple(
        replace(v, name=name, storey=name, reason=name, ifc_class=name, stations=(name,))
        for v, name in zip(result.verdicts, HOSTILE, strict=True)
    )
    model = replace(result.model, project_name=HOSTILE[0], skipped=(HOSTILE[1],), path=f"/x/{HOSTILE[1]}.ifc")
    stations = tuple(replace(s, name=HOSTILE[0], sensor=HOSTILE[3]) for s in result.stations)
    alignment = replace(result.alignment, weakest_direction=HOSTILE[0])
    return replace(
        result, verdicts=verdicts, model=model, stations=stations, alignment=alignment, warnings=HOSTILE[:2],
        method=HOSTILE[0], scan_paths=(HOSTILE[0],), scan_date=HOSTILE[1], timings={HOSTILE[0]: 1.0},
        dropped={HOSTILE[1]: 2}, photos=(
            ElementPhotos("g", HOSTILE[0], 10, 2, 0.05, 0.002, (1.0, 2.0, 3.0), 0, None, None, None,
                          {40: 0.1, 30: 0.2, 20: 0.3}),
        ),
    )  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, hostile_result: VerificationResult) -> Path:
    folder = tmp_path_factory.mktemp("out") / "report"
    small = (160, 104)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pictures, "SIZE", small)
        patch.setattr(html, "SIZE", small)
        assert html.write_report(folder, hostile_result) == folder / "index.html"
    return folder


@pytest.fixture(scope="module")
def page(folder: Path) -> Page:
    return Page((folder / "index.html").read_text(encoding="utf-8"))


def test_two_files_and_nothing_else(folder: Path) -> None:
    assert sorted(p.name for p in folder.iterdir()) == ["elements.csv", "index.html"]


def test_nothing_is_loaded_from_outside(page: Page) -> None:
    for tag, attributes in page.tags:
        assert tag not in ("link", "iframe", "object", "embed", "base")
        for name, value in attributes.items():
            if name in ("src", "href", "srcset", "action", "data", "xlink:href", "poster", "data-pick"):
                assert value is not None and value.startswith(("data:image/png;base64,", "data:text/csv", "#"))
            assert not name.startswith("on") and name != "style"
    for kind, text in page.raw:
        if kind == "style":
            assert "@import" not in text and "url(" not in text


def test_policy_allows_only_this_script_and_style(page: Page) -> None:
    policy = next(a["content"] for _, a in page.tags if a.get("http-equiv") == "Content-Security-Policy")
    assert policy and policy.startswith("default-src 'none'; img-src data:;") and "unsafe" not in policy
    script = [text for kind, text in page.raw if kind == "script" and not text.lstrip().startswith("{")]
    style = [text for kind, text in page.raw if kind == "style"]
    assert len(script) == len(style) == 1
    for text in (*script, *style):
        assert base64.b64encode(hashlib.sha256(text.encode()).digest()).decode() in policy


def test_hostile_names_stay_text(page: Page, folder: Path) -> None:
    assert sum(tag == "script" for tag, _ in page.tags) == 2
    assert all(attributes.get("src") != "x" for _, attributes in page.tags)
    text = (folder / "index.html").read_text(encoding="utf-8")
    assert "alert(1)</script>" not in text and "<img src=x" not in text
    assert "{{ 7*7 }}" in text
    data = json.loads(next(t for kind, t in page.raw if kind == "script" and t.lstrip().startswith("{")))
    assert {HOSTILE[0], HOSTILE[1]} <= {row["name"] for row in data["rows"]}


def test_every_element_has_a_row_most_urgent_first(page: Page, hostile_result: VerificationResult) -> None:
    rows = [a["id"] for t, a in page.tags if t == "tbody" and a.get("class") == "entry"]
    assert sorted(rows) == [f"e{i}" for i in range(len(hostile_result.verdicts))]
    statuses = [hostile_result.verdicts[int(str(r)[1:])].status for r in rows]
    assert statuses == ["ABSENT", "DEVIATING", "PARTIAL", "NOTOBSERVED", "CONFIRMED"]


def test_pictures_of_every_kind(page: Page) -> None:
    images = [a for t, a in page.tags if t == "img"]
    assert {a["class"] for a in images} == {"m-status", "m-deviation", "m-evidence"}
    for attributes in images:
        raw = base64.b64decode(str(attributes["src"]).split(",")[1])
        assert Image.open(io.BytesIO(raw)).size == (160, 104)


def test_csv_is_guarded_and_the_same_inside(page: Page, folder: Path) -> None:
    raw = (folder / "elements.csv").read_bytes()
    link = next(a["href"] for t, a in page.tags if t == "a" and "download" in a)
    assert base64.b64decode(str(link).split(",")[1]) == raw
    rows = list(csv.DictReader(io.StringIO(raw.decode("utf-8-sig"))))
    assert len(rows) == len(HOSTILE)
    assert rows[2]["Name"] == "'" + HOSTILE[2]
    assert rows[1]["Displacement_mm"] == "12.00" and rows[2]["Displacement_mm"] == ""
    assert [guard(t) for t in ("=1", " +1", "@x", "\tx", "-2")] == ["'=1", "' +1", "'@x", "'\tx", "'-2"]
    assert [guard(t) for t in ("W-1", "")] == ["W-1", ""]
    assert [guard(t) for t in ('W;=1+2;', 'W;"=H(1)', 'a; b', 'a\n-1')] == ["W;'=1+2;", "W;\"'=H(1)", "a; b", "a\n'-1"]


def test_csv_numbers_need_no_guard(hostile_result: VerificationResult) -> None:
    behind = replace(hostile_result.verdicts[0], deviation_median=-0.0031)
    text = elements_csv(replace(hostile_result, verdicts=(behind, *hostile_result.verdicts[1:]))).decode("utf-8-sig")
    assert next(csv.DictReader(io.StringIO(text)))["DeviationMedian_mm"] == "-3.10"


def test_unwritable_folder(tmp_path: Path, hostile_result: VerificationResult) -> None:
    (tmp_path / "file").write_text("x")
    with pytest.raises(BimVerifyError, match="Cannot make the folder"):
        html.write_report(tmp_path / "file", hostile_result)
    assert [p.name for p in tmp_path.iterdir()] == ["file"]


def test_nothing_measured_still_makes_a_page(
    hostile_result: VerificationResult, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pictures, "SIZE", (64, 48))
    monkeypatch.setattr(html, "SIZE", (64, 48))
    evidence = hostile_result.evidence
    blank = replace(evidence, deviation=np.full_like(evidence.deviation, np.nan))
    text = html.render_page(replace(hostile_result, evidence=blank, stations=(), timings={}, dropped={}, warnings=()))
    assert "Nothing was measured near a planned surface." in text and "NaN" not in text


def test_headline_counts(hostile_result: VerificationResult) -> None:
    assert html.headline(hostile_result) == (
        "1 of 5 elements are confirmed at LOA30. 1 deviates and 1 is absent. "
        "2 could not be decided for want of evidence."
    )


def test_decisions_count_and_are_told_apart(hostile_result: VerificationResult) -> None:
    absent = next(v for v in hostile_result.verdicts if v.status == "ABSENT")
    decision = Decision("CONFIRMED", "behind <b>the shelf</b>", "A. Modeller", "2026-01-02", "ABSENT")
    decided = replace(hostile_result, decisions={absent.global_id: decision})
    assert html.headline(decided).startswith(f"{hostile_result.count('CONFIRMED') + 1} of")
    assert html.headline(decided).endswith("A person overruled 1 verdict.")
    page = html.render_page(decided)
    assert page.count("decided; computed absent") == 1
    assert "<b>the shelf" not in page
    rows = {row["id"]: row for row in element_rows(decided)}
    assert rows[absent.global_id]["status"] == "CONFIRMED"
    assert rows[absent.global_id]["decision"]["computed"] == "ABSENT"
    assert rows[absent.global_id]["reason"] == absent.reason
    assert sum(row["decision"] is not None for row in rows.values()) == 1


def test_deviation_chart_adds_up(hostile_result: VerificationResult) -> None:
    chart = charts.deviation_histogram(hostile_result, 0.015)
    assert chart is not None
    shares = [float(s) for s in re.findall(r": ([\d.]+) % of the measured area", chart)]
    assert sum(shares) == pytest.approx(100.0, abs=0.1 * len(shares))


def test_formats() -> None:
    assert html.format_mm(-0.04, 1, True) == "0.0" and html.format_mm(-1.26, 1, True) == "−1.3"
    assert html.format_mm(None) == "–" and html.format_mm(float("nan")) == "–"
    assert html.format_percent(0.9999) == "99 %" and html.format_percent(0.0001) == "1 %"
    assert html.format_percent(1.0) == "100 %" and html.format_percent(0.0) == "0 %"


def test_render_shows_each_element_in_its_colour(hostile_result: VerificationResult) -> None:
    model = hostile_result.model
    paint = np.eye(3)[model.triangle_element % 3]
    size = (200, 140)
    image = render_view(model, view_of_box(model.bounds, 238, 30, size), size, face_colors=paint)
    assert image.shape == (140, 200, 4) and image.dtype == np.uint8
    solid = image[image[..., 3] == 255][:, :3].astype(int)
    assert all((solid.argmax(axis=1) == channel).any() for channel in range(3))
    assert (image[0, 0, 3], image[-1, -1, 3]) == (0, 0)
    flat = render_view(
        model, view_of_box(model.bounds, 238, 30, size), size, samples=hostile_result.samples,
        sample_colors=np.tile([1.0, 0.0, 0.0], (len(hostile_result.samples), 1)), background=(1.0, 1.0, 1.0),
    )  # fmt: skip
    assert flat.shape == (140, 200, 3)
    inside = flat[image[..., 3] == 255].astype(int)
    assert (inside[:, 0] > inside[:, 1]).all() and (flat[0, 0] == 255).all()


def test_section_fills_walls_with_their_area(hostile_result: VerificationResult) -> None:
    """Three walls and a post stand on the slab, all cut at 1.2 m; the room between them stays open."""
    model = hostile_result.model
    size = (900, 700)
    camera = view_of_box(model.bounds, 270, 90, size, cut_z=1.2 - model.origin[2])
    mask = cut_mask(model, camera, size)
    pixel = camera.width / size[0]
    area = np.bincount(mask[mask >= 0], minlength=5) * pixel**2
    assert area == pytest.approx([4.0 * 0.2, 4.0 * 0.2, 0.2 * 2.6, 0.0, 0.04], abs=0.03)
    assert not (cut_mask(model, replace(camera, cut_z=99.0), size) >= 0).any()


def test_floor_is_where_the_walls_stand(hostile_result: VerificationResult) -> None:
    model = hostile_result.model
    one = replace(model, elements=tuple(replace(e, storey="Ground") for e in model.elements))
    assert pictures.floors(one) == [("Ground", pytest.approx(0.0 - model.origin[2]), 5)]


def test_statuses_stay_apart_in_colour_blindness() -> None:
    """Smallest CIE 1976 difference of any two status colours, for the three deficiencies (Machado et al. 2009)."""
    to_xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
    seen_by = {
        "normal": np.eye(3),
        "protan": [[0.152, 1.053, -0.205], [0.115, 0.786, 0.099], [-0.004, -0.048, 1.052]],
        "deutan": [[0.367, 0.861, -0.228], [0.280, 0.673, 0.047], [-0.012, 0.043, 0.969]],
        "tritan": [[1.256, -0.077, -0.179], [-0.078, 0.931, 0.148], [0.005, 0.691, 0.304]],
    }
    linear = palette.to_linear([palette.STATUS_COLORS[s] for s in STATUSES])
    for matrix in seen_by.values():
        xyz = np.clip(linear @ np.asarray(matrix).T, 0, 1) @ to_xyz.T / [0.9505, 1.0, 1.089]
        f = np.cbrt(xyz)
        lab = np.stack([116 * f[:, 1] - 16, 500 * (f[:, 0] - f[:, 1]), 200 * (f[:, 1] - f[:, 2])], axis=1)
        assert min(np.linalg.norm(a - b) for a, b in itertools.combinations(lab, 2)) > 15.0


def test_deviation_colours_are_signed_and_saturate() -> None:
    colors = palette.deviation_color([-0.05, -0.015, 0.0, 0.015, np.nan], 0.015)
    assert np.array_equal(colors[0], colors[1])
    assert colors[1, 2] > colors[1, 0] and colors[3, 0] > colors[3, 2]
    assert np.ptp(colors[2]) < 0.05 and tuple(colors[4]) == palette.UNMEASURED
    assert palette.from_linear(palette.to_linear([0.0, 0.02, 0.5, 1.0])) == pytest.approx([0.0, 0.02, 0.5, 1.0])


def test_belief_colours_mix_in_proportion() -> None:
    colors = palette.belief_color([1.0, 0.0, 0.5, np.nan], [0.0, 0.0, 0.5, 0.0], [0.0, 1.0, 0.0, 0.0])
    occupied, empty, unknown = (np.array(palette.BELIEF_COLORS[n]) for n in ("occupied", "empty", "unknown"))
    assert colors == pytest.approx(np.stack([occupied, unknown, (occupied + empty) / 2, unknown]))
