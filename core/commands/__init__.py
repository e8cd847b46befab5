"""One file a command; every face of the program is made from this table.

The console script, ``blender --command bim_verify``, the headless scripts and the operators' settings all take names,
defaults and help from here.
"""

from . import (
    bundle,
    change,
    classify,
    compare,
    coregister,
    decide,
    demo,
    displacement,
    facade,
    info,
    plan,
    quality,
    reconstruct,
    simulate,
    update,
    verify,
)
from .table import Argument, Command, Outcome

COMMANDS: tuple[Command, ...] = (
    verify.COMMAND, change.COMMAND, quality.COMMAND, plan.COMMAND, reconstruct.COMMAND, compare.COMMAND,
    classify.COMMAND, update.COMMAND, facade.COMMAND, displacement.COMMAND, coregister.COMMAND, bundle.COMMAND,
    decide.COMMAND, simulate.COMMAND, info.COMMAND, demo.COMMAND,
)

__all__ = ["COMMANDS", "Argument", "Command", "Outcome"]
