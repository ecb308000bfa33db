"""What a bank reports: changes, and their causes with probabilities and sizes, from the evidence of all hypotheses."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Bools, Floats, Ints
from monitor_core.detection.alarm import Onset
from monitor_core.detection.multimodel.hypothesis import Hypothesis

_KEPT = 8 / 9
"""Of the evidence for a change between two sizes of its cause (candidates.SIZES), these may keep no more.  So the
evidence for a last resort counts for so much: else the scale of the output is named where kT has changed by a size
between two, since the friction that it leaves as it is makes up for the error of the size."""
_MOST = 60.0
"""Evidence counts up to that, and beyond it only in proportion to the largest.  A cause that explains nearly as much as
another, within the 1/9 that a size between two loses and errors of the model may well make up for, is then not ruled
out by however long a record: 1/9 of this is the evidence from which on a cause is sure (SURE_ENOUGH)."""
_BEYOND = 1.5
"""Sizes are extrapolated so many times at most."""
_LEAST = -0.9
"""Of a factor less one"""


@dataclass(frozen=True, slots=True)
class Share:
    """A cause, its probability, and its size with its standard deviation (NaN: it has none, or is unknown).

    ``alike`` are causes that produce the same data: it is this one or one of those.
    """

    cause: str
    probability: float
    size: float
    size_sd: float
    alike: tuple[str, ...] = ()


# --- Events; times in us since 1970, since_us is the time of the ChangeDetected that an event belongs to --------------


@dataclass(frozen=True, slots=True)
class ChangeDetected:
    """A change was detected; its cause is not known yet."""

    time_us: int
    onset: Onset
    shares: tuple[Share, ...]


@dataclass(frozen=True, slots=True)
class CauseIdentified:
    """The cause is the first of ``shares``, with the total size of the active fault of that cause.

    ``certain``: its share is large enough; otherwise the others must be reported, too.
    """

    time_us: int
    since_us: int
    onset: Onset
    shares: tuple[Share, ...]
    certain: bool


@dataclass(frozen=True, slots=True)
class CauseEnded:
    """A named cause has ended; HEALTHY: the change did not last."""

    time_us: int
    since_us: int
    cause: str


Event = ChangeDetected | CauseIdentified | CauseEnded


# --- Isolation and size -----------------------------------------------------------------------------------------------


class Paths(NamedTuple):
    """Of the g of hypotheses (H,): when each was last zero, and last too small to be sure, us."""

    zero: Ints
    late: Ints


class CausePosterior:
    """Posterior of the causes of hypotheses (H,), which are sorted once for repeated use."""

    def __init__(self, hypotheses: Sequence[Hypothesis]) -> None:
        names = list(dict.fromkeys(h.cause for h in hypotheses))
        self._of = np.array([names.index(h.cause) for h in hypotheses])
        self._counts = np.where([h.weight < 1 for h in hypotheses], _KEPT, 1.0)
        self._prior = np.array([h.weight for h in hypotheses]) / np.bincount(self._of)[self._of]
        self._causes = [_Cause.from_hypotheses(name, hypotheses) for name in names]

    def shares(self, evidence: Floats, paths: Paths | None = None) -> tuple[Share, ...]:
        """The causes, the most likely first; ``evidence`` (H,) are log-likelihood ratios since the onset.

        A g begins again at zero where its path has fallen below.  By ``paths`` those are known that did so after the
        onset: their evidence is too large.  Without it there are none.
        """
        with_none = np.append(evidence, 0.0)
        zero, late = (np.append(times, 0) for times in paths or np.zeros((2, len(evidence)), np.int64))
        found = list[Share]()
        for cause, probability in zip(self._causes, self._probabilities(evidence).tolist(), strict=True):
            own, best = with_none[cause.at], cause.at[with_none[cause.at].argmax()]
            complete = (cause.at < 0) | (zero[cause.at] <= late[best])
            found.append(Share(cause.name, probability, *cause.fitted(own, complete), cause.alike))
        return tuple(sorted(found, key=lambda share: -share.probability))

    def likeliest(self, evidence: Floats) -> tuple[str, float]:
        """The first of the causes and its probability, without its size."""
        probabilities = self._probabilities(evidence)
        k = int(probabilities.argmax())
        return self._causes[k].name, float(probabilities[k])

    def _probabilities(self, evidence: Floats) -> Floats:
        """That of a cause is the sum of the posterior ones of its sizes.

        The prior of a size is its weight; all sizes together have the same prior as those of another cause.
        """
        counted = self._counts * evidence
        counted *= min(1.0, _MOST / max(counted.max(), 1.0))
        posterior = np.exp(counted - counted.max()) * self._prior
        return np.asarray(np.bincount(self._of, posterior, len(self._causes)) / posterior.sum())


@dataclass(frozen=True, slots=True)
class _Cause:
    """Sizes of a cause (k,), ascending, and the indices of their evidence, -1 for no change."""

    name: str
    size: Floats
    at: Ints
    alike: tuple[str, ...]
    is_gain: bool

    @classmethod
    def from_hypotheses(cls, name: str, hypotheses: Sequence[Hypothesis]) -> "_Cause":
        """No change, size 0 and evidence 0, is one of the sizes where they have both signs."""
        own = {h.size: k for k, h in enumerate(hypotheses) if h.cause == name}
        if min(own) < 0 < max(own):
            own[0.0] = -1
        sizes = sorted(own)
        alike = dict.fromkeys(other for h in hypotheses if h.cause == name for other in h.alike)
        is_gain = any(h.is_gain for h in hypotheses if h.cause == name)
        return cls(name, np.array(sizes), np.array([own[size] for size in sizes]), tuple(alike), is_gain)

    def fitted(self, evidence: Floats, complete: Bools) -> tuple[float, float]:
        """Size and its sd: top and width of the parabola through the best (k,) and its neighbours.

        The evidence for a change of a gain is a parabola over the factor less one.  Over the logarithm a change by a
        fifth would be read a twentieth too large.  Where evidence of a neighbour is not ``complete`` (k,), no
        change takes its place.
        """
        if len(self.size) < 3:
            return float(self.size[evidence.argmax()]), math.nan
        near = self._near(int(evidence.argmax()), complete)
        if not self.is_gain:
            return _vertex(self.size, near, evidence)
        change, sd = _vertex(np.expm1(self.size), near, evidence)
        return math.log1p(max(change, _LEAST)), sd / (1 + max(change, _LEAST))

    def _near(self, best: int, complete: Bools) -> Ints:
        """Places (3,) of the best size and its neighbours, or of one and of no change."""
        middle = min(max(best, 1), len(self.size) - 2)
        neighbours = np.arange(middle - 1, middle + 2)
        known = {*neighbours[complete[neighbours]].tolist(), best, *np.flatnonzero(self.at < 0).tolist()}
        return neighbours if complete[neighbours].all() or len(known) < 3 else np.array(sorted(known))


def _vertex(sizes: Floats, near: Ints, evidences: Floats) -> tuple[float, float]:
    """Top of the parabola through the points ``near`` (3,) of evidence over size (k,), and -1/curvature, as an sd.

    ``sizes`` ascend.
    """
    size, evidence = sizes[near], evidences[near]
    left, right = np.diff(size)
    rise, fall = (evidence[1] - evidence[0]) / left, (evidence[1] - evidence[2]) / right
    curvature = 2 * (rise + fall) / (left + right)
    if not curvature > 0:
        return float(size[evidence.argmax()]), math.nan
    top = size[1] + (rise * right - fall * left) / (left + right) / curvature
    low, high = min(_BEYOND * sizes[0], sizes[0]), _BEYOND * sizes[-1]
    return float(np.clip(top, low, high)), float(math.sqrt(1 / curvature))
