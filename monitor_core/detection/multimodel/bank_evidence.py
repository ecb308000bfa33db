"""What the sums of a bank say of a change: whether it lasts, its onset, its causes and their sizes."""

from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Bools, Floats
from monitor_core.detection.alarm import Onset
from monitor_core.detection.multimodel.hypothesis import Hypothesis
from monitor_core.detection.multimodel.naming import CausePosterior, Share
from monitor_core.kernel import hypotheses as kernel
from monitor_core.kernel.hypotheses import Memory
from monitor_core.kernel.likelihood import FIRST_MARK, HELD_BACK, LATE, MARKS, ONSET, SINCE_DETECTION, G
from monitor_core.kernel.predictors import LIMIT, Predictors
from monitor_core.kernel.state import NEVER

LOOKS = 20
"""Number of checks of the probabilities per memory length."""


class BankEvidence(NamedTuple):
    """The evidence for H hypotheses relative to the present state, which is that of the first lane.

    ``hypotheses`` (H + 1,): of the lanes, the present state first.  ``causes``: of those after it.  ``slowest_us``:
    slowest time constant of the predictors.
    """

    memory: Memory
    predictors: Predictors
    hypotheses: tuple[Hypothesis, ...]
    causes: CausePosterior
    slowest_us: int

    @property
    def has_crossed(self) -> bool:
        """Whether the g of any hypothesis is above its threshold."""
        return bool(self._above(1.0).any())

    def lasts(self, cause: str | None = None) -> bool:
        """Whether there is still evidence of a change, also in the samples since its detection alone.

        A disturbance of some seconds leaves much evidence.  In the samples after it, "no change" explains the
        data better than every hypothesis, or at least than every one of the named ``cause``.  While an axis stands,
        only sizes of one sign are better than "no change".
        """
        own = [k for k, h in enumerate(self.hypotheses) if k > 0 and cause in (None, h.cause)]
        return bool(self._above(0.5).any() and (self.memory.sums[SINCE_DETECTION, own] > 0.0).any())

    def shares(self) -> tuple[Share, ...]:
        """The causes; after a memory length their sizes are those that the samples since the detection show."""
        integers = self.memory.integers
        late = integers[kernel.PHASE, 0] != kernel.PENDING or integers[kernel.CHECKS, 0] >= LOOKS
        since = self.memory.sums[SINCE_DETECTION, 1 : len(self.hypotheses)]
        return self.causes.shares(self._since_onset, since if late else None)

    def most_probable(self) -> tuple[str, float]:
        """The first of ``shares`` without its size, which takes most of the time: its cause and probability."""
        return self.causes.most_probable(self._since_onset)

    def likeliest(self) -> str:
        """The cause that all of the evidence makes likeliest."""
        return self.causes.likeliest(self._since_onset)

    def onset(self) -> Onset:
        """Onset of the most likely hypothesis: the time at which its g was last zero, with an interval.

        A hypothesis assumes that the change was always present.  It gains no evidence until the state of the axis has
        settled after the change.  So the change may be earlier by half the slowest time constant.
        """
        k = int(self.memory.sums[G, : len(self.hypotheses)].argmax())
        when = self.memory.when[:, k]
        best, earliest = int(when[ONSET]), int(when[FIRST_MARK + MARKS - 1]) - self.slowest_us // 2
        low = earliest if earliest > NEVER // 2 else None  # otherwise it lies before the first sample
        return Onset.within(best, low, max(int(when[LATE]), best))

    def lane(self, cause: str) -> int:
        """Lane of the hypothesis with the most evidence, of this cause."""
        evidence = self.memory.sums[[G, HELD_BACK]].sum(axis=0)
        own = [k for k, hypothesis in enumerate(self.hypotheses) if k > 0 and hypothesis.cause == cause]
        return max(own, key=lambda k: float(evidence[k]))

    @property
    def _since_onset(self) -> Floats:
        """Log-likelihood ratios (H,) since the onset."""
        g, held_back = self.memory.sums[[G, HELD_BACK], 1 : len(self.hypotheses)]
        return np.asarray(g + held_back)

    def _above(self, share: float) -> Bools:
        """Whether g is above this share of the threshold (H + 1,)."""
        many = len(self.hypotheses)
        return np.asarray(self.memory.sums[G, :many] > share * self.predictors.own[LIMIT, :many])
