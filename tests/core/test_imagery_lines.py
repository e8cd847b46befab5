"""Lines in images and edges of models: where they are, how sure that is, and what is hidden."""

from __future__ import annotations

import struct
import warnings
import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from bim_verify.core.errors import BimVerifyError
from bim_verify.core.imagery.camera import Interior
from bim_verify.core.imagery.detect_lines import detect_lines
from bim_verify.core.imagery.model_edges import sharp_edges
from bim_verify.core.imagery.read_image import check_image, read_grey
from bim_verify.core.imagery.visible_edges import EdgeViewer
from bim_verify.core.jobs.facade import read_color
from bim_verify.core.simulation.box_building import box, building_model

from .photo_data import camera, room

STRAIGHT = Interior(400, 300, 300.0, 300.0, 199.5, 149.5)
BENT = Interior(400, 300, 300.0, 300.0, 199.5, 149.5, (-0.15, 0.03, 0.0, 0.0, 0.0))


def half_plane(lens: Interior, angle: float, seed: int = 0) -> np.ndarray:
    """A bright half plane whose border is a straight line through the principal point in ideal pixels, oversampled."""
    fine = (np.arange(4) + 0.5) / 4 - 0.5
    x, y = np.meshgrid((np.arange(400)[:, None] + fine).ravel(), (np.arange(300)[:, None] + fine).ravel())
    ideal = lens.undistort(np.column_stack([x.ravel(), y.ravel()]))
    side = (ideal - [lens.cx, lens.cy + 40]) @ [-np.sin(angle), np.cos(angle)]
    image = np.where(side > 0, 170.0, 80.0).reshape(300, 4, 400, 4).mean(axis=(1, 3))
    return np.clip(image + np.random.default_rng(seed).normal(0, 3, image.shape), 0, 255).astype(np.uint8)


@pytest.mark.parametrize("detector", ["lsd", "hough"])
@pytest.mark.parametrize("lens", [STRAIGHT, BENT])
def test_a_line_is_found_to_a_tenth_of_a_pixel_and_knows_its_sigma(detector, lens) -> None:  # type: ignore[no-untyped-def]
    angle = 0.21
    found = detect_lines(half_plane(lens, angle), lens, detector)
    along, across = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
    length = found.length
    assert length.sum() > 250
    for k in np.flatnonzero(length > 60):
        middle = 0.5 * (found.start[k] + found.end[k])
        off = (middle - [lens.cx, lens.cy + 40]) @ across
        direction = (found.end[k] - found.start[k]) / length[k]
        turn = np.arcsin(np.clip(direction @ across * np.sign(direction @ along), -1, 1))
        assert abs(off) < 0.15 and abs(off) < 4 * found.offset_sigma[k]
        assert abs(turn) < 4 * found.angle_sigma[k]
        assert 0 < found.weight[k] < 1


def test_an_image_of_another_size_is_refused_in_a_sentence() -> None:
    with pytest.raises(BimVerifyError, match="400 x 300 pixels"):
        detect_lines(np.zeros((300, 400), np.uint8), Interior(800, 600, 600.0, 600.0, 399.5, 299.5))


def test_a_box_has_twelve_edges_and_none_within_its_faces() -> None:
    edges = sharp_edges(building_model([box("a", (0, 0, 0), (1, 2, 3))]))
    assert sorted(np.round(edges.length, 6)) == [1.0] * 4 + [2.0] * 4 + [3.0] * 4


def test_edges_on_one_line_that_touch_are_one() -> None:
    edges = sharp_edges(building_model([box("a", (0, 0, 0), (1, 1, 1)), box("b", (1, 0, 0), (3, 1, 1))]))
    assert int((np.abs(edges.length - 3.0) < 1e-6).sum()) == 4


def test_hidden_edges_and_flush_joints_are_not_seen() -> None:
    model = building_model([
        box("left", (-1, 3, 0), (0, 3.2, 2)), box("right", (0, 3, 0), (1, 3.2, 2)),
        box("behind", (-0.5, 4, 0.5), (0.5, 4.5, 1.5)),
    ])
    edges = sharp_edges(model)
    view = replace(camera(), rotation=np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]), position=np.array([0.0, 0.0, 1.0]))
    seen = EdgeViewer(model, edges).look(view)
    assert len(seen) and "behind" not in {model.elements[e].name for e in np.unique(seen.bearers.element)}
    middle = 0.5 * (seen.start + seen.end)
    assert not (np.abs(middle[:, 0]) < 1e-3)[np.abs(seen.start[:, 2] - seen.end[:, 2]) > 0.5].any()


