"""Estimates from many records: no bias, and spread as reported and as the Cramer-Rao bound has it.

The reference experiment, 20 s, kT fixed at 1; ``make soak`` takes 1000 records each.  Limits are four standard errors
for the mean of each parameter, and 40 % for each standard deviation, four of the deviation of such a one: of 16 of
each, luck alone exceeds one of them for less than 1 in 100 seeds.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import pytest

from monitor_core.arrays import Floats
from monitor_core.identification import Record
from monitor_core.identification.problem import Disturbance
from tests.core.identification.monte_carlo import (
    SAMPLES,
    SLOW,
    START_OF_NOISE,
    closed_loop,
    open_loop,
    spread,
)
from tests.core.identification.problems import EIGHT
from tests.shares import soaked

SEEDS = 50
FEW = 5
PART = 0.4
STANDARD_ERRORS = 4.0
WHITE = "open loop, output error"


def seeds(seed: int, count: int = SEEDS) -> list[int]:
    return [int(s) for s in np.random.SeedSequence(seed).generate_state(count)]


class Experiment(NamedTuple):
    """What is recorded, and the noise model that is fitted with it; None: output error."""

    record: Callable[[Sequence[int]], list[Record]]
    noise: Disturbance | None


EXPERIMENTS = {
    WHITE: Experiment(open_loop, None),
    "closed loop, disturbed, innovations": Experiment(lambda s: closed_loop(s, SLOW), START_OF_NOISE),
}


def beyond(off: Floats) -> dict[str, float]:
    """Parameters that are off by more than the limit, which is 1 or -1."""
    return {name: value for name, value in zip(EIGHT, off.tolist(), strict=True) if abs(value) > 1}


@pytest.mark.parametrize("kind", soaked(EXPERIMENTS, WHITE))
def test_all_converge_without_bias_and_scatter_as_reported(kind: str, seed: int) -> None:
    """White noise on the output being all there is, output error is the most accurate of all."""
    record, noise = EXPERIMENTS[kind]
    found = spread(record(seeds(seed)), seed, noise)
    print(f"\n{kind}: {found.lines()}")
    assert found.converged == SEEDS
    assert beyond(found.z / STANDARD_ERRORS) == {}
    assert beyond((found.empirical / found.reported - 1) / PART) == {}
    # Of all parameters together it scatters by half as much.
    assert np.exp(np.mean(np.log(found.empirical / found.reported))) == pytest.approx(1, rel=PART / 2)
    if kind == WHITE:
        assert found.lam0.mean() == pytest.approx(1, abs=6 * np.sqrt(2 / SAMPLES / SEEDS))
        assert beyond((found.empirical / found.bound - 1) / PART) == {}


def test_output_error_fails_where_feedback_knows_the_disturbance(seed: int) -> None:
    """In closed loop the controller answers a torque disturbance: the torque is not independent of it any more.

    Output error takes it for noise on the output; the motor inertia then is wrong by a quarter, always.
    """
    found = spread(closed_loop(seeds(seed, FEW), SLOW), seed)
    print(f"\nclosed loop, disturbed, output error: {found.lines()}")
    assert found.deviations[:, EIGHT.index("Jm")].min() > 0.05
    assert found.lam0.min() > 2
