"""The whole way from a task to what was found."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from monitor_core.identification.estimate import Estimate
from monitor_core.identification.greybox import fit
from monitor_core.identification.record import Record
from monitor_core.identification.starting import fit_from, fit_from_scratch
from service.identification.bode import bode_of
from service.identification.errors import IdentificationError
from service.identification.estimate_scatter import colour_of
from service.identification.identification_result import Found, Provenance
from service.identification.masses import grown
from service.identification.task import Task
from service.identification.traces import traces_of

MOST_ITERATIONS = 100
_HINT = "; give values to start from in [robot.axis.model.nominal], or a longer record with more motion"
_LESS = 1 - 1e-4
"""Of the cost: where two ends are the same, that from the configured values is taken."""

Progress = Callable[[str, int, int], None]


def run(task: Task, provenance: Provenance, progress: Progress | None = None) -> Found:
    """Fit the drive, predict and simulate all records, compare with a black box.

    ``progress`` is told what is going on, in words, how many steps of it are done, and how many there are at most.

    Raises:
        IdentificationError: the fit cannot start, for instance since the drive is unstable with these values.
    """
    records = [one.record for one in task.estimation]
    told = progress or _nobody
    growth = grown(task, lambda done, most: told("rows of masses", done, most))
    try:
        estimate = _best(task, records, progress)
        if task.axis.config.interval_mean:
            estimate = _averaged(estimate, records, told)
        quarantined = [one.record for one in task.validation]
        validation = traces_of(estimate.problem, quarantined) if quarantined else ()
    except (ValueError, np.linalg.LinAlgError) as error:
        raise IdentificationError(f"no fit: {error}{_HINT if task.start == 'records' else ''}") from None
    return Found(
        task,
        estimate,
        traces_of(estimate.problem, records),
        validation,
        bode_of(estimate, None if task.unknown else task.problem, records),
        colour_of(estimate, task.axis.config.model.monitor, records),
        provenance,
        growth,
    )


def _best(task: Task, records: Sequence[Record], progress: Progress | None) -> Estimate:
    """The fit of the least cost; a search that finds nothing leaves that from the configured values.

    Raises:
        ValueError: there is none.
    """
    problem, told = task.problem, progress or _nobody

    def of_search(done: int, most: int) -> None:
        told("search for starting values", done, most)

    if task.start == "records":
        return fit_from_scratch(problem, records, progress=of_search)
    try:
        direct = fit(
            problem,
            records,
            most_iterations=MOST_ITERATIONS,
            progress=lambda done, cost: _fitting(told, done, cost),
        )
    except ValueError:
        if task.start == "values":
            raise
        return fit_from(problem, records, progress=of_search)
    if task.start == "values":
        return direct
    try:
        searched = fit_from(problem, records, progress=of_search)
    except ValueError:
        return direct
    better = searched.converged or not direct.converged
    return searched if better and searched.cost < _LESS * direct.cost else direct


def _averaged(estimate: Estimate, records: Sequence[Record], told: Progress) -> Estimate:
    """The fit for a speed that the drive averages, from that for the speed at the samples, a few percent away.

    Raises:
        ValueError: there is none.
    """
    problem = replace(estimate.problem, drive=estimate.problem.drive.with_mean_speed())
    return fit(
        problem,
        records,
        most_iterations=MOST_ITERATIONS,
        progress=lambda done, cost: _fitting(told, done, cost),
    )


def _nobody(_: str, __: int, ___: int) -> None:
    """Is told nothing."""


def _fitting(told: Progress, done: int, cost: float) -> None:
    told(f"fit, sum of squares {cost:.4g}", min(done, MOST_ITERATIONS), MOST_ITERATIONS)
