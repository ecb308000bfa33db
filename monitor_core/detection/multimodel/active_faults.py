"""Active faults of a bank: causes that have been named and have not ended; and the hypotheses relative to them."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.detection.multimodel.candidates import candidate_cause
from monitor_core.detection.multimodel.hypothesis import HEALTHY, REFERENCE, Hypothesis
from monitor_core.detection.multimodel.naming import Share
from monitor_core.drive.axis_model import AxisModel
from monitor_core.settings import Settings

SECOND_CAUSE_PRIOR = 0.01
"""Prior probability of a second cause, relative to a further change of the first one."""
FINE_STEP = 0.25
"""Factor on the sizes of hypotheses of an active fault.  The size of the fault was interpolated between hypotheses a
factor of 2 apart, so it is off by up to a tenth.  After a change by a fifth, that error is below half of the smallest
step.  Without finer steps no hypothesis of the same cause would explain it, but one of another cause would, although
nothing else has changed."""
ENDED_SD, ENDED_SHARE = 2.0, 0.2
"""A cause has ended if its total size is negligible, below this number of standard deviations, or below this share of
its former size, as interpolated sizes are off by a tenth.  A real remainder is then detected as a change of its own."""


UNEXPLAINED = 0.05**2
"""Share of the evidence for the active faults that model errors may cause: no model is exact, so up to 5 % of the
effect of a fault is left over.  The hypothesis that explains this error best gains up to this share of the evidence,
and yet is no fault."""


class ActiveFaults:
    """Active faults of one axis.  Each cause has one hypothesis with its total size."""

    def __init__(self, model: AxisModel, settings: Settings, hypotheses: Sequence[Hypothesis]) -> None:
        self._model, self._settings, self.hypotheses = model, settings, tuple(hypotheses)
        self._active: dict[str, Hypothesis] = {}

    def __len__(self) -> int:
        return len(self._active)

    @property
    def causes(self) -> tuple[str, ...]:
        """Causes that may be active."""
        return tuple(dict.fromkeys(hypothesis.cause for hypothesis in self.hypotheses))

    @property
    def latest(self) -> Hypothesis:
        """The fault that was added last."""
        return next(reversed(self._active.values()))

    def clear(self) -> None:
        """End all active faults."""
        self._active = {}

    def adopt(self, sizes: Mapping[str, float]) -> None:
        """Make exactly these causes active, with these sizes (NaN: the cause has no size).

        Raises:
            KeyError: no hypothesis has such a cause.
        """
        known = {hypothesis.cause: hypothesis for hypothesis in reversed(self.hypotheses)}
        self._active = {
            cause: known[cause] if math.isnan(size) else self._of_size(cause, size) for cause, size in sizes.items()
        }

    def lanes(self) -> tuple[Hypothesis, ...]:
        """Hypotheses of the lanes: the present state, the changes from here, and the return to the healthy state."""
        base = REFERENCE
        for hypothesis in self._active.values():
            base = hypothesis.after(base)
        changes = (self._adapted(hypothesis).after(base) for hypothesis in self.hypotheses)
        return replace(base, cause=HEALTHY), *changes, self._return_to_healthy()

    def unexplained(self) -> Floats:
        """Share (len(hypotheses),) of the evidence for active faults that model errors may give to each hypothesis."""
        return np.array([0.0 if h.cause in self._active else UNEXPLAINED for h in self.hypotheses])

    def _adapted(self, hypothesis: Hypothesis) -> Hypothesis:
        """A hypothesis adapted to the active faults: finer steps for the same cause, less weight for another cause."""
        if hypothesis.cause in self._active and hypothesis.has_steps:
            return self._of_size(hypothesis.cause, hypothesis.size * FINE_STEP)
        other = self._active and hypothesis.cause not in self._active
        return replace(hypothesis, weight=hypothesis.weight * SECOND_CAUSE_PRIOR) if other else hypothesis

    def _return_to_healthy(self) -> Hypothesis:
        """The hypothesis that the axis has returned to the healthy state."""
        if not self._active:
            return replace(REFERENCE, weight=1e-300)
        (cause, hypothesis), *others = self._active.items()
        alone = not others and not math.isnan(hypothesis.size)
        return Hypothesis(cause, -hypothesis.size) if alone else REFERENCE

    def ended(self, best: Share) -> list[str]:
        """Active causes that have ended, if ``best`` is the most likely change."""
        if best.cause == HEALTHY:
            return list(self._active)
        before = self._active.get(best.cause)
        if before is None or math.isnan(before.size):
            return []
        tolerance = np.fmax(ENDED_SD * best.size_sd, ENDED_SHARE * abs(before.size))
        (total,) = self.with_total_sizes((best,))
        return [best.cause] if abs(total.size) < tolerance or self.is_negligible(total) else []

    def is_negligible(self, share: Share) -> bool:
        """Whether a size is nearer to no change than to the smallest change of its cause that is tested."""
        sizes = [abs(hypothesis.size) for hypothesis in self.hypotheses if hypothesis.cause == share.cause]
        return abs(share.size) < 0.5 * min(sizes)

    def end(self, cause: str) -> None:
        """End a cause, if it is active."""
        self._active.pop(cause, None)

    def join(self, best: Share, likeliest: Hypothesis) -> None:
        """Add a change to the active fault of its cause; ``likeliest``: the likeliest hypothesis of that cause."""
        before = self._active.pop(best.cause, None)
        own_gain = likeliest.K is not None
        size = likeliest.size if own_gain else best.size + (before.size if before else 0.0)
        self._active[best.cause] = self._of_size(best.cause, size)

    def with_total_sizes(self, shares: tuple[Share, ...]) -> tuple[Share, ...]:
        """The shares with the sizes of the active faults added."""
        before = {
            cause: hypothesis.size for cause, hypothesis in self._active.items() if not math.isnan(hypothesis.size)
        }
        return tuple(replace(share, size=share.size + before.get(share.cause, 0.0)) for share in shares)

    def _of_size(self, cause: str, size: float) -> Hypothesis:
        """The hypothesis of a cause with this size: one of the bank, or a new one."""
        own = [hypothesis for hypothesis in self.hypotheses if hypothesis.cause == cause]
        same = (hypothesis for hypothesis in own if hypothesis.size == size or math.isnan(hypothesis.size))
        return next(same, None) or replace(
            candidate_cause(self._model, self._settings, cause).hypothesis(size), alike=own[0].alike
        )

    def to_array(self) -> Floats:
        """Index of the cause and size of each active fault (k, 2), to be saved."""
        causes = self.causes
        return np.array([(causes.index(c), hypothesis.size) for c, hypothesis in self._active.items()], float).reshape(
            -1, 2
        )

    def from_array(self, rows: Floats) -> None:
        """Restore the faults from ``to_array``.

        Raises:
            ValueError: the array does not belong to these hypotheses.
        """
        causes = self.causes
        known = [(int(k), float(size)) for k, size in rows]
        if any(not 0 <= k < len(causes) for k, _ in known):
            raise ValueError("a cause that these hypotheses do not have")
        self._active = {causes[k]: self._of_size(causes[k], size) for k, size in known}
