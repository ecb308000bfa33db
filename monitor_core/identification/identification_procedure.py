"""The whole identification of a drive: starting values, fit, comparison with the records and with a black box."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from monitor_core.identification.bode import bode_of
from monitor_core.identification.greybox import fit
from monitor_core.identification.greybox.comparison import traces_of
from monitor_core.identification.greybox.covariance import colour_of
from monitor_core.identification.greybox.estimate import Estimate
from monitor_core.identification.identification_result import IdentificationResult
from monitor_core.identification.parameter_selection import ScheduledTerm
from monitor_core.identification.problem import IdentificationError, Problem
from monitor_core.identification.records.record import Record
from monitor_core.identification.starting import Growth, fit_from, fit_from_scratch, grow
from monitor_core.kernel.tables import COSINE, COULOMB, ONE, SINE

MOST_ITERATIONS = 100
MOST_MASSES, USUAL_MASSES = 9, 5
"""A motor hardly feels more masses."""

Start = Literal["values", "search", "records"]
"""Where the fit starts: at the nominal values; also at the results of a search around them in the frequency response;
from the records alone, without using the nominal values of free parameters."""

Progress = Callable[[str, int, int], None]
"""Called with the present phase, the steps done and the most steps of it."""

_BETTER = 1 - 1e-4
"""The result of a search is taken if its cost is lower by this factor; otherwise the fit from the nominal values."""


@dataclass(frozen=True)
class IdentificationOptions:
    """Options of ``identify``.

    Args:
        start: where the fit starts.
        monitored: parameters that will be monitored; the colour of the prediction errors is computed for them.
        interval_mean: the drive reports the mean speed of each interval, not the speed at the sample.
        max_masses: also compare chains of one, two, .. so many masses; None: do not.
        held: why each held parameter is held, for reports.
        unknown: free parameters whose nominal values are only placeholders.
        scheduled: parameters that follow signals of the records.
    """

    start: Start = "search"
    monitored: tuple[str, ...] = ()
    interval_mean: bool = False
    max_masses: int | None = None
    held: Mapping[str, str] = field(default_factory=dict)
    unknown: tuple[str, ...] = ()
    scheduled: tuple[ScheduledTerm, ...] = ()


def identify(
    problem: Problem,
    records: Sequence[Record],
    validation: Sequence[Record] = (),
    options: IdentificationOptions | None = None,
    progress: Progress | None = None,
) -> IdentificationResult:
    """Estimate the free parameters of a drive; simulate all records; compare with a black box.

    Args:
        problem: drive, nominal values, free parameters, predictor.
        records: to be fitted.
        validation: records that are only predicted and simulated.
        options: default: ``IdentificationOptions()``.
        progress: called while it runs.

    Raises:
        IdentificationError: the fit cannot start, for instance because the drive is unstable with the nominal values;
            masses are compared although gravity acts.
    """
    options = options or IdentificationOptions()
    report: Progress = progress or (lambda *_: None)
    most = options.max_masses
    growth = None if most is None else _growth(problem, records, validation, most, report)
    try:
        estimate = _best(problem, records, options.start, report)
        if options.interval_mean:
            # The fit for the mean speed of each interval is close to the one for the speed at the sample.
            averaged = estimate.problem.drive.with_mean_speed()
            estimate = _fit(replace(estimate.problem, drive=averaged), records, report)
        validated = traces_of(estimate.problem, validation) if validation else ()
    except (ValueError, np.linalg.LinAlgError) as error:
        hint = (
            "; give values to start from in [robot.axis.model.nominal], or a longer record with more motion"
        )
        raise IdentificationError(f"no fit: {error}{hint if options.start == 'records' else ''}") from None
    return IdentificationResult(
        problem,
        estimate,
        traces_of(estimate.problem, records),
        validated,
        bode_of(estimate, None if options.unknown else problem, records),
        colour_of(estimate, options.monitored or estimate.problem.free, records),
        growth,
        options.held,
        options.unknown,
        options.scheduled,
    )


def _best(problem: Problem, records: Sequence[Record], start: Start, report: Progress) -> Estimate:
    """The fit of least cost.

    Raises:
        ValueError: there is none.
    """

    def searching(done: int, most: int) -> None:
        report("search for starting values", done, most)

    if start == "records":
        return fit_from_scratch(problem, records, progress=searching)
    try:
        direct = _fit(problem, records, report)
    except ValueError:
        if start == "values":
            raise
        return fit_from(problem, records, progress=searching)
    if start == "values":
        return direct
    try:
        searched = fit_from(problem, records, progress=searching)
    except ValueError:
        return direct
    better = searched.converged or not direct.converged
    return searched if better and searched.cost < _BETTER * direct.cost else direct


def _fit(problem: Problem, records: Sequence[Record], report: Progress) -> Estimate:
    def fitting(done: int, cost: float) -> None:
        report(f"fit, sum of squares {cost:.4g}", min(done, MOST_ITERATIONS), MOST_ITERATIONS)

    return fit(problem, records, most_iterations=MOST_ITERATIONS, progress=fitting)


def _growth(
    problem: Problem, records: Sequence[Record], validation: Sequence[Record], most: int, report: Progress
) -> Growth:
    """Chains of one, two, .. masses, with the friction of the drive."""
    acting = _acting_inputs(problem)
    if acting & {COSINE, SINE}:
        raise IdentificationError(
            "--masses compares masses in a row without gravity, which acts on this drive"
        )
    friction = {"fm": True, "fc": COULOMB in acting, "tau0": ONE in acting}
    try:
        return grow(
            records,
            most,
            like=problem,
            friction=[name for name, acts in friction.items() if acts],
            validation=validation,
            progress=lambda done, most: report("rows of masses", done, most),
        )
    except ValueError as error:
        raise IdentificationError(f"--masses: {error}") from None


def _acting_inputs(problem: Problem) -> set[int]:
    """Kinds of the inputs that act on the drive."""
    values = {name: value or float(name in problem.free) for name, value in problem.nominal.items()}
    acts = np.flatnonzero(problem.drive.matrix("B", values).any(axis=0))
    return {problem.drive.inputs[int(column)] for column in acts}
