"""The modal wrapper, driven by hand: the ``bpy`` module has no windows."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from types import SimpleNamespace

import pytest

from bim_verify.bim_verify_addon import jobs
from bim_verify.bim_verify_addon.jobs import Job, duration, rough_duration
from bim_verify.bim_verify_addon.session import SESSION
from bim_verify.core.errors import BimVerifyError
from bim_verify.core.progress import Progress


class FakeOperator(Job[int]):
    title = "Count"

    def __init__(self, work: Callable[[Progress], int]) -> None:
        self.work = work
        self.finished: list[int] = []
        self.finished_in: threading.Thread | None = None
        self.reports: list[tuple[set[str], str]] = []

    def prepare(self, context: object) -> Callable[[Progress], int]:
        return self.work

    def finish(self, context: object, value: int) -> str:
        self.finished.append(value)
        self.finished_in = threading.current_thread()
        return f"counted to {value}"

    def report(self, kind: set[str], text: str) -> None:
        self.reports.append((kind, text))


def fake_context() -> SimpleNamespace:
    shown: list[str | None] = []
    timers: list[object] = []
    manager = SimpleNamespace(
        windows=[],
        event_timer_add=lambda step, window: timers.append(1) or "timer",
        event_timer_remove=lambda timer: timers.pop(),
        modal_handler_add=lambda operator: None,
    )
    return SimpleNamespace(
        scene=SimpleNamespace(session_uid=1),
        mode="OBJECT",
        window="window",
        window_manager=manager,
        workspace=SimpleNamespace(status_text_set=shown.append),
        shown=shown,
        timers=timers,
    )


TIMER, ESC = SimpleNamespace(type="TIMER", value="NOTHING"), SimpleNamespace(type="ESC", value="PRESS")


def drive(operator: FakeOperator, context: SimpleNamespace) -> set[str]:
    until = time.monotonic() + 20
    while time.monotonic() < until:
        answer = operator.modal(context, TIMER)
        if answer & {"FINISHED", "CANCELLED"}:
            return answer
        time.sleep(0.005)
    raise AssertionError("the job did not end")


def test_work_runs_in_a_thread_and_finishes_on_the_main_thread() -> None:
    ran_in: list[threading.Thread] = []
    release = threading.Event()

    def work(progress: Progress) -> int:
        ran_in.append(threading.current_thread())
        progress.update(0.5, "half way")
        release.wait(20)
        return 7

    operator, context = FakeOperator(work), fake_context()
    assert operator.start(context) == {"RUNNING_MODAL"}
    assert SESSION.job is not None
    while SESSION.job.message != "half way":
        time.sleep(0.005)
    assert operator.modal(context, TIMER) == {"PASS_THROUGH"}
    assert context.shown[-1] is not None
    assert "half way   50 %" in context.shown[-1]
    assert operator.finished == []
    release.set()
    assert drive(operator, context) == {"FINISHED"}
    assert operator.finished == [7]
    assert operator.finished_in is threading.main_thread()
    assert ran_in[0] is not threading.main_thread()
    assert (SESSION.job, context.timers, context.shown[-1]) == (None, [], None)
    assert operator.reports == [({"INFO"}, "counted to 7")]


def test_escape_stops_the_work() -> None:
    def work(progress: Progress) -> int:
        while True:
            progress.update(0.1, "working")
            time.sleep(0.002)

    operator, context = FakeOperator(work), fake_context()
    operator.start(context)
    assert operator.modal(context, ESC) == {"CANCELLED"}
    operator._worker.thread.join(20)
    assert not operator._worker.thread.is_alive()
    assert operator.finished == []
    assert operator.reports == [({"WARNING"}, "Count was cancelled; nothing was changed.")]
    assert (SESSION.job, context.timers) == (None, [])


def test_after_escape_the_next_job_waits_for_the_work_to_stop() -> None:
    order: list[str] = []
    release = threading.Event()

    def stubborn(progress: Progress) -> int:
        release.wait(20)
        order.append("first")
        return 1

    def following(progress: Progress) -> int:
        order.append("second")
        return 2

    first, second, context = FakeOperator(stubborn), FakeOperator(following), fake_context()
    first.start(context)
    assert first.modal(context, ESC) == {"CANCELLED"}
    assert SESSION.job is None
    second.start(context)
    assert second.modal(context, TIMER) == {"PASS_THROUGH"}
    release.set()
    assert drive(second, context) == {"FINISHED"}
    assert (order, first.finished, second.finished) == (["first", "second"], [], [2])


def test_escape_after_the_work_has_ended_still_changes_nothing() -> None:
    operator, context = FakeOperator(lambda progress: 5), fake_context()
    operator.start(context)
    operator._worker.thread.join(20)
    assert operator.modal(context, ESC) == {"CANCELLED"}
    assert (operator.finished, SESSION.job, context.timers) == ([], None, [])
    assert operator.reports == [({"WARNING"}, "Count was cancelled; nothing was changed.")]


def test_an_error_in_the_thread_is_one_sentence() -> None:
    def work(progress: Progress) -> int:
        raise BimVerifyError("The file is cut off. Copy it again.")

    operator, context = FakeOperator(work), fake_context()
    operator.start(context)
    assert drive(operator, context) == {"CANCELLED"}
    assert operator.reports == [({"ERROR"}, "The file is cut off. Copy it again.")]


def test_a_bug_in_the_thread_is_said_in_one_sentence_and_traced(capsys: pytest.CaptureFixture[str]) -> None:
    def work(progress: Progress) -> int:
        raise ZeroDivisionError("by nothing")

    operator, context = FakeOperator(work), fake_context()
    operator.start(context)
    drive(operator, context)
    ((level, message),) = operator.reports
    assert level == {"ERROR"}
    assert "unexpected ZeroDivisionError: by nothing" in message
    assert "Traceback" in capsys.readouterr().err
    assert (SESSION.job, context.timers) == (None, [])


def test_blender_ending_the_operator_stops_the_thread() -> None:
    def work(progress: Progress) -> int:
        while True:
            progress.check()
            time.sleep(0.002)

    operator, context = FakeOperator(work), fake_context()
    operator.start(context)
    operator.cancel(context)
    assert not operator._worker.thread.is_alive()
    assert SESSION.job is None


@pytest.mark.parametrize(("seconds", "text"), [(4.4, "4 s"), (185, "3 min 05 s"), (4200, "1 h 10 min")])
def test_duration_reads_well(seconds: float, text: str) -> None:
    assert duration(seconds) == text


def test_a_repeat_in_a_window_does_not_block_it(monkeypatch: pytest.MonkeyPatch) -> None:
    soon: list[object] = []
    monkeypatch.setattr(jobs, "start_soon", soon.append)
    monkeypatch.setattr(jobs, "bpy", SimpleNamespace(app=SimpleNamespace(background=False)))
    operator = FakeOperator(lambda progress: 3)
    operator.options = SimpleNamespace(is_repeat=True, is_repeat_last=False)
    assert operator.execute(fake_context()) == {"CANCELLED"}
    assert soon == [operator]
    assert operator.finished == []
    operator.options = SimpleNamespace(is_repeat=False, is_repeat_last=False)
    assert operator.execute(fake_context()) == {"FINISHED"}
    assert operator.finished == [3]


@pytest.mark.parametrize(("seconds", "text"), [(0.4, "0 s"), (59.4, "59 s"), (59.6, "1 min"), (154, "3 min"), (7300, "2 h")])
def test_the_header_of_a_panel_gets_it_short(seconds: float, text: str) -> None:
    assert rough_duration(seconds) == text
