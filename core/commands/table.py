"""What a command is: its name, help, arguments and what it gives back; and the arguments that several share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from ..progress import Progress

Values = dict[str, Any]


@dataclass(frozen=True)
class Argument:
    """One argument of a command. A name with a leading ``--`` is an option, another one a file given by position."""

    name: str
    help: str
    kind: type = str
    default: Any = None
    choices: tuple[Any, ...] = ()
    many: bool = False
    required: bool = False
    flag: bool = False
    repeat: bool = False
    """May be given several times; its value is a list, with ``many`` a list of lists."""

    @property
    def key(self) -> str:
        """Its name in the values handed to the command."""
        return self.name.lstrip("-").replace("-", "_").lower()


@dataclass
class Outcome:
    """What a command found: lines for a person, data for ``--json``, and the result that ``--blend`` shows, if any."""

    lines: list[str]
    data: Values = field(default_factory=dict)
    result: Any = None
    write: Callable[[], None] | None = None
    """Writes the outputs; called after ``run``, so that they, ``--json`` and ``--blend`` get into place all or none."""


@dataclass(frozen=True)
class Command:
    """One command: ``run`` takes the arguments' values by key and a progress."""

    name: str
    help: str
    arguments: tuple[Argument, ...]
    run: Callable[[Values, Progress], Outcome]
    shown: bool = True
    """Whether ``--blend`` has something to show; its help is hidden otherwise."""

    def defaults(self) -> Values:
        """What ``run`` takes when nothing is given."""
        return {argument.key: False if argument.flag else argument.default for argument in self.arguments}


COMMON = (
    Argument("--json", "write what was found to this file"),
    Argument("--quiet", "show no progress", flag=True),
    Argument("--threads", "processor threads to use (0: all)", int, 0),
    Argument("--memory-gb", "memory for returns, gigabytes; beyond it they go to a temporary file", float, 3.0),
    Argument("--no-cache", "tessellate the model anew and keep nothing", flag=True),
)
MODEL = Argument("MODEL", "IFC file (IFC2X3, IFC4, IFC4X3)", required=True)
SCANS = Argument("SCAN", "E57, LAS/LAZ, PLY, PCD, PTS, PTX, XYZ/CSV or NPY files", many=True, required=True)
ALIGN = Argument(
    "--align", "bring the scans to the model first: fine from a coarse pose, auto without one",
    str, "none", ("none", "fine", "auto"),
)
ORIGIN = Argument(
    "--origin", "X,Y,Z of the scanner in metres, for a scan file that does not name it; for several such files FILE=X,Y,Z, "
    "given again for each", repeat=True,
)
