"""Rules that combine bodies of evidence on the frame {occupied, empty}.

A mass is an array (..., 3): occupied, empty, unknown, adding up to 1. Dempster's rule is evaluated through
commonalities, whose logarithms add: the fusion of any number of bodies is one sum, so neither order nor grouping matters.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Masses = NDArray[np.float64]
SMALLEST = 1e-300


def conflict(first: Masses, second: Masses) -> NDArray[np.float64]:
    """k = m1(emp) m2(occ) + m1(occ) m2(emp)."""
    return np.asarray(first[..., 1] * second[..., 0] + first[..., 0] * second[..., 1], dtype=np.float64)


def conjunctive(first: Masses, second: Masses) -> Masses:
    """The products that agree, not normalised; what is missing to 1 is the conflict."""
    occ = first[..., 0] * (second[..., 0] + second[..., 2]) + first[..., 2] * second[..., 0]
    emp = first[..., 1] * (second[..., 1] + second[..., 2]) + first[..., 2] * second[..., 1]
    return np.stack([occ, emp, first[..., 2] * second[..., 2]], axis=-1)


def dempster(first: Masses, second: Masses) -> Masses:
    """Dempster's rule: the agreeing products divided by 1 - k. Total conflict leaves nothing known."""
    joint = conjunctive(first, second)
    total = joint.sum(axis=-1, keepdims=True)
    unknown = np.zeros_like(joint)
    unknown[..., 2] = 1.0
    return np.where(total > SMALLEST, joint / np.maximum(total, SMALLEST), unknown)


def yager(first: Masses, second: Masses) -> Masses:
    """Yager's rule: the conflict goes to unknown."""
    joint = conjunctive(first, second)
    joint[..., 2] += conflict(first, second)
    return joint


def dubois_prade(first: Masses, second: Masses) -> Masses:
    """Dubois and Prade's rule: each conflict goes to the union of what conflicts.

    On two outcomes that union is the whole frame, so the rule is Yager's.
    """
    return yager(first, second)


def discount(masses: Masses, reliability: NDArray[np.float64] | float) -> Masses:
    """Shafer's discounting: a source that is right with this probability keeps that share, the rest becomes unknown."""
    kept = np.asarray(reliability)[..., None] * masses
    kept[..., 2] += 1.0 - np.asarray(reliability)
    return kept


def from_log_commonality(
    log_occ: NDArray[np.float64], log_emp: NDArray[np.float64], log_unk: NDArray[np.float64]
) -> tuple[Masses, NDArray[np.float64]]:
    """Fused masses (..., 3) and conflict (...) of many bodies under Dempster's rule.

    The arguments are the sums over all bodies of log(m_occ + m_unk), log(m_emp + m_unk) and log(m_unk). The conflict is
    the mass that the unnormalised combination of all bodies gives to the empty set.
    """
    peak = np.maximum(log_occ, log_emp)
    u = np.exp(log_unk - peak)
    occ = np.maximum(np.exp(log_occ - peak) - u, 0.0)  # no mass is negative, not even by round-off
    emp = np.maximum(np.exp(log_emp - peak) - u, 0.0)
    total = occ + emp + u
    masses = np.stack([occ, emp, u], axis=-1) / total[..., None]
    return masses, np.clip(1.0 - total * np.exp(peak), 0.0, 1.0)


def combine_all(bodies: Masses, rule: Callable[[Masses, Masses], Masses]) -> tuple[Masses, NDArray[np.float64]]:
    """Fuse bodies (B, ..., 3) in their order; returns masses (..., 3) and the mass in conflict (...).

    Yager's and Dubois and Prade's rules are not associative, so for them all bodies are joined first and the conflict is
    given to unknown once, which is their own form for more than two sources and does not depend on the order.
    """
    joint = bodies[0]
    for body in bodies[1:]:
        joint = conjunctive(joint, body)
    contradiction = np.clip(1.0 - joint.sum(axis=-1), 0.0, 1.0)
    if rule is dempster:
        total = np.maximum(joint.sum(axis=-1, keepdims=True), SMALLEST)
        return joint / total, contradiction
    joint = joint.copy()
    joint[..., 2] += contradiction
    return joint, contradiction


def belief_plausibility(masses: Masses) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Bel and Pl of ``occupied`` and ``empty``, each (..., 2): Bel = m(A), Pl = 1 - Bel(not A)."""
    belief = masses[..., :2].copy()
    return belief, 1.0 - belief[..., ::-1]


RULES: dict[str, Callable[[Masses, Masses], Masses]] = {
    "dempster": dempster,
    "yager": yager,
    "dubois-prade": dubois_prade,
}
