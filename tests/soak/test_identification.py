"""Statistics of the estimates over 1000 records for each experiment: twelve minutes of one core.

Means within three standard errors, for all parameters and experiments together (Bonferroni: 32 means), deviations
within 10 %, four and a half of the deviation of such a one: by luck it fails once in 350 runs.
"""

from collections.abc import Callable, Sequence

import numpy as np
import pytest

from monitor_core.identification import Record
from monitor_core.identification.problem import Disturbance
from tests.core.identification.monte_carlo import (
    SLOW,
    START_OF_NOISE,
    Spread,
    closed_loop,
    limit_of_means,
    open_loop,
    spread,
)

pytestmark = pytest.mark.soak

SEEDS = 1000
AT_ONCE = 100


def disturbed(seeds: Sequence[int]) -> list[Record]:
    return closed_loop(seeds, SLOW)


EXPERIMENTS: dict[str, tuple[Callable[[Sequence[int]], list[Record]], Disturbance | None]] = {
    "open loop, output error": (open_loop, None),
    "closed loop, output error": (closed_loop, None),
    "closed loop, innovations": (closed_loop, Disturbance()),
    "closed loop, disturbed, innovations": (disturbed, START_OF_NOISE),
}
WHITE = tuple(EXPERIMENTS)[:3]


@pytest.fixture(scope="module", params=EXPERIMENTS)
def experiment(request: pytest.FixtureRequest, seed: int) -> tuple[str, Spread]:
    make, noise = EXPERIMENTS[request.param]
    seeds = [int(s) for s in np.random.SeedSequence(seed).generate_state(SEEDS)]
    found = Spread.joined([spread(make(seeds[k : k + AT_ONCE]), seed + k, noise) for k in range(0, SEEDS, AT_ONCE)])
    print(f"\n{request.param}: {found.lines()}")
    return request.param, found


def test_no_bias(experiment: tuple[str, Spread]) -> None:
    found = experiment[1]
    assert found.converged == SEEDS
    assert abs(found.z).max() < limit_of_means(len(EXPERIMENTS))


def test_standard_deviations(experiment: tuple[str, Spread]) -> None:
    kind, found = experiment
    assert found.empirical == pytest.approx(found.reported, rel=0.1)
    if kind in WHITE:
        assert found.empirical == pytest.approx(found.bound, rel=0.1)
