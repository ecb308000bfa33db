"""Events of a bank, and the probabilities and sizes of causes from the evidence of all hypotheses."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from monitor_core.arrays import Floats, Ints
from monitor_core.detection.alarm import Onset
from monitor_core.detection.multimodel.hypothesis import Hypothesis

_LAST_RESORT_SHARE = 8 / 9
"""Factor on the evidence for a cause of last resort.  The hypotheses of a cause get only 8/9 of the evidence for a
change between two of their sizes (candidates.SIZES).  Without this factor the output scale would be named after a
change of kT between two sizes: it does not change the friction, and that makes up for the error of the size."""
_MAX_EVIDENCE = 60.0
"""Larger evidence is scaled down to this.  So a cause that explains nearly as much as another one, to within 1/9, is
not ruled out even by a long record: a size between two hypotheses loses 1/9, and model errors may make up for it.  1/9
of this limit is the evidence that makes a cause certain (SURE_ENOUGH)."""
_MAX_EXTRAPOLATION = 1.5
"""Sizes are extrapolated up to this factor beyond the largest hypothesis."""
_MIN_CHANGE = -0.9
"""Smallest change of a factor, as the factor minus one"""


@dataclass(frozen=True, slots=True)
class Share:
    """A cause, its probability, and its size with its standard deviation (NaN: no size, or not known).

    ``alike``: other causes that produce the same data, so that any of them may be the true one.
    """

    cause: str
    probability: float
    size: float
    size_sd: float
    alike: tuple[str, ...] = ()


# --- Events; times in us since 1970.  since_us: time of the ChangeDetected that an event belongs to -------------------


@dataclass(frozen=True, slots=True)
class ChangeDetected:
    """A change was detected; its cause is not known yet."""

    time_us: int
    onset: Onset
    shares: tuple[Share, ...]


@dataclass(frozen=True, slots=True)
class CauseIdentified:
    """The cause was identified: the first of ``shares``, whose size is the total size of the active fault.

    ``certain``: its probability is large enough; otherwise the other causes must be reported, too.  ``settled``: the
    size is known, and the cause is an active fault from now on; before, the change may not last.
    """

    time_us: int
    since_us: int
    onset: Onset
    shares: tuple[Share, ...]
    certain: bool
    settled: bool = True


@dataclass(frozen=True, slots=True)
class CauseEnded:
    """A named cause has ended; HEALTHY: the change did not last."""

    time_us: int
    since_us: int
    cause: str


@dataclass(frozen=True, slots=True)
class SizeCorrected:
    """The total size of an active fault, from finer steps around the size with which it was named."""

    time_us: int
    since_us: int
    share: Share


Event = ChangeDetected | CauseIdentified | CauseEnded | SizeCorrected


# --- Isolation and size -----------------------------------------------------------------------------------------------


class CausePosterior:
    """Posterior probabilities of the causes of hypotheses (H,), prepared for repeated use.

    ``evidence_share``: share of the evidence that counts for them, at most 1 (a power posterior): the sum of
    log-likelihood ratios takes each sample as new evidence, but the errors of a model last for many samples.
    """

    def __init__(self, hypotheses: Sequence[Hypothesis], evidence_share: float = 1.0) -> None:
        self._evidence_share = evidence_share
        names = list(dict.fromkeys(h.cause for h in hypotheses))
        self._of = np.array([names.index(h.cause) for h in hypotheses])
        self._counts = np.where([h.weight < 1 for h in hypotheses], _LAST_RESORT_SHARE, 1.0)
        self._prior = np.array([h.weight for h in hypotheses]) / np.bincount(self._of)[self._of]
        self._causes = [_Cause.from_hypotheses(name, hypotheses) for name in names]

    def shares(self, evidence: Floats, sizes_from: Floats | None = None) -> tuple[Share, ...]:
        """The causes, the most likely first.

        Args:
            evidence: log-likelihood ratios (H,) since the onset, without what the allowances subtract; no less than 0.
            sizes_from: the evidence (H,) that determines the sizes; None: the same.
        """
        with_none = np.append(evidence if sizes_from is None else sizes_from, 0.0)
        shares = [
            Share(cause.name, probability, *cause.fitted(with_none[cause.at]), cause.alike)
            for cause, probability in zip(
                self._causes, self._probabilities(self._evidence_share * evidence).tolist(), strict=True
            )
        ]
        return tuple(sorted(shares, key=lambda share: -share.probability))

    def most_probable(self, evidence: Floats) -> tuple[str, float]:
        """The most likely cause of ``shares`` and its probability."""
        probabilities = self._probabilities(self._evidence_share * evidence)
        best = int(probabilities.argmax())
        return self._causes[best].name, float(probabilities[best])

    def likeliest(self, evidence: Floats) -> str:
        """The cause that all of the evidence makes likeliest."""
        return self._causes[int(self._probabilities(evidence).argmax())].name

    def _probabilities(self, evidence: Floats) -> Floats:
        """Probability of each cause: the sum over its sizes.

        The prior of a size is its weight over the number of sizes, so that the number does not matter.
        """
        counted = self._counts * evidence
        counted *= min(1.0, _MAX_EVIDENCE / max(counted.max(), 1.0))
        posterior = np.exp(counted - counted.max()) * self._prior
        return np.asarray(np.bincount(self._of, posterior, len(self._causes)) / posterior.sum())


@dataclass(frozen=True, slots=True)
class _Cause:
    """Sizes of a cause (k,), ascending, and the indices ``at`` of their evidence; -1: no change."""

    name: str
    size: Floats
    at: Ints
    alike: tuple[str, ...]
    is_gain: bool

    @classmethod
    def from_hypotheses(cls, name: str, hypotheses: Sequence[Hypothesis]) -> "_Cause":
        """The sizes of the hypotheses of a cause; if they have both signs, "no change" is added, with evidence 0."""
        own = {h.size: k for k, h in enumerate(hypotheses) if h.cause == name}
        if min(own) < 0 < max(own):
            own[0.0] = -1
        sizes = sorted(own)
        alike = dict.fromkeys(other for h in hypotheses if h.cause == name for other in h.alike)
        is_gain = any(h.is_gain for h in hypotheses if h.cause == name)
        return cls(name, np.array(sizes), np.array([own[size] for size in sizes]), tuple(alike), is_gain)

    def fitted(self, evidence: Floats) -> tuple[float, float]:
        """Size and its standard deviation: vertex and width of the parabola through the best size and its neighbours.

        The evidence for a change of a gain is a parabola over the factor minus one.  Over the logarithm, the size of a
        change by a fifth would come out a twentieth too large.
        """
        if len(self.size) < 3:
            return float(self.size[evidence.argmax()]), math.nan
        if not self.is_gain:
            return vertex(self.size, evidence)
        change, sd = vertex(np.expm1(self.size), evidence)
        return math.log1p(max(change, _MIN_CHANGE)), sd / (1 + max(change, _MIN_CHANGE))


def vertex(size: Floats, evidence: Floats) -> tuple[float, float]:
    """Vertex of the parabola through the largest of ``evidence`` (k,) and its neighbours, and the standard deviation.

    The standard deviation is the square root of -1 / curvature.  ``size`` (k,) ascends; k > 2.
    """
    k = min(max(int(evidence.argmax()), 1), len(size) - 2)
    left, right = size[k] - size[k - 1], size[k + 1] - size[k]
    rise, fall = (evidence[k] - evidence[k - 1]) / left, (evidence[k] - evidence[k + 1]) / right
    curvature = 2 * (rise + fall) / (left + right)
    if not 0 < curvature < math.inf:  # infinite: the neighbours are impossible
        return float(size[evidence.argmax()]), math.nan
    top = size[k] + (rise * right - fall * left) / (left + right) / curvature
    low, high = min(_MAX_EXTRAPOLATION * size[0], size[0]), _MAX_EXTRAPOLATION * size[-1]
    return float(np.clip(top, low, high)), float(math.sqrt(1 / curvature))
