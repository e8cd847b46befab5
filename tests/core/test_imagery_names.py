"""Image files find their cameras by names, with folders and endings or without; a camera finds its file."""

from __future__ import annotations

from pathlib import Path

import pytest

from bim_verify.core.errors import BimVerifyError
from bim_verify.core.imagery.cameras_file import camera_of, cameras_of
from bim_verify.core.imagery.image_names import image_beside, matching


@pytest.mark.parametrize(("path", "names", "found"), [
    ("photos/IMG_0001.JPG", ["IMG_0000", "IMG_0001"], [1]),
    ("a/left/0001.jpg", ["left/0001.jpg", "right/0001.jpg"], [0]),
    ("a/right/0001.jpg", ["left\\0001.jpg", "right\\0001.jpg"], [1]),
    ("0001.jpg", ["left/0001.jpg", "right/0001.jpg"], [0, 1]),
    ("0001.jpg", ["left/0001.jpg"], [0]), ("b.png", ["b.jpg", "b.png"], [1]), ("c.png", ["b.png"], []),
])
def test_names_mean_files(path: str, names: list[str], found: list[int]) -> None:
    assert matching(path, names) == found


def test_one_camera_or_a_sentence() -> None:
    assert camera_of("x/a.jpg", ["b", "a"]) == 1
    with pytest.raises(BimVerifyError, match="2 cameras are called"):
        camera_of("1.jpg", ["l/1.jpg", "r/1.jpg"])
    with pytest.raises(BimVerifyError, match=r"no camera for the image q\.jpg"):
        camera_of("q.jpg", ["a"])


def test_each_image_has_a_camera_of_its_own() -> None:
    assert cameras_of(["x/a.jpg", "b.jpg"], ["b", "a"]) == [1, 0]
    with pytest.raises(BimVerifyError, match=r"x/a\.jpg and y/a\.jpg are both taken for the camera a;"):
        cameras_of(["x/a.jpg", "b.jpg", "y/a.jpg"], ["b", "a"])


def test_a_camera_finds_its_image_beside_the_file(tmp_path: Path) -> None:
    (tmp_path / "left").mkdir()
    for name in ("IMG_1.JPG", "left/2.png", "3.jpg", "3.xml"):
        (tmp_path / name).write_bytes(b"")
    found = [image_beside(tmp_path, name) for name in ("IMG_1", "left/2.png", "elsewhere\\3.jpg", "../4.jpg", "5")]
    assert found == [tmp_path / "IMG_1.JPG", tmp_path / "left" / "2.png", tmp_path / "3.jpg", None, None]
