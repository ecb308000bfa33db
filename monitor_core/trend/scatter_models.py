"""How a series scatters about its course: by P, by itself, and with a memory; sums for least squares in that noise.

Beside the errors of estimation, of variance s_k^2, each mean is off by what differs from hour to hour (white, the less
the longer the mean), and by what stays for a while, temperature, load, a shift, exponentially correlated in time.  How
large these are and how long they last is not known: a grid of possibilities, each with its likelihood, says how sure
anything is.  The noise is made white by a Kalman filter of its one state, for all possibilities side by side.
"""

from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats

LEVELS = (0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.95, 1.1, 1.3, 1.6, 2.0, 3.0)
"""Standard deviations of the whole scatter, beside that of what is left when a course is taken out."""

SHARES = (0.1, 0.3, 0.6, 0.85, 1.0)
"""Of its variance that stays for a while."""

LASTING = 7
"""Possible times that it stays, from the distance of two entries to half of the whole history, at least LONG."""

LONG = 48.0
"""Hours that load and weather may stay; a short history does not show it."""

FAVOUR = 0.5
"""Power of its time with which lasting scatter is held to be likelier than short one: what lasts harms, and is hardly
seen in a short history."""


class Noises(NamedTuple):
    """Possible noises (G,), beside the errors of estimation."""

    white: Floats  # variance
    lasting: Floats  # variance
    rate: Floats  # 1 / time that it lasts
    log_prior: Floats


def possible(t: Floats, level: float, hour: float) -> Noises:
    """The grid for entries at times t (N,), which scatter by about ``level``."""
    times = np.geomspace(np.median(np.diff(t)), max((t[-1] - t[0]) / 2, LONG * hour), LASTING)
    variance = (level * np.array(LEVELS)) ** 2
    v, share, time = (x.ravel() for x in np.meshgrid(variance, SHARES, times, indexing="ij"))
    white = np.concatenate([[0.0], variance, v * (1 - share)])
    lasting = np.concatenate([np.zeros(1 + len(variance)), v * share])
    rate = np.concatenate([np.full(1 + len(variance), 1 / times[0]), 1 / time])
    favour = FAVOUR * np.log(time / times[0])
    return Noises(white, lasting, rate, np.concatenate([np.zeros(1 + len(variance)), favour]))


def whitened(
    t: Floats, columns: Floats, variance: Floats, share: Floats, noises: Noises
) -> tuple[Floats, Floats]:
    """Columns (N, C) with the noise made white, of variance one (N, G, C), and log det of its covariance (G,).

    Args:
        t: (N,) increasing.
        columns: (N, C) what is measured, and what may explain it.
        variance: (N,) of the errors of estimation.
        share: (N,) of the white noise that the mean of an entry has.
        noises: (G,) possible ones.
    """
    G, (N, C) = len(noises.white), columns.shape
    m, P = np.zeros((G, C)), noises.lasting.copy()
    out, log_det = np.empty((N, G, C)), np.zeros(G)
    stays = np.exp(-np.diff(t, prepend=t[0])[:, None] * noises.rate)
    for k in range(N):
        m *= stays[k][:, None]
        P = noises.lasting + stays[k] ** 2 * (P - noises.lasting)
        S = P + variance[k] + noises.white * share[k]
        e = columns[k] - m
        m += (P / S)[:, None] * e
        P = P * (1 - P / S)
        out[k] = e / np.sqrt(S)[:, None]
        log_det += np.log(S)
    return out, log_det
