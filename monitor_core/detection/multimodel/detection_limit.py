"""Theoretical limit of the detection delay for a given mean time between false alarms (Lorden)."""

import math

import numpy as np

from monitor_core.arrays import Floats


def least_delay(healthy: Floats, faulty: Floats, lam0: float, samples_between: float) -> float:
    """Samples from the onset until the information suffices for one false alarm in ``samples_between`` samples.

    The first n at which  sum (yhat_faulty - yhat_healthy)^2 / (2 lam0),  averaged over records, reaches
    log(samples_between); ``healthy`` and ``faulty`` (N, W) are predictions from the onset on.  inf: not within N.
    """
    information = np.cumsum(((faulty - healthy) ** 2).mean(axis=1)) / (2 * lam0)
    enough = information >= math.log(samples_between)
    return float(enough.argmax() + 1) if enough.any() else math.inf
