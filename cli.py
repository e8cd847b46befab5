"""The console script: arguments from the table of commands, progress on stderr, errors in one line, exit codes."""

from __future__ import annotations

import argparse
import os
import re
import signal
import sys
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from . import __version__
from .core.commands import COMMANDS, Argument, Command, Outcome
from .core.errors import BimVerifyError, Cancelled
from .core.files import all_or_none, check_writable
from .core.progress import Progress

DONE, FAILED, INTERRUPTED = 0, 1, 130
NUMBERS = re.compile(r"-\.?\d")
DEBUG = "BIM_VERIFY_DEBUG"
"""Environment variable: when set, an unexpected error shows its traceback."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code: 0 done, 1 an error said in one line, 2 wrong usage, 130 interrupted."""
    arguments = _parser().parse_args(argv)
    command: Command = arguments.command
    values = {a.key: getattr(arguments, a.key) for a in command.arguments}
    bar = None if values["quiet"] or not sys.stderr.isatty() else _Bar()
    progress = Progress(report=bar.show if bar else None)
    try:
        with _interruptible(progress):
            for key in ("json", "blend"):
                if target := getattr(arguments, key, None):
                    _refuse_input(target, command, values)
                    check_writable(target)
            outcome = command.run(values, progress)
            with all_or_none():
                if outcome.write is not None:
                    outcome.write()
                _write_extras(outcome, values.get("json"), arguments.blend)
                progress.check()
    except (Cancelled, KeyboardInterrupt):
        return _fail(bar, "Interrupted; no result was written.", INTERRUPTED)
    except BimVerifyError as error:
        return _fail(bar, str(error), FAILED)
    except MemoryError:
        return _fail(bar, "Out of memory; give a smaller --memory-gb or a larger --spacing-mm.", FAILED)
    except BrokenPipeError:
        return FAILED
    except Exception as error:
        if os.environ.get(DEBUG):
            raise
        text = " ".join(str(error).split()) or type(error).__name__
        return _fail(bar, f"Unexpected {type(error).__name__}: {text} (set {DEBUG}=1 to see where).", FAILED)
    if bar:
        bar.close()
    _say(outcome.lines)
    return DONE


def _say(lines: Sequence[str]) -> None:
    """Print; a reader that has gone (``| head``) is no error, for all that was to be written is."""
    try:
        for line in lines:
            print(line)
        sys.stdout.flush()
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _refuse_input(target: str, command: Command, values: dict[str, Any]) -> None:
    """An output must not be one of the files given by position: those are read and never written to."""
    for argument in command.arguments:
        if argument.name.startswith("-"):
            continue
        given: list[str] = values[argument.key] if argument.many else [values[argument.key]]
        if Path(target).resolve() in {Path(path).resolve() for path in given}:
            raise BimVerifyError(f"{target} is an input and is never written to; give another name for the output.")


def _fail(bar: _Bar | None, message: str, code: int) -> int:
    if bar:
        bar.close()
    print(f"bim-verify: {message}", file=sys.stderr)
    return code


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="bim-verify", description="Verify a building model (IFC) against as-built evidence, element by element."
    )
    parser.add_argument("--version", action="version", version=f"bim-verify {__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    for command in COMMANDS:
        sub = commands.add_parser(command.name, help=command.help, description=command.help[0].upper() + command.help[1:])
        sub._negative_number_matcher = NUMBERS  # no option begins so, and places may: --near -5,0,2
        for argument in command.arguments:
            _add(sub, argument)
        text = "save the coloured scene (needs Blender or the bpy module)" if command.shown else argparse.SUPPRESS
        sub.add_argument("--blend", metavar="FILE", help=text)
        sub.set_defaults(command=command)
    return parser


def _add(parser: argparse.ArgumentParser, argument: Argument) -> None:
    text = argument.help
    if argument.flag:
        parser.add_argument(argument.name, action="store_true", help=text)
        return
    if argument.default is not None:
        text += f" (default: {argument.default})"
    options: dict[str, Any] = {"type": argument.kind, "default": argument.default, "help": text}
    if argument.choices:
        options["choices"] = argument.choices
    if argument.many:
        options["nargs"] = "+"
    if argument.repeat:
        options["action"] = "append"
    if argument.name.startswith("-"):
        if not argument.choices:
            options["metavar"] = "N" if argument.kind is not str else argument.key.upper()
        parser.add_argument(argument.name, required=argument.required, **options)
    else:
        parser.add_argument(argument.key, metavar=argument.name, **options)


class _interruptible:
    """The first Ctrl-C, or SIGTERM, asks the job to stop at its next step; a second one stops it where it is.

    So nothing temporary is left by a limit of time or a shutdown either.
    """

    def __init__(self, progress: Progress) -> None:
        self._progress = progress
        self._before: dict[int, Any] = {}

    def __enter__(self) -> None:
        if threading.current_thread() is threading.main_thread():
            self._before = {sent: signal.signal(sent, self._stop) for sent in (signal.SIGINT, signal.SIGTERM)}

    def __exit__(self, *_: object) -> None:
        for sent, before in self._before.items():
            if before is not None:  # it was not set by Python
                signal.signal(sent, before)

    def _stop(self, *_: object) -> None:
        if self._progress.cancel.is_set():
            raise KeyboardInterrupt
        self._progress.cancel.set()


class _Bar:
    """A progress bar with the time left."""

    def __init__(self) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, TextColumn
        from rich.progress import Progress as RichProgress

        self._bar = RichProgress(
            TextColumn("{task.description}"), BarColumn(), TextColumn("{task.percentage:>3.0f} %"),
            TextColumn("{task.fields[left]}"), console=Console(stderr=True), transient=True,
        )
        self._task = self._bar.add_task("Starting", total=1.0, left="")
        self._bar.start()

    def show(self, done: float, message: str, seconds_left: float | None) -> None:
        left = "" if seconds_left is None else f"{seconds_left:.0f} s left"
        self._bar.update(self._task, completed=done, description=message, left=left)

    def close(self) -> None:
        self._bar.stop()


def _write_extras(outcome: Outcome, json_path: str | None, blend_path: str | None) -> None:
    if json_path:
        from .core.report.json_out import write_document

        write_document(json_path, outcome.data)
    if blend_path:
        if outcome.result is None:
            raise BimVerifyError("--blend has nothing to show for this command; use it with verify or demo.")
        try:
            import bpy  # noqa: F401
        except ImportError as error:
            raise BimVerifyError(
                "--blend needs Blender: run this command with blender --background --python, or install the bpy module."
            ) from error
        from .bim_verify_addon.headless import save_blend

        save_blend(outcome.result, blend_path)
