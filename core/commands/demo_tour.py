"""``bim-verify demo --all``: every other command on the demo house, a photo of a street front and a panelled wall."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from ..files import all_or_none
from ..progress import Progress
from . import bundle, classify, compare, coregister, displacement, facade, plan, quality, reconstruct, update
from .table import Command, Outcome, Values

if TYPE_CHECKING:
    from ..model.elements import BuildingModel

Stop = tuple[str, Command, dict[str, object]]
"""What it shows, the command, and those of its values that are not the defaults."""
STOPS = 10


def tour(folder: Path, shared: Values, progress: Progress) -> Iterator[str]:
    """Run the commands one after the other on what ``demo`` wrote into ``folder``; yields lines for a person.

    The outputs of a stop get into place when it ends, so those before it stay when a later one is interrupted.
    """
    from ..model.load import load_model

    model = load_model(folder / "house.ifc", cache=not shared["no_cache"])
    common = {key: shared[key] for key in ("threads", "memory_gb", "no_cache")}
    for number, (title, command, given) in enumerate(_stops(folder, model, shared["seed"])):
        part = progress.part(number / STOPS, (number + 1) / STOPS)
        known = {argument.key for argument in command.arguments}
        values = command.defaults() | {k: v for k, v in common.items() if k in known} | given
        outcome: Outcome = command.run(values, part)
        with all_or_none():
            if outcome.write is not None:
                outcome.write()
            part.check()
        yield ""
        yield f"{title}:"
        yield f"  {command_line(command, given)}"
        yield from (f"  {line}" for line in outcome.lines)


def _stops(folder: Path, model: BuildingModel, seed: int) -> Iterator[Stop]:
    """Lazily, so that each stop's files are made just before it."""
    from ..simulation.tour_files import write_facade_photo, write_house_block, write_house_photos
    from ..simulation.wall_example import GUID, write_wall_example

    house, scan = str(folder / "house.ifc"), str(folder / "scan.e57")
    yield "How good the scan is, and what it misses", quality.COMMAND, {
        "model": house, "scan": [scan], "out": str(folder / "house_quality.ifc"), "report": str(folder / "quality"),
    }
    yield "Where to scan next", plan.COMMAND, {
        "model": house, "out": str(folder / "plan.json"), "add_to": [scan], "report": str(folder / "plan"),
    }
    yield "The model moved to what was built", update.COMMAND, {
        "model": str(folder / "house_verified.ifc"), "out": str(folder / "house_updated.ifc"),
        "report": str(folder / "update"),
    }
    yield "What that changed, model against model", compare.COMMAND, {
        "model": str(folder / "house_updated.ifc"), "reference": house, "report": str(folder / "compare"),
    }
    yield "The scan split by element", classify.COMMAND, {
        "model": house, "scan": [scan], "out": str(folder / "classified.e57"), "report": str(folder / "classify"),
    }
    yield "A model from the scan alone", reconstruct.COMMAND, {
        "scan": [scan], "out": str(folder / "reconstructed.ifc"), "compare": house, "report": str(folder / "reconstruct"),
    }
    photos = write_house_photos(model, folder / "photos", seed)
    yield "Photos placed on the model", coregister.COMMAND, {
        "model": house, "image": [str(path) for path in photos.images], "cameras": str(photos.cameras),
        "out": str(folder / "photos" / "cameras_refined.json"), "report": str(folder / "coregister"),
    }
    block = write_house_block(model, folder / "block", seed)
    yield "A block of photos of the living room adjusted", bundle.COMMAND, {
        "project": str(block.project), "out": str(folder / "block" / "block_adjusted.json"), "report": str(folder / "bundle"),
    }
    front = write_facade_photo(folder / "facade_photo")
    yield f"A mock-up of a street front with {front.openings} openings from a photo", facade.COMMAND, {
        "image": [str(front.path)], "out": str(folder / "facade.ifc"), "corners": [front.corners],
        "width": round(front.width, 2), "report": str(folder / "facade"),
    }
    wall = write_wall_example(folder / "wall")
    yield "A panelled wall that moved", displacement.COMMAND, {
        "base": str(wall / "base.e57"), "later": str(wall / "later.e57"), "out": str(wall / "displacement.csv"),
        "model": str(wall / "wall.ifc"), "element": GUID, "out_ifc": str(wall / "wall_displacement.ifc"),
        "report": str(folder / "displacement"),
    }


def command_line(command: Command, given: dict[str, object]) -> str:
    """What a person types for the same."""
    words = ["bim-verify", command.name]
    for argument in command.arguments:
        if argument.key not in given:
            continue
        value = given[argument.key]
        texts = [str(v) for v in value] if isinstance(value, list) else [str(value)]
        words += [*([argument.name] if argument.name.startswith("-") else []), *texts]
    return shlex.join(words)
