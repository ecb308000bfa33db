"""How many of a hundred fits without a guess end at the optimum, and how long they take."""

from __future__ import annotations

import time

import numpy as np
import pytest

from tests.core.identification.test_starting import AT_OPTIMUM, CASES, Way, at_least

pytestmark = pytest.mark.soak

SEEDS = 100


@pytest.mark.parametrize("noise", [1.0, 0.3])
@pytest.mark.parametrize("way", ["scratch", "given"])
@pytest.mark.parametrize("name", CASES)
def test_hundred_fits(
    name: str, way: Way, noise: float, seed: int, capsys: pytest.CaptureFixture[str]
) -> None:
    """With the noise of the reference experiment and with less."""
    case, away, seconds = CASES[name], list[float](), list[float]()
    for k in range(SEEDS):
        began = time.process_time()
        away.append(case.away(seed + k, way, noise))
        seconds.append(time.process_time() - began)
    good = sum(ratio <= AT_OPTIMUM for ratio in away)
    with capsys.disabled():
        print(
            f"\n{name} masses, {way}, noise {noise:g} rad/s: {good} of {SEEDS} at the optimum,"
            f" {np.median(seconds):.2f} s each with the fit from the truth, the longest {max(seconds):.1f} s;"
            f" others at {sorted(round(ratio, 3) for ratio in away if ratio > AT_OPTIMUM)} times its cost"
        )
    assert good >= at_least(SEEDS, case.of_hundred)
