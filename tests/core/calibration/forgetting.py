"""Noise, forgotten as the estimates forget."""

import math

import numpy as np
from scipy.signal import lfilter

from monitor_core.arrays import Floats

MEMORY = 50
LAM = 1 - 1 / MEMORY
P = 2


def forgotten(rng: np.random.Generator, memories: int, colour: float = 0.0) -> Floats:
    """White (or coloured) noise, forgotten: of standard deviation 1 where it is white."""
    e = rng.standard_normal(((memories + 10) * MEMORY, P))
    if colour:
        e = lfilter([1 - colour], [1, -colour], e, axis=0)
    return np.asarray(lfilter([math.sqrt(1 - LAM**2)], [1, -LAM], e, axis=0)[10 * MEMORY :])
