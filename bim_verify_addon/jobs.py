"""How long work runs: in a worker thread with progress, time left and Esc in a window; at once without one.

An operator derives from ``Job`` and has three parts. ``prepare`` reads the scene and returns the work; the work knows
no Blender; ``finish`` changes the scene. So a job that is cancelled or fails leaves the scene as it was.
"""

from __future__ import annotations

import threading
import traceback
from collections.abc import Callable, Iterable
from typing import Any, ClassVar, Generic, TypeVar

import bpy

from ..core.errors import BimVerifyError, Cancelled
from ..core.progress import Progress
from . import bonsai
from .scene import leave_edit_mode
from .session import SESSION, RunningJob

T = TypeVar("T")
Work = Callable[[Progress], T]
TICK_S = 0.1
SETTLED_S = 0.3
"""After the end of a job its result is drawn."""
LONGEST_WAIT_S = 10.0
"""For a job to notice that Blender ends it; compiled code cannot be stopped half-way."""


class Worker(Generic[T]):
    """The thread of one job. It never touches the operator, which Blender may free while the work still runs."""

    def __init__(self, title: str, work: Work[T]) -> None:
        self.job = RunningJob(title)
        self.progress = Progress(self._note)
        self.outcome: T | BaseException = Cancelled()
        self._before = SESSION.ending
        self.thread = threading.Thread(target=self._run, args=(work,), name=title, daemon=True)

    def _run(self, work: Work[T]) -> None:
        try:
            if self._before is not None:
                self.job.message = "Waiting for the cancelled job to stop"
                self._before.join()
            self.outcome = work(self.progress)
        except BaseException as error:
            self.outcome = error

    def _note(self, fraction: float, message: str, seconds_left: float | None) -> None:
        self.job.fraction, self.job.message, self.job.seconds_left = fraction, message, seconds_left


class Job(Generic[T]):
    """Mixed into an operator; the operator gives ``prepare`` and ``finish``."""

    title: ClassVar[str] = ""
    panel_settings: ClassVar[tuple[str, ...]] = ()
    """A property group of the scene, and those of its settings that are properties of the operator too."""

    def prepare(self, context: bpy.types.Context) -> Work[T]:
        """Read what is needed (main thread) and return the work. May raise BimVerifyError."""
        raise NotImplementedError

    def finish(self, context: bpy.types.Context, value: T) -> str:
        """Put the result into the scene (main thread); one sentence for the status bar."""
        raise NotImplementedError

    def take_settings(self, context: bpy.types.Context) -> None:
        """What the caller did not say is as the panel has it."""
        if not self.panel_settings:
            return
        group, *names = self.panel_settings
        settings = getattr(context.scene, group)
        for name in names:
            if not self.properties.is_property_set(name):
                setattr(self, name, getattr(settings, name))

    def warn(self, warnings: Iterable[str]) -> None:
        """What a person should know of a result, into Blender's list of reports."""
        for warning in warnings:
            self.report({"WARNING"}, warning)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Do all of it now: in background mode, in the ``bpy`` module, from a script.

        Repeated by a person (a setting changed in the redo panel, Shift R), it is started anew beside the window.
        """
        if repeated(self) and not bpy.app.background and context.window is not None:
            start_soon(self)
            return {"CANCELLED"}
        try:
            self.take_settings(context)
            work = self.prepare(context)
            value = work(Progress())
        except Exception as error:
            return self._failed(error)
        return self._finished(context, value)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event | None) -> set[str]:
        """In a window: start the worker thread, ``modal`` takes over. Without one: do all of it now."""
        if bpy.app.background or context.window is None:
            return self.execute(context)
        return self.start(context)

    def start(self, context: bpy.types.Context) -> set[str]:
        """Start the worker thread and the timer that watches it."""
        try:
            self.take_settings(context)
            work = self.prepare(context)
        except Exception as error:
            return self._failed(error)
        self._worker, self._scene, self._project = Worker(self.title, work), context.scene.session_uid, bonsai.live_file()
        SESSION.job = self._worker.job
        self._timer = context.window_manager.event_timer_add(TICK_S, window=context.window)
        context.window_manager.modal_handler_add(self)
        self._worker.thread.start()
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Show progress; notice Esc; hand over when the thread has ended."""
        if event.type == "ESC" and event.value == "PRESS":
            self._leave(context)
            return self._failed(Cancelled())
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        if self._worker.thread.is_alive():
            context.workspace.status_text_set(status_line(self._worker.job))
            _redraw(context)
            return {"PASS_THROUGH"}
        self._close(context)
        outcome = self._worker.outcome
        if isinstance(outcome, BaseException):
            return self._failed(outcome)
        if bonsai.live_file() is not self._project:
            return self._failed(BimVerifyError(f"{self.title}: Bonsai's project is another one now; the result was dropped."))
        if context.scene.session_uid == self._scene:
            return self._finished(context, outcome)
        scene = next((scene for scene in bpy.data.scenes if scene.session_uid == self._scene), None)
        if scene is None:
            return self._failed(BimVerifyError(f"{self.title}: its scene was deleted meanwhile, so its result was dropped."))
        with context.temp_override(scene=scene, view_layer=scene.view_layers[0]):
            return self._finished(bpy.context, outcome)

    def cancel(self, context: bpy.types.Context) -> None:
        """Blender ends the operator (another file is opened, Blender quits)."""
        if hasattr(self, "_worker"):
            self._leave(context)
            self._worker.thread.join(LONGEST_WAIT_S)

    def _leave(self, context: bpy.types.Context) -> None:
        """Stop the work at its next step and forget what it finds; the next job waits for it to end."""
        self._worker.progress.cancel.set()
        SESSION.ending = self._worker.thread
        self._close(context)

    def _close(self, context: bpy.types.Context) -> None:
        SESSION.job = None
        context.window_manager.event_timer_remove(self._timer)
        if context.workspace is not None:
            context.workspace.status_text_set(None)
        _redraw(context)
        if not bpy.app.background:
            bpy.app.timers.register(_redraw_again, first_interval=SETTLED_S)

    def _finished(self, context: bpy.types.Context, value: Any) -> set[str]:
        try:
            leave_edit_mode(context)
            message = self.finish(context, value)
        except Exception as error:
            return self._failed(error)
        self.report({"INFO"}, message)
        return {"FINISHED"}

    def _failed(self, error: BaseException) -> set[str]:
        if isinstance(error, Cancelled):
            self.report({"WARNING"}, f"{self.title} was cancelled; nothing was changed.")
        elif isinstance(error, BimVerifyError):
            self.report({"ERROR"}, str(error))
        else:
            traceback.print_exception(error)
            text = " ".join(str(error).split()) or type(error).__name__
            self.report({"ERROR"}, f"{self.title} failed: unexpected {type(error).__name__}: {text}")
        return {"CANCELLED"}


