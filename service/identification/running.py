"""The whole way from a task to what was found."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from monitor_core.identification.greybox import fit
from monitor_core.identification.record import Record
from monitor_core.identification.result import Estimate
from monitor_core.identification.starting import fit_from, fit_from_scratch
from service.identification.bode import bode_of
from service.identification.colour import colour_of
from service.identification.errors import IdentificationError
from service.identification.found import Found, Provenance
from service.identification.task import Task
from service.identification.traces import traces_of

MOST_ITERATIONS = 100
_LESS = 1 - 1e-4
"""Of the cost: where two ends are the same, that from the configured values is taken."""

Progress = Callable[[int, float], None]


def run(task: Task, provenance: Provenance, progress: Progress | None = None) -> Found:
    """Fit the drive, predict and simulate all records, compare with a black box.

    ``progress`` is told the number of evaluations and the cost.

    Raises:
        IdentificationError: the fit cannot start, for instance since the drive is unstable with these values.
    """
    records = [one.record for one in task.estimation]
    try:
        estimate = _best(task, records, progress)
        kept_aside = [one.record for one in task.validation]
        validation = traces_of(estimate.problem, kept_aside) if kept_aside else ()
    except (ValueError, np.linalg.LinAlgError) as error:
        raise IdentificationError(f"no fit: {error}") from None
    return Found(
        task,
        estimate,
        traces_of(estimate.problem, records),
        validation,
        bode_of(estimate, task.problem, records),
        colour_of(estimate, task.axis.config.model.monitor, records),
        provenance,
    )


def _best(task: Task, records: Sequence[Record], progress: Progress | None) -> Estimate:
    """The fit of the least cost; a search that finds nothing leaves that from the configured values.

    Raises:
        ValueError: there is none.
    """
    problem = task.problem
    if task.start == "records":
        return fit_from_scratch(problem, records)
    try:
        direct = fit(problem, records, most_iterations=MOST_ITERATIONS, progress=progress)
    except ValueError:
        if task.start == "values":
            raise
        return fit_from(problem, records)
    if task.start == "values":
        return direct
    try:
        searched = fit_from(problem, records)
    except ValueError:
        return direct
    better = searched.converged or not direct.converged
    return searched if better and searched.cost < _LESS * direct.cost else direct
