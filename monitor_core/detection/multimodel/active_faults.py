"""What stands in a bank: the causes that have been named and are not over, and what may change from there."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.detection.alarm import MODEL_ERROR
from monitor_core.detection.multimodel.candidates import hypothesis_of
from monitor_core.detection.multimodel.hypothesis import HEALTHY, REFERENCE, Hypothesis
from monitor_core.detection.multimodel.naming import Share
from monitor_core.drive.axis_model import AxisModel
from monitor_core.settings import Settings

SECOND = 0.01
"""How likely a second cause is beforehand, beside a change of the first."""
FINER = 0.25
"""Of the steps of an active fault.  Its size was read between hypotheses a factor of 2 apart, so it is off by up to a
tenth; what is left of a change by a fifth is below half of the smallest step then, which no hypothesis of that cause
would explain.  Another cause would, though nothing else has changed."""
GONE, REST = 2.0, 0.2
"""Standard deviations; share of what stood: a cause whose whole size is below so much is over.  Sizes between those of
the hypotheses are off by a tenth.  What is really left is then a change of its own, and seen as one."""


UNEXPLAINED = MODEL_ERROR**2
"""Of the effect of active faults on the square of the predictions, as their sizes are off by that share at least: no
model is the axis.  What explains it best gains so much of the evidence for the faults, and is no fault of its own."""


class ActiveFaults:
    """Of one axis.  Each cause stands as one hypothesis: all that there is of it."""

    def __init__(self, model: AxisModel, settings: Settings, hypotheses: Sequence[Hypothesis]) -> None:
        self._model, self._settings, self.hypotheses = model, settings, tuple(hypotheses)
        self._stands: dict[str, Hypothesis] = {}

    def __len__(self) -> int:
        return len(self._stands)

    @property
    def causes(self) -> tuple[str, ...]:
        """Causes that may be active."""
        return tuple(dict.fromkeys(hypothesis.cause for hypothesis in self.hypotheses))

    def clear(self) -> None:
        """No fault is active."""
        self._stands = {}

    def adopt(self, sizes: Mapping[str, float]) -> None:
        """Make exactly these causes active, with these sizes (NaN: it has none).

        Raises:
            KeyError: no hypothesis has such a cause.
        """
        known = {hypothesis.cause: hypothesis for hypothesis in reversed(self.hypotheses)}
        self._stands = {
            cause: known[cause] if math.isnan(size) else self._of_size(cause, size)
            for cause, size in sizes.items()
        }

    def lanes(self) -> tuple[Hypothesis, ...]:
        """Hypotheses of the lanes: the present state, the changes from here, and the return to the healthy state."""
        base = REFERENCE
        for hypothesis in self._stands.values():
            base = hypothesis.after(base)
        changes = (self._now_likely(hypothesis).after(base) for hypothesis in self.hypotheses)
        return replace(base, cause=HEALTHY), *changes, self._way_back()

    def unexplained(self) -> Floats:
        """Share (len(hypotheses),) of the evidence for active faults that is none for a hypothesis of another cause."""
        return np.array([0.0 if h.cause in self._stands else UNEXPLAINED for h in self.hypotheses])

    def _now_likely(self, hypothesis: Hypothesis) -> Hypothesis:
        """A hypothesis now: more or less of an active fault is likelier than a second fault, and in smaller steps."""
        if hypothesis.cause in self._stands and hypothesis.K is None and not math.isnan(hypothesis.size):
            return self._of_size(hypothesis.cause, hypothesis.size * FINER)
        other = self._stands and hypothesis.cause not in self._stands
        return replace(hypothesis, weight=hypothesis.weight * SECOND) if other else hypothesis

    def _way_back(self) -> Hypothesis:
        """The return to the healthy state."""
        if not self._stands:
            return replace(REFERENCE, weight=1e-300)
        (cause, hypothesis), *others = self._stands.items()
        alone = not others and not math.isnan(hypothesis.size)
        return Hypothesis(cause, -hypothesis.size) if alone else REFERENCE

    def ended(self, best: Share) -> list[str]:
        """Causes that end if this is the most likely change."""
        if best.cause == HEALTHY:
            return list(self._stands)
        before = self._stands.get(best.cause)
        if before is None or math.isnan(before.size):
            return []
        tolerance = np.fmax(GONE * best.size_sd, REST * abs(before.size))
        return [best.cause] if abs(before.size + best.size) < tolerance else []

    def end(self, cause: str) -> None:
        """End a cause, if it is active."""
        self._stands.pop(cause, None)

    def join(self, best: Share, likeliest: Hypothesis) -> None:
        """Add a change to the active fault of its cause; ``likeliest`` of the hypotheses of that cause."""
        before = self._stands.get(best.cause)
        own_gain = likeliest.K is not None
        size = likeliest.size if own_gain else best.size + (before.size if before else 0.0)
        self._stands[best.cause] = self._of_size(best.cause, size)

    def whole_of(self, found: tuple[Share, ...]) -> tuple[Share, ...]:
        """The shares with total sizes: those of the active faults are added."""
        before = {
            cause: hypothesis.size
            for cause, hypothesis in self._stands.items()
            if not math.isnan(hypothesis.size)
        }
        return tuple(replace(share, size=share.size + before.get(share.cause, 0.0)) for share in found)

    def _of_size(self, cause: str, size: float) -> Hypothesis:
        """A hypothesis of this size: one of the bank's, or a new one of the same kind."""
        own = [hypothesis for hypothesis in self.hypotheses if hypothesis.cause == cause]
        same = (hypothesis for hypothesis in own if hypothesis.size == size or math.isnan(hypothesis.size))
        return next(same, None) or replace(
            hypothesis_of(self._model, self._settings, cause, size), alike=own[0].alike
        )

    def to_array(self) -> Floats:
        """Number of the cause and size (k, 2), to be saved."""
        causes = self.causes
        return np.array(
            [(causes.index(c), hypothesis.size) for c, hypothesis in self._stands.items()], float
        ).reshape(-1, 2)

    def from_array(self, rows: Floats) -> None:
        """Restore what ``to_array`` saved.

        Raises:
            ValueError: it does not belong to these hypotheses.
        """
        causes = self.causes
        known = [(int(k), float(size)) for k, size in rows]
        if any(not 0 <= k < len(causes) for k, _ in known):
            raise ValueError("a cause that these hypotheses do not have")
        self._stands = {causes[k]: self._of_size(causes[k], size) for k, size in known}