def repeated(operator: Any) -> bool:
    """Blender runs the operator again with its settings of before, or those changed in the redo panel."""
    options = getattr(operator, "options", None)
    return bool(options is not None and (options.is_repeat or options.is_repeat_last))


def start_soon(operator: bpy.types.Operator) -> None:
    """Invoke the same operator with its settings from a timer, where a modal job may start."""
    values = operator.as_keywords(ignore=("filter_glob", "check_existing", "files"))
    if "files" in operator.properties:
        values["files"] = [{"name": entry.name} for entry in operator.files]
    name = operator.bl_idname

    def start() -> None:
        module, function = name.lower().replace("_ot_", ".").split(".", 1)
        getattr(getattr(bpy.ops, module), function)("INVOKE_DEFAULT", **values)

    bpy.app.timers.register(start, first_interval=0.01)


def status_line(job: RunningJob) -> str:
    """``Verify: reading scans  42 %  1 min 10 s left  (Esc cancels)``"""
    left = "" if job.seconds_left is None else f"   {duration(job.seconds_left)} left"
    return f"{job.title}: {job.message}   {100 * job.fraction:.0f} %{left}   (Esc cancels)"


def duration(seconds: float) -> str:
    """``45 s``, ``3 min 05 s``, ``1 h 10 min``."""
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60:02d} s"
    return f"{whole // 3600} h {whole % 3600 // 60:02d} min"


def rough_duration(seconds: float) -> str:
    """``45 s``, ``4 min``, ``2 h``: no longer than the header of a panel is wide."""
    if (whole := round(seconds)) < 60:
        return f"{whole} s"
    return f"{round(whole / 60)} min" if whole < 3600 else f"{round(whole / 3600)} h"


def _redraw_again() -> None:
    """Blender lays a panel out as high as it was when last drawn: one that grew overlaps the next until then."""
    _redraw(bpy.context)


def _redraw(context: bpy.types.Context) -> None:
    """Draw the sidebars again, and not the views: drawing a large cloud ten times a second would slow the job down."""
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                for region in area.regions:
                    if region.type == "UI":
                        region.tag_redraw()
