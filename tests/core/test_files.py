"""Outputs get into place whole, and several of them all or none."""

from __future__ import annotations

from pathlib import Path

import pytest

from bim_verify.core.errors import BimVerifyError
from bim_verify.core.files import all_or_none, make_folder, whole_file


def write(path: Path, text: str) -> None:
    with whole_file(path) as temporary:
        temporary.write_text(text)


def names(folder: Path) -> list[str]:
    return sorted(str(p.relative_to(folder)) for p in folder.rglob("*"))


def test_several_files_appear_together(tmp_path: Path) -> None:
    (tmp_path / "b").write_text("before")
    with all_or_none():
        write(tmp_path / "a", "new a")
        write(tmp_path / "b", "new b")
        write(make_folder(tmp_path / "report" / "deep") / "c", "new c")
        assert not (tmp_path / "a").exists() and (tmp_path / "b").read_text() == "before"
    assert names(tmp_path) == ["a", "b", "report", "report/deep", "report/deep/c"]
    assert (tmp_path / "a").read_text() == "new a" and (tmp_path / "b").read_text() == "new b"


@pytest.mark.parametrize("kind", [BimVerifyError, KeyboardInterrupt, OSError])
def test_when_one_fails_none_appears_and_nothing_is_left(kind: type[BaseException], tmp_path: Path) -> None:
    (tmp_path / "b").write_text("before")
    with pytest.raises((BimVerifyError, KeyboardInterrupt)), all_or_none():
        write(tmp_path / "a", "new a")
        write(tmp_path / "b", "new b")
        make_folder(tmp_path / "report" / "deep")
        with whole_file(tmp_path / "report" / "c") as temporary:
            temporary.write_text("half")
            raise kind("stopped")
    assert names(tmp_path) == ["b"] and (tmp_path / "b").read_text() == "before"


def test_when_a_file_cannot_be_moved_into_place_the_others_are_taken_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a").write_text("before")
    replace = Path.replace

    def failing(self: Path, target: Path) -> Path:
        if target.name == "c":
            raise OSError(28, "No space left on device")
        return replace(self, target)

    monkeypatch.setattr(Path, "replace", failing)
    with pytest.raises(BimVerifyError, match=r"Cannot write .*c: No space left"), all_or_none():
        for name in "abc":
            write(tmp_path / name, f"new {name}")
    assert names(tmp_path) == ["a"] and (tmp_path / "a").read_text() == "before"


def test_one_name_for_two_outputs_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BimVerifyError, match="two outputs"), all_or_none():
        write(tmp_path / "a", "1")
        write(tmp_path / "a", "2")
    assert names(tmp_path) == []


def test_a_folder_that_was_there_stays(tmp_path: Path) -> None:
    (tmp_path / "report").mkdir()
    with pytest.raises(RuntimeError), all_or_none():
        write(make_folder(tmp_path / "report") / "c", "new")
        raise RuntimeError
    assert names(tmp_path) == ["report"]


def test_a_folder_made_where_a_file_goes(tmp_path: Path) -> None:
    with pytest.raises(BimVerifyError, match="it is a folder"), all_or_none():
        write(tmp_path / "a", "new")
        make_folder(tmp_path / "a")
    assert names(tmp_path) == []
