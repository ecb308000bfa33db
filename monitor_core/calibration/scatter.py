"""Scatter of the estimates in healthy records around the nominal values, and its uncertainty.

This is the scatter observed in the records, not that of P: it includes the autocorrelation of the innovations and model
errors.  Its uncertainty comes from resampling blocks of several memories (block bootstrap; Kuensch 1989).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from monitor_core.arrays import Floats, Ints
from monitor_core.calibration.healthy_records import RecordDeviations

SAMPLES_PER_MEMORY = 50
"""Number of samples used per memory; more would add little, as the deviations are correlated."""
MAX_MEAN_SIGMAS = 0.3
"""Largest mean deviation, in standard deviations, that the rates include; the allowance covers the rest."""
_MIN_SD = 1e-12
_RESAMPLINGS = 1000
MAX_BLOCK_MEMORIES, MOST_BLOCKS = 5, 30
"""Largest number of memories in a block; number of blocks from which blocks have this length."""


@dataclass(frozen=True)
class Scatter:
    """Scatter of p parameters in healthy records, in sizes of the parameters; times in samples.

    ``mean_d``, ``sigma``: mean and standard deviation of the deviation.  ``mean_s``: mean of s = sqrt(lambda_0 P_ii).
    ``power`` (B, p): draws of the true variance over sigma^2.  ``off`` (B, p): draws of the true mean minus ``mean_d``.
    The draws of different parameters are correlated if their estimates are.
    """

    mean_d: Floats  # (p,)
    mean_s: Floats  # (p,)
    sigma: Floats  # (p,)
    power: Floats  # (B, p)
    off: Floats  # (B, p)
    memories: float
    memory: float

    @property
    def offset(self) -> Floats:
        """The part of the mean deviation (p,) that the rates include."""
        largest = MAX_MEAN_SIGMAS * self.sigma
        return np.clip(self.mean_d, -largest, largest)

    @property
    def beyond(self) -> Floats:
        """Magnitude of the rest of the mean deviation (p,), which the allowance covers."""
        return np.abs(self.mean_d - self.offset)


def stride(memory: float) -> int:
    """Number of samples from one used sample to the next."""
    return max(1, round(memory / SAMPLES_PER_MEMORY))


def scatter(found: Sequence[RecordDeviations], memory: float, rng: np.random.Generator) -> Scatter:
    """Scatter of the records, with resamplings of their blocks.

    Raises:
        ValueError: the records have no tested samples.
    """
    parts = [part for record in found if len(part := binned(record, memory)) > SAMPLES_PER_MEMORY]
    if not parts:
        raise ValueError("no sample was tested")
    d, s = np.swapaxes(np.concatenate(parts), 0, 1)
    starts = np.cumsum([0] + [len(part) for part in parts])[:-1].tolist()
    memories = len(d) * stride(memory) / memory
    mean = d.mean(axis=0)
    around = d - mean
    length = max(1, round(SAMPLES_PER_MEMORY * min(MAX_BLOCK_MEMORIES, memories / MOST_BLOCKS)))
    sums, count = _blocks(np.hstack([around, around**2]), starts, length)
    weights = rng.multinomial(len(count), np.full(len(count), 1 / len(count)), size=_RESAMPLINGS)
    means, squares = np.hsplit((weights @ sums) / (weights @ count)[:, np.newaxis], 2)
    variance = (around**2).mean(axis=0)
    power = _mirrored_variance(squares / variance, memories)
    chance = rng.multivariate_normal(np.zeros(d.shape[1]), _correlation(means), size=_RESAMPLINGS)
    variance *= 1 + 2 / memories  # as the mean was estimated from the same record
    off = np.sqrt(2 * variance / memories) * chance
    return Scatter(mean, s.mean(axis=0), np.sqrt(variance), power, off, memories, memory)


def looked_at(deviations: RecordDeviations, memory: float) -> Ints:
    """Indices of the used samples: SAMPLES_PER_MEMORY per memory, of those that were tested."""
    q = stride(memory)
    return np.flatnonzero(deviations.tested.all(axis=1))[q - 1 :: q]


def binned(deviations: RecordDeviations, memory: float) -> Floats:
    """Deviation and s (n, 2, p) at the used samples."""
    use = looked_at(deviations, memory)
    return np.stack([deviations.d[use], deviations.s[use]], axis=1)


def _correlation(values: Floats) -> Floats:
    """Correlation of the columns of values (B, p)."""
    z = (values - values.mean(axis=0)) / np.maximum(values.std(axis=0), _MIN_SD)
    return np.asarray(z.T @ z / len(z))


def _mirrored_variance(resampled: Floats, memories: float) -> Floats:
    """Draws of the true variance over that of the record, from the resampled variances (B, p) by mirroring their logs.

    Few blocks scatter too little.  So the scatter is at least that of normal deviations with the memory of the
    recursion.
    """
    log = np.log(resampled)
    return np.asarray(np.exp(-log * np.maximum(1.0, math.sqrt(2 / memories) / np.maximum(log.std(axis=0), _MIN_SD))))


def _blocks(values: Floats, starts: Sequence[int], length: int) -> tuple[Floats, Floats]:
    """Sums (blocks, p) over blocks, none of which spans two records, and the lengths of the blocks (blocks,)."""
    ends = [*starts[1:], len(values)]
    edges = [
        edge
        for start, end in zip(starts, ends, strict=True)
        for edge in range(start, max(start + 1, end - length // 2), length)
    ]
    return np.add.reduceat(values, edges, axis=0), np.diff([*edges, len(values)]).astype(float)
