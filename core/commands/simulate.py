"""``bim-verify simulate``: a model seen by a simulated scanner."""

from __future__ import annotations

import math

from ..progress import Progress
from .checks import check_outputs, zero_or_more
from .table import COMMON, MODEL, Argument, Command, Outcome, Values

GLASS = ("opaque", "lossy", "clear")


def _simulate(values: Values, progress: Progress) -> Outcome:
    from ..simulation.stations_file import simulate

    zero_or_more(values, "unevenness_mm", "pose_noise_mm", "pose_noise_deg")
    outputs = [values["out"]] + ([values["truth"]] if values["truth"] else [])
    check_outputs([values["model"], values["stations"]], outputs)
    written = simulate(
        values["model"], values["stations"], values["out"], values["truth"], scanner=values["scanner"],
        seed=values["seed"], clutter=values["clutter"], people=values["people"], remove_share=values["remove_share"],
        shift_share=values["shift_share"], glass=values["glass"], unevenness=values["unevenness_mm"] / 1000,
        pose_noise=(values["pose_noise_mm"] / 1000, math.radians(values["pose_noise_deg"])), threads=values["threads"],
        cache=not values["no_cache"], progress=progress,
    )
    return Outcome([f"{written.returns:,} returns: {values['out']}"], {"returns": written.returns, "scan": values["out"]})


COMMAND = Command(
    "simulate",
    "scan a model with a simulated terrestrial scanner",
    (
        MODEL,
        Argument("--stations", "JSON file of scanner positions", required=True),
        Argument("--out", "E57 file to write", required=True),
        Argument("--truth", "JSON file for the truth per element"),
        Argument("--scanner", "scanner preset (default: the stations file's, or fast)"),
        Argument("--seed", "seed of noise and choices", int, 0),
        Argument("--clutter", "boxes that are not in the model", int, 0),
        Argument("--people", "people standing around", int, 0),
        Argument("--remove-share", "share of the elements left out", float, 0.0),
        Argument("--shift-share", "share of the elements moved", float, 0.0),
        Argument("--glass", "how windows answer: opaque, lossy (half the beams) or clear panes", str, "opaque", GLASS),
        Argument("--unevenness-mm", "standard deviation of smooth bumps of all surfaces, millimetres", float, 0.0),
        Argument("--pose-noise-mm", "standard deviation of the recorded positions, millimetres", float, 0.0),
        Argument("--pose-noise-deg", "standard deviation of the recorded directions, degrees", float, 0.0),
        *COMMON,
    ),
    _simulate,
    shown=False,
)
