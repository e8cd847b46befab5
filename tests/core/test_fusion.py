"""Combination rules on the frame {occupied, empty}."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from bim_verify.core.evidence.fusion import (
    RULES,
    belief_plausibility,
    combine_all,
    conflict,
    conjunctive,
    dempster,
    discount,
    dubois_prade,
    from_log_commonality,
    yager,
)

COUNT = 20_000


def random_masses(*shape: int, seed: int) -> NDArray[np.float64]:
    """Masses (..., 3) all over the simplex, some of them near its corners and edges."""
    random = np.random.default_rng(seed)
    sharpness = random.choice([0.05, 0.5, 1.0, 5.0], (*shape, 1))
    gamma = random.gamma(np.broadcast_to(sharpness, (*shape, 3))) + 1e-9
    return gamma / gamma.sum(axis=-1, keepdims=True)


def logs(masses: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
    """Sums over the first axis of the logarithms of the commonalities."""
    occ, emp, unk = masses[..., 0], masses[..., 1], masses[..., 2]
    return np.log(occ + unk).sum(axis=0), np.log(emp + unk).sum(axis=0), np.log(unk).sum(axis=0)


@pytest.mark.parametrize("rule", sorted(RULES))
def test_every_rule_is_commutative_and_keeps_the_sum(rule: str) -> None:
    a, b = random_masses(COUNT, seed=1), random_masses(COUNT, seed=2)
    np.testing.assert_allclose(RULES[rule](a, b), RULES[rule](b, a), atol=1e-12)
    np.testing.assert_allclose(RULES[rule](a, b).sum(axis=-1), 1.0, atol=1e-12)


def test_dempster_is_associative() -> None:
    a, b, c = (random_masses(COUNT, seed=k) for k in (3, 4, 5))
    np.testing.assert_allclose(dempster(dempster(a, b), c), dempster(a, dempster(b, c)), atol=1e-12)


def test_any_order_of_many_bodies_gives_the_same() -> None:
    bodies = random_masses(12, 500, seed=6)
    forward, k = combine_all(bodies, dempster)
    for seed in range(5):
        mixed = np.random.default_rng(seed).permutation(bodies, axis=0)
        again, k_again = combine_all(mixed, dempster)
        np.testing.assert_allclose(again, forward, atol=1e-12)
        np.testing.assert_allclose(k_again, k, atol=1e-12)


def test_log_commonalities_are_dempsters_rule() -> None:
    bodies = random_masses(12, 2000, seed=7)
    pairwise = bodies[0]
    kept = np.ones(2000)
    for body in bodies[1:]:
        kept *= 1 - conflict(pairwise, body)
        pairwise = dempster(pairwise, body)
    fused, contradiction = from_log_commonality(*logs(bodies))
    np.testing.assert_allclose(fused, pairwise, atol=1e-10)
    np.testing.assert_allclose(contradiction, 1 - kept, atol=1e-10)
    joined, joined_conflict = combine_all(bodies, dempster)
    np.testing.assert_allclose(fused, joined, atol=1e-10)
    np.testing.assert_allclose(contradiction, joined_conflict, atol=1e-10)


def test_log_commonalities_bear_thousands_of_bodies() -> None:
    body = np.array([0.3, 0.1, 0.6])
    fused, contradiction = from_log_commonality(*logs(np.tile(body, (50_000, 1, 1))))
    np.testing.assert_allclose(fused, [[1.0, 0.0, 0.0]], atol=1e-12)
    assert contradiction[0] == pytest.approx(1.0)


def test_round_off_makes_no_mass_negative() -> None:
    sure = np.random.default_rng(3).uniform(0.0, 0.4, (40, 500))
    bodies = np.stack([sure, np.zeros_like(sure), 1.0 - sure], axis=-1)  # nothing says empty
    log_occ, log_emp, log_unk = logs(bodies)
    fused, _ = from_log_commonality(log_occ, log_emp - 1e-16 * np.abs(log_emp), log_unk)
    assert fused.min() >= 0.0
    assert not np.signbit(fused).any()


def test_conflict_of_two_bodies() -> None:
    first, second = np.array([0.6, 0.1, 0.3]), np.array([0.2, 0.5, 0.3])
    assert conflict(first, second) == pytest.approx(0.6 * 0.5 + 0.1 * 0.2)
    assert conjunctive(first, second).sum() == pytest.approx(1 - 0.32)
    expected = np.array([0.6 * 0.5 + 0.3 * 0.2, 0.1 * 0.8 + 0.3 * 0.5, 0.09]) / 0.68
    np.testing.assert_allclose(dempster(first, second), expected, atol=1e-15)


def test_yager_gives_the_conflict_to_unknown() -> None:
    first, second = np.array([0.6, 0.1, 0.3]), np.array([0.2, 0.5, 0.3])
    np.testing.assert_allclose(yager(first, second), [0.36, 0.23, 0.09 + 0.32], atol=1e-15)


def test_dubois_and_prade_agree_with_yager_on_two_outcomes() -> None:
    a, b = random_masses(COUNT, seed=8), random_masses(COUNT, seed=9)
    np.testing.assert_array_equal(dubois_prade(a, b), yager(a, b))


@pytest.mark.parametrize("rule", ["yager", "dubois-prade"])
def test_rules_that_are_not_associative_still_do_not_depend_on_the_order_of_many(rule: str) -> None:
    bodies = random_masses(6, 300, seed=10)
    forward, k = combine_all(bodies, RULES[rule])
    backward, _ = combine_all(bodies[::-1], RULES[rule])
    np.testing.assert_allclose(backward, forward, atol=1e-12)
    np.testing.assert_allclose(forward.sum(axis=-1), 1.0, atol=1e-12)
    joint = conjunctive(bodies[0], bodies[1])
    for body in bodies[2:]:
        joint = conjunctive(joint, body)
    np.testing.assert_allclose(forward[:, 2], joint[:, 2] + k, atol=1e-12)


@pytest.mark.parametrize("rule", sorted(RULES))
def test_nothing_known_changes_nothing(rule: str) -> None:
    masses = random_masses(COUNT, seed=11)
    np.testing.assert_allclose(RULES[rule](masses, np.array([0.0, 0.0, 1.0])), masses, atol=1e-15)


def test_total_conflict_leaves_nothing_known() -> None:
    sure, opposed = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
    np.testing.assert_array_equal(dempster(sure, opposed), [0.0, 0.0, 1.0])
    np.testing.assert_array_equal(yager(sure, opposed), [0.0, 0.0, 1.0])


@pytest.mark.parametrize("rule", sorted(RULES))
def test_the_conflict_free_rule_is_each_rule_where_nothing_is_empty(rule: str) -> None:
    """T1 eq. 5.19: m_occ = m1 m2 + m1 u2 + u1 m2, m_unk = u1 u2."""
    a, b = random_masses(COUNT, seed=12), random_masses(COUNT, seed=13)
    for masses in (a, b):
        masses[:, 0] += masses[:, 1]
        masses[:, 1] = 0.0
    occ = a[:, 0] * b[:, 0] + a[:, 0] * b[:, 2] + a[:, 2] * b[:, 0]
    free = np.column_stack([occ, np.zeros(COUNT), a[:, 2] * b[:, 2]])
    np.testing.assert_allclose(RULES[rule](a, b), free, atol=1e-12)
    np.testing.assert_array_equal(conflict(a, b), 0.0)


def test_belief_and_plausibility() -> None:
    belief, plausibility = belief_plausibility(np.array([[0.6, 0.1, 0.3]]))
    np.testing.assert_allclose(belief, [[0.6, 0.1]])
    np.testing.assert_allclose(plausibility, [[0.9, 0.4]])
    masses = random_masses(COUNT, seed=14)
    belief, plausibility = belief_plausibility(masses)
    np.testing.assert_allclose(plausibility - belief, np.repeat(masses[:, 2:], 2, axis=1), atol=1e-12)


def test_discounting() -> None:
    masses = np.array([0.6, 0.1, 0.3])
    np.testing.assert_allclose(discount(masses, 0.9), [0.54, 0.09, 0.37], atol=1e-15)
    np.testing.assert_allclose(discount(masses, 0.0), [0.0, 0.0, 1.0])
    many = random_masses(COUNT, seed=15)
    np.testing.assert_allclose(discount(many, 1.0), many, atol=1e-15)
    kept = np.random.default_rng(16).random(COUNT)
    np.testing.assert_allclose(discount(many, kept).sum(axis=-1), 1.0, atol=1e-12)
    np.testing.assert_array_equal(masses, [0.6, 0.1, 0.3])
