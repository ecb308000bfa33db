"""How many of a hundred fits without a guess end at the optimum, how many chains grow right, and how long they take."""

import time
from collections.abc import Callable

import numpy as np
import pytest
from scipy.stats import binom

from monitor_core.drive.structure import Output
from monitor_core.identification.starting import grow
from tests.core.identification.starting_cases import AT_OPTIMUM, CASES, Way

pytestmark = pytest.mark.soak

SEEDS = 100
FEWER = 20
"""With little noise, and where chains of unknown length grow."""
WORDS = {"scratch": "from the record alone", "given": "from given values"}
MASSES = {"two": 2, "three": 3, "five": 5}


# With the noise of the reference experiment, and a third of it, where the minima are narrow.
@pytest.mark.parametrize(
    ("output", "noise", "seeds"), [("speed", 1.0, SEEDS), ("speed", 0.3, FEWER), ("angle", 0.3, FEWER)]
)
@pytest.mark.parametrize("way", ["scratch", "given"])
@pytest.mark.parametrize("name", CASES)
def test_fits_end_at_the_optimum(name: str, way: Way, output: Output, noise: float, seeds: int, seed: int) -> None:
    case, what = CASES[name], f"{name} masses {WORDS[way]}, {output} with {noise:g} of the noise"
    good = _count(what, lambda k: case.away(seed + k, way, noise, output), seeds)
    assert good >= at_least(seeds, case.of_hundred)


@pytest.mark.parametrize("name", CASES)
def test_as_many_masses_as_there_are(name: str, seed: int) -> None:
    """With the noise of the reference experiment; up to six masses are tried."""
    case = CASES[name]

    def wrong(k: int) -> float:
        return 1.0 + abs(grow([case.record(seed + k)], 6).recommended - MASSES[name])

    good = _count(f"growing to {name} masses", wrong, FEWER)
    assert good >= at_least(FEWER, 90)


def at_least(count: int, of_hundred: int) -> int:
    """Successes that chance leaves out once in ten thousand runs, if just as many as must be succeed on average."""
    return int(binom.ppf(1e-4, count, of_hundred / 100))


def _count(what: str, away: Callable[[int], float], seeds: int) -> int:
    """How many seeds end at the optimum, printed."""
    ratios, seconds = list[float](), list[float]()
    for k in range(seeds):
        began = time.process_time()
        ratios.append(away(k))
        seconds.append(time.process_time() - began)
    good = sum(ratio <= AT_OPTIMUM for ratio in ratios)
    others = sorted(round(ratio, 3) for ratio in ratios if ratio > AT_OPTIMUM)
    print(
        f"\n{what}: {good} of {seeds}; {np.mean(seconds):.2f} s each, the longest {max(seconds):.1f} s; others end at"
        f" {others} times the cost"
    )
    return good