def test_a_flush_joint_of_two_kinds_of_elements_is_seen_and_moves_with_the_one_whose_edge_it_is() -> None:
    model = building_model([box("wall", (-2, 3, 0), (2, 3.2, 2)), box("post", (-0.1, 3, 0.2), (0.1, 3.4, 1.8))])
    kinds = [replace(e, ifc_class="IfcMember" if e.name == "post" else e.ifc_class) for e in model.elements]
    view = replace(camera(), rotation=np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]), position=np.array([0.0, 0.0, 1.0]))
    for elements, posts in ((model.elements, 0), (tuple(kinds), 4)):
        shown = replace(model, elements=elements)
        seen = EdgeViewer(shown, sharp_edges(shown)).look(view)
        inner = np.abs(0.5 * (seen.start + seen.end) - [0.0, 3.0, 1.0]).max(axis=1) < 0.9
        assert inner.sum() == posts
        assert {shown.elements[e].name for e in np.unique(seen.bearers.element[inner])} == ({"post"} if posts else set())


def test_edges_reach_as_far_as_a_barrel_lens_shows() -> None:
    model = building_model([box("beam", (-9, 3, 0.9), (9, 3.2, 1.1))])
    turned = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    for lens in (STRAIGHT, BENT):
        view = replace(camera(), interior=lens, rotation=turned, position=np.array([0.0, 0.0, 1.0]))
        seen = EdgeViewer(model, sharp_edges(model)).look(view)
        assert len(seen) >= 2
        shown = lens.distort(seen.pixel.reshape(-1, 2)).reshape(-1, 4)
        assert (shown[:, [0, 2]].min(axis=1) < 6).all() and (shown[:, [0, 2]].max(axis=1) > lens.width - 7).all()


def test_a_room_shows_its_edges() -> None:
    model = room()
    seen = EdgeViewer(model, sharp_edges(model)).look(camera())
    names = {model.elements[e].name for e in np.unique(seen.bearers.element)}
    assert {"door", "window", "cupboard", "beam"} <= names
    assert (seen.length_px >= 25).all()


def test_a_line_where_elements_cut_through_each_other_is_seen() -> None:
    model = building_model([
        box("floor", (-3, -1, -0.2), (3, 6, 0.0)), box("wall", (-3, 4, -1.0), (3, 4.3, 5.0)),
        box("ceiling", (-3, -1, 2.6), (3, 6, 2.9)),
    ])
    view = replace(camera(), rotation=np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]), position=np.array([0.1, 0.0, 1.3]))
    seen = EdgeViewer(model, sharp_edges(model)).look(view)
    for height in (0.0, 2.6):
        on = (np.abs(seen.start - [0, 4, height])[:, 1:] < 1e-6).all(axis=1) & (np.abs(seen.end[:, 2] - height) < 1e-6)
        assert np.linalg.norm(seen.end - seen.start, axis=1)[on].sum() > 4.0
    assert len(set(seen.line.tolist())) == len(seen)


def test_large_photos_are_read_without_a_warning_and_larger_ones_refused(tmp_path: Path) -> None:
    def header(side: int) -> Path:
        path = tmp_path / f"{side}.png"
        chunks = (b"IHDR" + struct.pack(">IIBBBBB", side, side, 8, 0, 0, 0, 0), b"IDAT" + bytes(8))
        path.write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(
            struct.pack(">I", len(c) - 4) + c + struct.pack(">I", zlib.crc32(c)) for c in chunks
        ))
        return path

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_image(header(12_000), (12_000, 12_000))
    for side in (13_100, 14_000, 200_000):
        with pytest.raises(BimVerifyError, match="170,000,000"):
            check_image(header(side), (side, side))


def test_grey_photos_of_16_bits_are_scaled_and_not_cut_off(tmp_path: Path) -> None:
    grey = np.linspace(0, 65535, 64).astype(np.uint16)[None, :].repeat(4, axis=0)
    for name in ("photo.png", "photo.tif"):
        Image.fromarray(grey).save(tmp_path / name)
        assert (read_grey(tmp_path / name) == grey >> 8).all()
        assert (read_color(tmp_path / name)[0][:, :, 1] == grey >> 8).all()
