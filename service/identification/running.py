"""The whole way from a task to what was found."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from monitor_core.identification.greybox import fit
from service.identification.bode import bode_of
from service.identification.colour import colour_of
from service.identification.errors import IdentificationError
from service.identification.found import Found, Provenance
from service.identification.task import Task
from service.identification.traces import traces_of

MOST_ITERATIONS = 100

Progress = Callable[[int, float], None]


def run(task: Task, provenance: Provenance, progress: Progress | None = None) -> Found:
    """Fit the drive, predict and simulate all records, compare with a black box.

    ``progress`` is told the number of evaluations and the cost.

    Raises:
        IdentificationError: the fit cannot start, for instance since the drive is unstable with these values.
    """
    records = [one.record for one in task.estimation]
    try:
        estimate = fit(task.problem, records, most_iterations=MOST_ITERATIONS, progress=progress)
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
