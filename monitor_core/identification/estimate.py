"""The result of a fit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.structure import Drive
from monitor_core.excitation.accuracy import Accuracy
from monitor_core.identification.problem import Problem
from monitor_core.identification.residuals import Correlation


@dataclass(frozen=True, eq=False)
class Estimate:
    """Estimates, how sure they are, and how well they predict.

    Attributes:
        drive: the problem's, with the state of the disturbance if there is one: what K and ``values`` belong to.
        problem: the problem with the estimates in place of what it started from; see ``compare``.
        names: (p,) free parameters, "Td" if it is free, "fm per temperature" of varying ones, "delay" if it is free.
        theta: (p,) estimates, SI.
        covariance: (p, p); infinite variance where a direction cannot be told, NaN beside it.
        values: all parameters of the drive.
        delay_s: skew between torque and output, estimated or as given.
        K: (n,) filter gain in the drive's states; zeros for output error.
        interval_s: that K belongs to.
        lam0: innovation variance lambda_0, the output's unit squared.
        noise: standard deviations "torque", "slow" (N m), "output", and "time_constant" (s), where K follows from
            them.
        cost: sum of squared prediction errors, or of their Huber losses.
        whiteness: autocorrelation of the prediction errors.
        independence: their correlation with past torque.
        accuracy: what the records tell of the parameters, in relative units and words.
        coloured: order of the autoregressive model of the errors that the covariance reckons with; 0: they are white.
        fit: NRMSE in per cent of each record, one step ahead: 100 (1 - |y - yhat| / |y - mean y|).
        fit_simulation: the same, simulated from the estimated initial state without looking at the output again.
        iterations: evaluations of the predictor and its gradient.
        converged: the fit stopped because nothing moved any more.
        moving: where it has not converged, what would still move by more than a tenth of its standard deviation, by the
            most first.
        outliers: outputs of each record that count as not measured since their errors are gross; empty: none.
        words: doubts about the estimates, in sentences.
        started_from: where the fit started, in a sentence; empty: at the values of the problem.
    """

    drive: Drive
    problem: Problem
    names: tuple[str, ...]
    theta: Floats
    covariance: Floats
    values: Mapping[str, float]
    delay_s: float
    K: Floats
    interval_s: float
    lam0: float
    noise: Mapping[str, float]
    cost: float
    whiteness: Correlation
    independence: Correlation
    accuracy: Accuracy
    coloured: int
    fit: tuple[float, ...]
    fit_simulation: tuple[float, ...]
    iterations: int
    converged: bool
    moving: tuple[str, ...] = ()
    outliers: tuple[int, ...] = ()
    words: tuple[str, ...] = field(default=())
    started_from: str = ""

    @property
    def sd(self) -> Floats:
        """(p,) standard deviations of theta."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @property
    def correlation(self) -> Floats:
        """(p, p) of the estimates; NaN where a parameter cannot be told."""
        with np.errstate(invalid="ignore"):
            return np.asarray(self.covariance / np.outer(self.sd, self.sd))

    def model(self, monitored: tuple[str, ...] = ()) -> AxisModel:
        """The axis with these values as nominal ones.

        Raises:
            KeyError, ValueError: what AxisModel refuses.
        """
        return AxisModel(self.drive, self.values, monitored)
