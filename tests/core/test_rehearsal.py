"""Kernels compiled ahead: the rehearsal runs, and its process never outlives the work."""

from __future__ import annotations

import subprocess
import sys

import pytest

from bim_verify.core.simulation import rehearsal


def test_the_rehearsal_runs_through() -> None:
    rehearsal.rehearse()


def test_its_process_ends_with_the_work(monkeypatch: pytest.MonkeyPatch) -> None:
    started: list[subprocess.Popen[bytes]] = []

    def popen(*_: object, **__: object) -> subprocess.Popen[bytes]:
        started.append(real([sys.executable, "-c", "import time; time.sleep(600)"]))
        return started[0]

    real = subprocess.Popen
    monkeypatch.setattr(rehearsal.subprocess, "Popen", popen)
    with pytest.raises(KeyError), rehearsal.kernels_ahead():
        assert started[0].poll() is None
        raise KeyError
    assert started[0].poll() is not None


def test_without_another_process_the_work_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise OSError("no more processes")

    monkeypatch.setattr(rehearsal.subprocess, "Popen", refuse)
    with rehearsal.kernels_ahead():
        pass
