"""Banks of reference axes with their records, to be timed."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest

from monitor_core import bank as bank_module
from monitor_core.bank import Bank
from monitor_core.model import Output
from monitor_core.reference import experiments, reference_model
from monitor_core.settings import Settings
from tests.core.figures import settings_of

ONE_BY_ONE, LANES = 1_000_000, 1
"""Values of FEWEST_LANES that force a shape of the kernel."""

BLOCKS = 10
"""Blocks until a record begins again."""


@cache
def settings(output: Output, seed: int) -> Settings:
    """Of the reference experiment, with P(0), so that theta moves from the start."""
    return settings_of(output, seed)


def run_of(output: Output, axes: int, samples: int, seed: int) -> Callable[[], object]:
    """A call that runs the next so many samples of so many axes; three masses, kT, 1/Ja and fm.

    At the end of the records the bank starts afresh with them: a jump would throw theta to its bounds.
    """
    model, length = reference_model(output), max(BLOCKS * samples, 2000)
    bank = Bank([model] * axes, [settings(output, seed)] * axes)
    start = [bank.column(a) for a in range(axes)]
    t_us, u, y = experiments(range(seed, seed + axes), output=output, samples=length)
    t_us = np.repeat(t_us[:, np.newaxis], axes, axis=1)
    at = 0

    def run() -> object:
        nonlocal at
        if at == length:
            at = 0
            for a, state in enumerate(start):
                bank.restore(a, *state)
        block, at = slice(at, at + samples), at + samples
        return bank.run(t_us[block], u[block], y[block])

    return run


def forced(run: Callable[[], object], fewest_lanes: int) -> Callable[[], object]:
    """The same call in one shape of the kernel."""

    def in_shape() -> object:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(bank_module, "FEWEST_LANES", fewest_lanes)
            return run()

    return in_shape
