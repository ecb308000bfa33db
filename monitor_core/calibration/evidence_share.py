"""Share of the evidence that counts for the probabilities of causes, from trials with known causes.

The sum of log-likelihood ratios takes each sample as new evidence.  For an exact model its probabilities are right.
The errors of a real model last for many samples, so that a wrong cause may seem certain.  Changes that were injected
into the healthy record show how often: the share is that with which probabilities proportional to p^share have the
smallest logarithmic loss (temperature scaling: Guo, Pleiss, Sun, Weinberger, "On calibration of modern neural
networks", 2017).
"""

from collections.abc import Sequence

import numpy as np
from scipy.optimize import minimize_scalar

from monitor_core.calibration.fault_trials import TrialResult

SHARE_ONSETS = 20
"""Number of onsets of each change from which the share is computed."""
_MIN_SHARE = 0.1
_LEAST = 1e-30
"""Stands for a probability of zero."""


def evidence_share(trials: Sequence[TrialResult]) -> float:
    """The share, between 0.1 and 1, from trials in which all of the evidence counts; 1 without a named change."""
    named = [(trial.fault.parameter, causes) for trial in trials for causes in trial.causes if causes]
    known = [(name, causes) for name, causes in named if name in causes]
    if not known:
        return 1.0
    names = sorted({name for _, causes in known for name in causes})
    log_p = np.log([[max(causes.get(name, 0.0), _LEAST) for name in names] for _, causes in known])
    true = np.arange(len(known)), [names.index(name) for name, _ in known]

    def loss(share: float) -> float:
        weighed = share * log_p
        return float((np.logaddexp.reduce(weighed, axis=1) - weighed[true]).mean())

    found = minimize_scalar(loss, bounds=(_MIN_SHARE, 1.0), method="bounded", options={"xatol": 1e-3})
    return 1.0 if loss(1.0) <= found.fun else float(found.x)
