"""Names of elements, scans and photos that are scripts, paths or formulas do no harm in what each command writes."""

from __future__ import annotations

import csv
import io
import json
from html.parser import HTMLParser
from pathlib import Path

import ifcopenshell
import laspy
import numpy as np
import pye57
import pytest

from bim_verify.cli import main
from bim_verify.core.quality import prediction
from bim_verify.core.report.plain_page import Section, write_page

from .facade_data import photo_of
from .factory import make_ifc

NAMES = ("<script>alert(1)</script>", "../../x", "=1+1", "<img src=x onerror=alert(1)>", "/tmp/y\\z\"]]>&amp;")
SCAN = "<script>alert(2)<script> ..&amp;=1.xyz"


class Tags(HTMLParser):
    """What a browser would see."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.scripts = 0
        self.loads: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.scripts += tag == "script"
        named = dict(attrs)
        assert not [name for name in named if name.startswith("on")]
        self.loads += [v or "" for k, v in named.items() if k in ("src", "href") and not (v or "").startswith(("data:", "#"))]


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A house with hostile names, a scan of its floor and a wall with a hostile file name."""
    folder = tmp_path_factory.mktemp("hostile")
    make_ifc(folder / "h.ifc", names=NAMES)
    random = np.random.default_rng(0)
    floor = random.uniform([0.4, 0.4, 0.0], [3.6, 2.6, 0.0], (3000, 3))
    np.savetxt(folder / SCAN, floor, fmt="%.6f")
    return folder


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """One table of errors for all sizes."""
    table = prediction.ErrorTable(*(np.full((len(prediction.SPACINGS_M), len(prediction.NOISES_M)), 0.002) for _ in range(2)))
    monkeypatch.setattr(prediction, "make_table", lambda width, height: table)
    monkeypatch.setattr(prediction, "_made", {})


COMMANDS: dict[str, list[str]] = {
    "verify": [
        "--out", "o.ifc", "--spacing-mm", "100", "--samples", "o.ply", "--csv", "o.csv", "--xlsx", "o.xlsx", "--bcf", "o.bcf",
    ],
    "change": ["--out", "o.ifc", "--voxel-mm", "50", "--voxels", "o.ply"],
    "quality": ["--out", "o.ifc"],
    "plan": ["--out", "o.json", "--csv", "o.csv", "--loa", "10", "--scanner", "fast", "--coverage", "0.5"],
    "classify": ["--out", "o.e57"],
}  # fmt: skip


@pytest.mark.parametrize("command", COMMANDS)
def test_no_name_becomes_code_or_a_place(inputs: Path, tmp_path: Path, command: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    scans = [] if command == "plan" else [str(inputs / SCAN)]
    if command == "change":
        scans = ["--epoch", *scans]
    own = list(COMMANDS[command])
    wanted = {value for value in own if value.startswith("o.")} | {"o.log.json"}
    report = [] if command == "classify" else ["--report", "r"]
    origin = [] if command == "plan" else ["--origin", "2,1.5,1.5"]
    code = main([command, str(inputs / "h.ifc"), *scans, *own, *report, *origin, "--json", "o.log.json", "--quiet"])
    assert code == 0
    assert {p.name for p in tmp_path.iterdir()} == wanted | ({"r"} if report else set())
    assert {p.name for p in inputs.iterdir()} == {"h.ifc", SCAN}
    json.loads((tmp_path / "o.log.json").read_text())
    if report:
        folder = tmp_path / "r"
        assert {p.name for p in folder.iterdir()} <= {"index.html", "elements.csv", "stations.csv"}
        harmless((folder / "index.html").read_text(encoding="utf-8"))
    for table in tmp_path.rglob("*.csv"):
        rows = list(csv.reader(io.StringIO(table.read_text(encoding="utf-8-sig"))))
        assert not [cell for row in rows for cell in row if cell.startswith(("=", "+", "@"))]
    if "o.ifc" in wanted:
        assert set(NAMES) <= {e.Name for e in ifcopenshell.open("o.ifc").by_type("IfcElement")}
    if command == "classify":
        file = pye57.E57("o.e57")
        found = {file.get_header(k).node["name"].value() for k in range(file.scan_count)}
        assert found <= {*NAMES, "unassigned"} and len(found) > 1


def test_classes_of_a_las_file_keep_the_names_as_text(inputs: Path, tmp_path: Path) -> None:
    out = tmp_path / "o.laz"
    arguments = ["classify", str(inputs / "h.ifc"), str(inputs / SCAN), "--out", str(out), "--origin", "2,1.5,1.5", "--quiet"]
    assert main(arguments) == 0
    assert len(laspy.read(out).points) == 3000
    assert [p.name for p in tmp_path.iterdir()] == ["o.laz"]


def test_a_facade_photo_with_a_hostile_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    photo = photo_of(tmp_path, 1)
    hostile = photo.path.rename(tmp_path / "<img src=x onerror=alert(1)>.png")
    corners = ",".join(f"{v:.1f}" for v in photo.corners.ravel())
    out = tmp_path / "out"
    out.mkdir()
    monkeypatch.chdir(out)
    arguments = ["facade", str(hostile), "--out", "m.ifc", "--corners", corners, "--width", "16", "--report", "r", "--quiet"]
    assert main(arguments) == 0
    assert {p.name for p in out.iterdir()} == {"m.ifc", "r"}
    harmless((out / "r" / "index.html").read_text(encoding="utf-8"))


def harmless(page: str) -> None:
    """Our own scripts only, nothing loaded, nothing that a name brought in."""
    tags = Tags(page)
    assert tags.scripts <= 2
    assert "<script>alert" not in page and "<img src=x" not in page
    assert not [v for v in tags.loads if v and not v.endswith(".csv")]


def test_the_page_of_the_other_reports_escapes_whatever_it_is_given(tmp_path: Path) -> None:
    bad = "".join(NAMES)
    section = Section(bad, bad, columns=(bad,), rows=((bad,),))
    harmless(write_page(tmp_path, bad, bad, bad, ((bad, bad),), [section]).read_text(encoding="utf-8"))
