"""Compile the kernel before anything waits for it."""

import numpy as np

from monitor_core.bank import FEWEST_LANES, Bank
from monitor_core.reference import INTERVAL_S, reference_model
from monitor_core.settings import Settings


def compile_kernel(lanes: int) -> None:
    """Have the kernel ready for banks of so many axes: compiled, or loaded from its cache."""
    bank = Bank([reference_model()] * lanes, [Settings(interval_s=INTERVAL_S)] * lanes)
    bank.run(np.zeros((0, lanes), np.int64), np.zeros((0, lanes)), np.zeros((0, lanes)))


def compile_all() -> None:
    """Both shapes of the kernel: few axes and many."""
    for lanes in (1, FEWEST_LANES):
        compile_kernel(lanes)
