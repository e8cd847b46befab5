"""The capabilities in the order of the work. A new one is a module here with a ``CAPABILITY``, and its name in the list."""

from __future__ import annotations

from importlib import import_module

from ..capability import Capability
from ..colors import Mode

NAMES = (
    "model",
    "scans",
    "align",
    "verify",
    "change",
    "quality",
    "plan",
    "reconstruct",
    "compare",
    "displacement",
    "classify",
    "facade",
    "photos",
    "update",
    "export",
)

CAPABILITIES: tuple[Capability, ...] = tuple(import_module(f".{name}", __package__).CAPABILITY for name in NAMES)
MODES: dict[str, Mode] = {mode.identifier: mode for capability in CAPABILITIES for mode in capability.modes}


def shown_first(color_mode: str) -> tuple[Capability, ...]:
    """The capabilities, that of the colour mode first: what the colours say is what a person asks about."""
    return tuple(sorted(CAPABILITIES, key=lambda c: all(mode.identifier != color_mode for mode in c.modes)))
