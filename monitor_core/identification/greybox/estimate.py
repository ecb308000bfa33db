"""The result of a fit, and sentences on the doubts about it."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.parameter_names import slope_name
from monitor_core.drive.structure import Drive
from monitor_core.excitation.accuracy import Accuracy
from monitor_core.identification.greybox.criterion import OUTLIER_SIGMAS
from monitor_core.identification.greybox.residuals import LEVEL as CONFIDENCE
from monitor_core.identification.greybox.residuals import Correlation
from monitor_core.identification.predictor.parameter_vector import LEVEL, Layout, whole_intervals
from monitor_core.identification.problem import RELATIVE, Problem
from monitor_core.wording import listed

_CONTRADICTS = 2.0
"""Two parts contradict each other if their estimates differ by more than this number of standard deviations."""
_FAR_APART = 0.5
"""A difference by this share of the value is reported."""


@dataclass(frozen=True, eq=False)
class Estimate:
    """Estimates with their uncertainty and the quality of their predictions.

    Attributes:
        drive: the problem's, with the state of the disturbance if there is one: what K and ``values`` belong to.
        problem: the problem with the estimates in place of its start values.
        names: (p,) free parameters, "Td" if it is free, "fm per temperature" of varying ones, "delay" if it is free.
        theta: (p,) estimates, SI.
        covariance: (p, p); infinite variance where a direction cannot be determined, NaN beside it.
        values: all parameters of the drive.
        delay_s: skew between torque and output, estimated or as given.
        K: (n,) filter gain in the drive's states; zeros for output error.
        interval_s: that K belongs to.
        lam0: innovation variance lambda_0, the output's unit squared.
        largest_error: limit that one in ten thousand prediction errors exceeds, the output's unit.
        noise: standard deviations "torque", "slow" (N m), "output", and "time_constant" (s), where K follows from
            them.
        cost: sum of squared prediction errors, or of their Huber losses.
        whiteness: autocorrelation of the prediction errors.
        independence: their correlation with past torque.
        accuracy: how well the records determine the parameters, in relative units and words.
        coloured: order of the autoregressive model of the errors in the covariance; 0: the errors are white.
        excess: (p,) ratios to the standard deviations, at least 1, where errors come back with the motion; see
            ``agreeing``.
        fit: NRMSE in per cent of each record, one step ahead: 100 (1 - |y - yhat| / |y - mean y|).
        simulate: gives ``fit_simulation``; None: the prediction is a simulation.
        iterations: evaluations of the predictor and its gradient.
        converged: whether no parameter would still move.
        moving: if not converged, the parameters that would still move by more than a tenth of their standard deviation,
            the largest move first.
        outliers: outputs of each record that count as not measured because of gross errors; empty: none.
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
    largest_error: float
    noise: Mapping[str, float]
    cost: float
    whiteness: Correlation
    independence: Correlation
    accuracy: Accuracy
    coloured: int
    excess: Floats
    fit: tuple[float, ...]
    simulate: Callable[[], tuple[float, ...]] | None
    iterations: int
    converged: bool
    moving: tuple[str, ...] = ()
    outliers: tuple[int, ...] = ()
    words: tuple[str, ...] = ()
    started_from: str = ""

    @cached_property
    def fit_simulation(self) -> tuple[float, ...]:
        """As ``fit``, for a simulation from the best initial state, without correction by the output.

        Computed when it is first read: it takes as long as some steps of the fit, and of most fits it is not needed.
        """
        return self.fit if self.simulate is None else self.simulate()

    @property
    def sd(self) -> Floats:
        """(p,) standard deviations of theta."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @property
    def correlation(self) -> Floats:
        """(p, p) of the estimates; NaN where a parameter cannot be determined."""
        with np.errstate(invalid="ignore"):
            return np.asarray(self.covariance / np.outer(self.sd, self.sd))

    def model(self, monitored: tuple[str, ...] = ()) -> AxisModel:
        """The axis with these values as nominal ones.

        Raises:
            KeyError, ValueError: what AxisModel refuses.
        """
        return AxisModel(self.drive, self.values, monitored)


def agreeing(found: Estimate, parts: Sequence[Estimate]) -> Estimate:
    """The estimate with larger standard deviations where the records show that it is wrong by more than noise.

    What the drive lacks makes an estimate wrong in another way in each motion; noise alone makes two parts of the
    records differ by little more than their standard deviations.  Where they differ by more, that of the estimate is
    multiplied by the same ratio (Birge, 1932).  What it lacks also comes back with the motion, and with it the errors:
    the standard deviation is multiplied by the larger ratio of both.  An estimate that is equally wrong in all motions
    is not seen.
    """
    factors, words = found.excess.copy(), list[str]()
    by_name = [dict(zip(part.names, zip(part.theta, part.sd, strict=True), strict=True)) for part in parts]
    for k, name in enumerate(found.names):
        if len(parts) != 2 or not all(name in values for values in by_name):
            continue
        (first, its), (last, others) = (values[name] for values in by_name)
        sure = np.hypot(its, others)
        if np.isfinite(sure) and abs(first - last) > _CONTRADICTS * sure > 0:
            factors[k] = max(factors[k], abs(first - last) / sure)
            if abs(first - last) > _FAR_APART * abs(found.theta[k]):
                words.append(f"{name} is {first:.3g} in one half of the records and {last:.3g} in the other")
    lacks = f"The halves of the records do not agree: {listed(words)}. What the drive lacks is part of these values."
    return replace(
        found,
        covariance=found.covariance * np.outer(factors, factors),
        excess=np.ones(len(found.names)),
        words=(*found.words, lacks) if words else found.words,
    )


# --- Doubts -----------------------------------------------------------------------------------------------------------


_SMALL = 0.01


def sentences(found: Estimate, layout: Layout, xi: Floats) -> Iterator[str]:
    """Doubts about the estimates, the gravest first."""
    if not found.converged:
        yield f"The search has not converged after {found.iterations} evaluations."
    yield from _singular(found.accuracy)
    yield from _uncertain(found.accuracy, found.drive.constant_torques())
    yield from _at_bounds(layout, xi)
    if not 0 <= found.delay_s <= found.interval_s:
        how = "late" if found.delay_s > 0 else "early"
        yield (
            f"The torque acts {abs(found.delay_s):.4g} s {how}, more than one interval late or ahead of its sample:"
            f" shift it by {whole_intervals(found.delay_s, found.interval_s)} samples in the record."
        )
    yield from _levels(found, layout)
    if count := sum(found.outliers):
        yield f"{count} outputs are outliers, beyond {OUTLIER_SIGMAS:g} standard deviations: they are not used."
    yield from _residuals(found)


def _uncertain(accuracy: Accuracy, constant: Sequence[str]) -> Iterator[str]:
    """Parameters that the record does not determine.  Of the terms of a load it says only how many: their sum counts.

    ``constant``: names of the constant torques, whose slopes these terms are.
    """
    terms = {name: torque for name in accuracy.names for torque in constant if name.startswith(slope_name(torque, ""))}
    uncertain = set[str]()
    for finding in accuracy.findings():
        if finding.hidden or any(name.startswith(LEVEL) for name in finding.names):
            continue
        if len(terms) > 1 and terms.keys() >= {*finding.names}:
            uncertain.update(finding.names)
        else:
            yield finding.sentence
    if uncertain:
        follows = listed(sorted({terms[name] for name in uncertain}))
        yield (
            f"{len(uncertain)} of the {len(terms)} terms that {follows} follows cannot be determined one by one: only"
            " their sum is known, in the poses and motions of these records."
        )


def _singular(accuracy: Accuracy) -> Iterator[str]:
    """The parameter to hold so that the others can be determined."""
    hidden = accuracy.hidden
    for row in hidden:
        names = [name for name, part in zip(accuracy.names, row, strict=True) if part != 0]
        if len(names) > 1:
            hold = next((name for name in RELATIVE if name in names), names[0])
            yield (
                f"The information matrix is singular: {listed(names)} cannot all be determined. Fix one of them, best"
                f" {hold}: only then do the values and standard deviations of the others have a meaning."
            )


def _at_bounds(layout: Layout, xi: Floats) -> Iterator[str]:
    lower, upper = layout.bounds()
    for entry, value, low, high in zip(layout.entries, xi, lower, upper, strict=False):
        if not entry.name.startswith(LEVEL) and value in (low, high):
            yield f"{entry.name} ended at its bound {entry.lower if value == low else entry.upper:g}."


def _levels(found: Estimate, layout: Layout) -> Iterator[str]:
    sd = dict(zip(found.accuracy.names, found.accuracy.standard_deviations.tolist(), strict=True))
    for name in layout.levels:
        if not sd[LEVEL + name] < 1:
            yield _level(found, name)


def _level(found: Estimate, name: str) -> str:
    """Sentence on torque noise that is negligible, or so large that the noise of the output cannot be seen."""
    output = found.noise["output"]
    if name == "torque" and output**2 < _SMALL * found.lam0:
        return f"Noise on the output cannot be distinguished from none: {output:.2g}; torque noise explains all errors."
    what = "white torque noise" if name == "torque" else "slow torque disturbance"
    return f"The {what} cannot be distinguished from none: {found.noise[name]:.2g} N m."


def _residuals(found: Estimate) -> Iterator[str]:
    white, independent = found.whiteness, found.independence
    if found.problem.predictor == "innovations" and white.p_value < 1 - CONFIDENCE:
        worst = int(np.argmax(np.abs(white.values)))
        yield (
            f"The prediction errors are not white (p = {white.p_value:.2g}, largest correlation"
            f" {white.values[worst]:.2f} at lag {white.lags[worst]:.0f}): the noise model is not right; the standard"
            " deviations take this into account."
        )
    if independent.p_value < 1 - CONFIDENCE:
        past = independent.lags > 0
        worst = int(np.argmax(np.abs(independent.values[past])))
        yield (
            f"The prediction errors depend on past torque (p = {independent.p_value:.2g}, largest correlation"
            f" {independent.values[past][worst]:.2f} at lag {independent.lags[past][worst]:.0f}): the drive does not"
            " describe all that the record shows."
        )
