"""Grey-box identification: the parameters of a drive that predict records best (paper, section 4; Ljung, ch. 7)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from monitor_core.identification.problem import DELAY, Disturbance, Problem
from monitor_core.identification.record import Record
from monitor_core.identification.result import Estimate

__all__ = ["DELAY", "Disturbance", "Estimate", "Problem", "fit"]


def fit(
    problem: Problem,
    records: Sequence[Record],
    start: Mapping[str, float] | Sequence[Mapping[str, float]] | None = None,
    *,
    most_iterations: int = 100,
    progress: Callable[[int, float], None] | None = None,
) -> Estimate:
    """Minimise the sum of squared prediction errors of all records over theta.

    ``start`` replaces nominal values of free parameters; several starts are tried, the best end is returned.
    ``progress`` is called with the number of the iteration and the cost.

    Raises:
        ValueError: no record, another output than the drive's, no sample measured.
    """
    raise NotImplementedError
