"""The paper's Figure 6 over 1000 seeds: prints the table."""

import numpy as np
import pytest

from tests.core.figures import outcome, settings_of

SEEDS = 1000
STATED = {"kT": (0.96, 1.0), "1/Ja": (0.99, 1.0), "fm": (0.40, 0.50), None: (0.0, 0.0)}
"""Shares of the seeds that alarm first in the right parameter."""


@pytest.mark.bench
@pytest.mark.parametrize("parameter", STATED)
def test_figure_6(parameter: str | None, seed: int, capsys: pytest.CaptureFixture[str]) -> None:
    settings = settings_of("speed", seed, run_on=True)
    row = outcome(range(seed + 10_000, seed + 10_000 + SEEDS), parameter, settings)
    with capsys.disabled():
        print(f"\nfault in {parameter}: {row}")
    assert row.false == 0
    least, most = STATED[parameter]
    by_luck = 3 * np.sqrt(least * (1 - least) / SEEDS)
    assert least - by_luck <= row.right <= most + by_luck
