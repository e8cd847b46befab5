"""Slabs of a storey: over the ceilings below as well, over every part; and no building from a floor alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from shapely import Polygon, box

from bim_verify.cli import main
from bim_verify.core.planes.fit import fit_plane
from bim_verify.core.planes.noise import PointNoise
from bim_verify.core.reconstruction.building import BuiltRoom, FittedFace
from bim_verify.core.reconstruction.levels import Storey
from bim_verify.core.reconstruction.rooms import Room
from bim_verify.core.reconstruction.slabs import on_floor, outlines, shrunk
from bim_verify.core.reconstruction.storey import StoreyParts

CORNERS = np.array([[0.0, 0.0, 2.5], [1.0, 0.0, 2.5], [1.0, 1.0, 2.5], [0.0, 1.0, 2.5], [0.4, 0.3, 2.5]])
CEILING = FittedFace(fit_plane(CORNERS, np.array([0.5, 0.5, 1.0]), PointNoise()))


def storey(*outlines: Polygon, ceiling: FittedFace | None) -> StoreyParts:
    rooms = [Room(o, (), (), 0.0, 2.5) for o in outlines]
    return StoreyParts(rooms, [BuiltRoom(o, 0.0, 2.5, None, ceiling) for o in outlines], [], [])


def feet(part: StoreyParts, below: StoreyParts | None = None) -> list[Polygon]:
    return outlines(on_floor(Storey(2.8, 5.3, True, 5.3, (0,)), part, below))


@pytest.mark.parametrize(("ceiling", "area"), [(CEILING, 60.0), (None, 20.0)])
def test_a_slab_covers_the_rooms_below_whose_ceiling_was_seen(ceiling: FittedFace | None, area: float) -> None:
    (foot,) = feet(storey(box(0, 0, 5, 4), ceiling=None), storey(box(0, 0, 10, 6), ceiling=ceiling))
    assert foot.area == pytest.approx(area)


def test_every_part_of_a_storey_has_a_slab() -> None:
    assert len(feet(storey(box(0, 0, 5, 4), box(20, 0, 25, 4), ceiling=None))) == 2
    assert not feet(storey(ceiling=None), storey(box(0, 0, 5, 4), ceiling=CEILING))


def test_a_floor_alone_is_no_building(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    x, y = (v.ravel() for v in np.meshgrid(np.arange(0.0, 4.0, 0.02), np.arange(0.0, 3.0, 0.02)))
    np.savetxt(tmp_path / "floor.xyz", np.column_stack([x, y, np.zeros(len(x))]), fmt="%.3f")
    scan, out = str(tmp_path / "floor.xyz"), str(tmp_path / "o.ifc")
    assert main(["reconstruct", scan, "--origin", "2,1.5,1.5", "--out", out, "--quiet"]) == 1
    assert capsys.readouterr().err.count("\n") == 1 and not (tmp_path / "o.ifc").exists()


def test_an_outline_that_the_library_makes_nothing_of_is_still_one() -> None:
    ring = [
        (2.2933215519019985, -7.407909492139634), (2.22502056903904, -7.389609573714926),
        (2.2067194385865285, -7.457910231827109), (2.1567195861760817, -7.371309655290218),
        (-4.874035552532836, -5.487555716337056), (-4.960639652745543, -5.537557370336582),
        (-4.9423378851683015, -5.469255436267086), (-5.010640217803771, -5.450955156197116),
        (-4.924036117591059, -5.400953502197587), (-1.9302103230633119, 5.771961418198755),
        (-1.9802099547372658, 5.858564337499441), (-1.911908741601603, 5.840262657687752),
        (-1.8936071601398927, 5.908563897176754), (-1.8436075284659352, 5.821960977876062),
        (5.187058535037733, 3.93805594530254), (5.273660754850721, 3.988055405969879),
        (5.255359512098091, 3.919754328748507), (5.323660489158449, 3.901452712194474),
        (5.237058269345463, 3.8514532515271362), (2.2433216994915517, -7.321308915602743),
    ]  # fmt: skip
    whole = Polygon(ring)
    assert shrunk(whole, 0.05).area == pytest.approx(whole.buffer(-0.05).area, rel=1e-4)
    assert shrunk(box(0, 0, 3, 2), 0.05).equals_exact(box(0.05, 0.05, 2.95, 1.95), 1e-9, normalize=True)
