"""A person's decisions outlive a run: where they are looked for."""

from __future__ import annotations

from pathlib import Path

from ..results import Decision, VerificationResult


def earlier_decisions(model: str, out: str, chosen: str | None) -> dict[str, Decision]:
    """GlobalId -> decision: of the file ``chosen``, else of the model and of the file that is about to be replaced."""
    from ..model.decisions import decisions_in

    if chosen:
        return decisions_in(chosen)
    found: dict[str, Decision] = {}
    for path in (model, out):
        if Path(path).is_file():
            found |= decisions_in(path)
    return found


def still_there(decisions: dict[str, Decision], result: VerificationResult) -> dict[str, Decision]:
    """Those on elements that were verified."""
    known = {verdict.global_id for verdict in result.verdicts}
    return {global_id: decision for global_id, decision in decisions.items() if global_id in known}
