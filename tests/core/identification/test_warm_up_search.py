"""Which friction follows a warm-up, on windows of friction whose law is known."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from monitor_core.identification.thermal.warm_up_search import WINDOW_S, Search, Windows, chosen, heat_course

TAU_S = 300.0
CHANCE = 0.02
"""Standard deviation of fm and fc in one window, and how they go together, as at nearly one speed."""
TOGETHER = -0.9


def record(
    rng: np.random.Generator,
    by_heat: Sequence[float],
    by_power: Sequence[float],
    minutes: int = 10,
    chance: float = CHANCE,
) -> Windows:
    """From cold on: fm and fc, both 1, that change by these shares at the largest heat, and with the present power."""
    # The speed changes each half minute, so the heat of the last minute goes with it.
    power = np.repeat(rng.uniform(0.5, 1.5, 2 * minutes), 3)
    heat = heat_course(power, 0.0, TAU_S)[0]
    delta = np.outer(heat / heat.max(), by_heat) + np.outer(power - 1, by_power)
    covariance = chance**2 * np.array([[1.0, TOGETHER], [TOGETHER, 1.0]])
    information = np.repeat(np.linalg.inv(covariance)[np.newaxis], power.size, axis=0)
    seen = delta - delta.mean(axis=0) + rng.multivariate_normal([0, 0], covariance, power.size)
    middle_s = np.asarray((np.arange(power.size) + 0.5) * WINDOW_S, np.float64)
    return Windows(middle_s, power, information, np.einsum("wij,wj->wi", information, seen))


def followers(
    seed: int,
    by_heat: Sequence[float],
    by_power: Sequence[float] = (0.0, 0.0),
    minutes: int = 10,
    chance: float = CHANCE,
) -> set[int]:
    rng = np.random.default_rng(seed)
    search = Search([record(rng, by_heat, by_power, minutes, chance)], [0, 1], [None], "cold")
    fit = chosen(search, [1.0, 1.0])
    return set() if fit is None else set(fit.which)


@pytest.mark.parametrize(
    ("by_heat", "expected"),
    [
        ((0.0, 0.0), set()),
        ((-0.3, 0.0), {0}),
        ((0.0, -0.3), {1}),
        ((-0.3, -0.3), {0, 1}),
        ((-0.4, 0.2), {0, 1}),
        ((-0.02, 0.0), set()),
    ],
)
def test_each_follows_where_it_is_shown_beside_the_other(
    seed: int, by_heat: tuple[float, float], expected: set[int]
) -> None:
    assert followers(seed, by_heat) == expected


@pytest.mark.parametrize("by_power", [(-0.2, 0.2), (0.2, -0.2), (-0.2, 0.0), (0.0, -0.2)])
def test_friction_that_goes_with_the_speed_is_no_warm_up(seed: int, by_power: tuple[float, float]) -> None:
    """As that of a drive whose friction is not a straight line over the speed."""
    assert followers(seed, (0.0, 0.0), by_power) == set()


def test_a_warm_up_is_found_beside_what_goes_with_the_speed(seed: int) -> None:
    assert followers(seed, (-0.3, 0.0), (-0.2, 0.2)) == {0}


@pytest.mark.parametrize("minutes", [2, 4, 7])
def test_a_few_groups_that_agree_by_chance_are_no_warm_up(seed: int, minutes: int) -> None:
    """With the chi-square distribution, which takes their scatter for known, a fourth of four minutes showed one."""
    found = [followers(seed + k, (0.0, 0.0), minutes=minutes, chance=0.1) for k in range(20)]
    assert found == [set()] * 20


def test_a_plain_warm_up_of_a_short_record_is_found(seed: int) -> None:
    assert followers(seed, (-0.3, -0.3), minutes=4, chance=0.005) == {0, 1}
