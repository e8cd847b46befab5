"""``bim-verify decide``: a person's word over a verdict, without a window."""

from __future__ import annotations

import datetime

from ..errors import BimVerifyError
from ..progress import Progress
from ..results import STATUSES, Decision
from .checks import check_outputs
from .table import COMMON, Argument, Command, Outcome, Values

TAKE_BACK = "COMPUTED"


def _decide(values: Values, progress: Progress) -> Outcome:
    from ..model.decisions import write_decisions

    check_outputs([values["model"]], [values["out"]])
    reason = (values["reason"] or "").strip()
    taken_back = values["status"] == TAKE_BACK
    if not taken_back and not reason:
        raise BimVerifyError("A decision needs --reason TEXT: say why the verdict does not hold.")
    decision = None
    if not taken_back:
        status = next(s for s in STATUSES if s == values["status"])
        decision = Decision(status, reason, values["by"] or "", datetime.date.today().isoformat(), "")
    word = "as computed again" if taken_back else values["status"]
    count = len(values["element"])
    line = f"{count} element{'s' if count != 1 else ''} {word}: {values['out']}"
    data = {"elements": values["element"], "status": values["status"], "reason": reason}
    chosen = dict.fromkeys(values["element"], decision)
    return Outcome([line], data, write=lambda: write_decisions(values["model"], values["out"], chosen))


COMMAND = Command(
    "decide",
    "overrule the verdict on elements of a verified IFC, with a reason that later runs keep",
    (
        Argument("MODEL", "verified IFC file", required=True),
        Argument("--element", "GlobalIds of the elements", many=True, required=True),
        Argument("--status", f"what holds; {TAKE_BACK} takes a decision back", required=True, choices=(*STATUSES, TAKE_BACK)),
        Argument("--reason", "why"),
        Argument("--by", "who decides"),
        Argument("--out", "IFC file to write", required=True),
        *COMMON,
    ),
    _decide,
    shown=False,
)
