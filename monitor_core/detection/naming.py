"""Which cause, and what size: from the evidence of all hypotheses since something changed."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from monitor_core.detection.hypotheses import Hypothesis
from monitor_core.kernel.tables import Floats

_BEYOND = 1.5
"""Sizes are extrapolated so many times at most."""


@dataclass(frozen=True, slots=True)
class Share:
    """A cause, how likely it is, and its size with its standard deviation (NaN: it has none, or is not known).

    ``alike`` are causes that make the same data: it is this one or one of those.
    """

    cause: str
    probability: float
    size: float
    size_sd: float
    alike: tuple[str, ...] = ()


def shares(hypotheses: Sequence[Hypothesis], evidence: Floats) -> tuple[Share, ...]:
    """The causes, the likeliest first; ``evidence`` (H,) are log-likelihood ratios since the onset.

    The probability of a cause is the sum of the posterior ones of its sizes, each as likely beforehand as its weight
    says; all sizes together as likely as those of another cause.
    """
    causes = list(dict.fromkeys(h.cause for h in hypotheses))
    of = np.array([causes.index(h.cause) for h in hypotheses])
    prior = np.array([h.weight for h in hypotheses]) / np.bincount(of)[of]
    posterior = np.exp(evidence - evidence.max()) * prior
    summed = np.bincount(of, posterior, len(causes)) / posterior.sum()
    found = [
        Share(cause, float(summed[c]), *_size(hypotheses, evidence, of == c), _alike(hypotheses, of == c))
        for c, cause in enumerate(causes)
    ]
    return tuple(sorted(found, key=lambda share: -share.probability))


def _alike(hypotheses: Sequence[Hypothesis], mine: Floats) -> tuple[str, ...]:
    names = [name for h, it in zip(hypotheses, mine, strict=True) if it for name in h.alike]
    return tuple(dict.fromkeys(names))


def _size(hypotheses: Sequence[Hypothesis], evidence: Floats, mine: Floats) -> tuple[float, float]:
    """Where the parabola through the best hypothesis of a cause and its neighbours has its top, and its width there.

    That nothing has changed, size 0 and evidence 0, is one of them where sizes have both signs.
    """
    own = {h.size: float(g) for h, g, it in zip(hypotheses, evidence, mine, strict=True) if it}
    if min(own) < 0 < max(own):
        own[0.0] = 0.0
    if len(own) < 3:
        return max(own, key=lambda size: own[size]), math.nan
    sizes = sorted(own)
    return vertex(np.array(sizes), np.array([own[size] for size in sizes]))


def vertex(size: Floats, evidence: Floats) -> tuple[float, float]:
    """Top of the parabola through the largest of ``evidence`` (k,) and its neighbours, and -1/curvature, as a sd.

    ``size`` (k,) ascends; k > 2.
    """
    k = min(max(int(evidence.argmax()), 1), len(size) - 2)
    left, right = size[k] - size[k - 1], size[k + 1] - size[k]
    rise, fall = (evidence[k] - evidence[k - 1]) / left, (evidence[k] - evidence[k + 1]) / right
    curvature = 2 * (rise + fall) / (left + right)
    if not curvature > 0:
        return float(size[evidence.argmax()]), math.nan
    top = size[k] + (rise * right - fall * left) / (left + right) / curvature
    low, high = min(_BEYOND * size[0], size[0]), _BEYOND * size[-1]
    return float(np.clip(top, low, high)), float(math.sqrt(1 / curvature))
