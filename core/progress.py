"""Progress and cancellation, passed down through every long job."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field

from .errors import Cancelled

Report = Callable[[float, str, float | None], None]
"""Receives (share done 0..1, what is being done, seconds left or None). May be called from a worker thread."""


@dataclass
class Progress:
    """Share done of a job, handed down as sub-ranges, and the place where cancellation is noticed.

    ``report`` is called at most every ``interval_s`` seconds. ``cancel`` may be set from any thread; the next
    ``update`` or ``check`` then raises :class:`~.errors.Cancelled`.
    """

    report: Report | None = None
    cancel: threading.Event = field(default_factory=threading.Event)
    start: float = 0.0
    end: float = 1.0
    interval_s: float = 0.1
    _t0: float = field(default_factory=time.monotonic)
    _last: list[float] = field(default_factory=lambda: [0.0])

    def check(self) -> None:
        """Raise Cancelled if the user asked for it."""
        if self.cancel.is_set():
            raise Cancelled()

    def update(self, fraction: float, message: str) -> None:
        """Say that ``fraction`` (0..1) of this part is done."""
        self.check()
        now = time.monotonic()
        done = self.start + (self.end - self.start) * min(max(fraction, 0.0), 1.0)
        if self.report is None or (now - self._last[0] < self.interval_s and done < 1.0):
            return
        self._last[0] = now
        elapsed = now - self._t0
        left = elapsed * (1.0 - done) / done if done > 0.02 and elapsed > 0.5 else None
        self.report(done, message, left)

    def part(self, start: float, end: float) -> Progress:
        """A sub-range of this progress, sharing its clock and its cancel token."""
        span = self.end - self.start
        return Progress(
            self.report, self.cancel, self.start + span * start, self.start + span * end, self.interval_s,
            self._t0, self._last,
        )
