"""Problems and records that the tests of the grey-box fit share, and gradients by differences."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.excitation.reference_experiment import experiment
from monitor_core.identification import Record
from monitor_core.identification.predictor.prediction_errors import RecordPredictor
from monitor_core.identification.problem import Problem
from monitor_core.modeling.standard_drives import REFERENCE_VALUES, three_mass
from tests.core.cases import Case, record

EIGHT = ("Jm", "Jg", "Ja", "kg", "ka", "dg", "da", "fm")
TRUE = np.array([REFERENCE_VALUES[name] for name in EIGHT])


def reference_record(seed: int, samples: int, noise: float | None = None) -> Record:
    t_us, u, y = experiment(seed, samples=samples, fault_at=samples, noise=noise)
    return Record(np.asarray(t_us * 1e-6), u, y, "speed")


def case_record(seed: int, case: Case, samples: int, **how: float) -> Record:
    t_us, u, y = record(seed, case, samples, **how)  # type: ignore[arg-type]
    return Record(np.asarray(t_us * 1e-6), u, y, "angle" if case.output == "angle" else "speed")


def reference_problem(**settings: object) -> Problem:
    """Eight free parameters, kT held; output error unless told otherwise."""
    given = {"free": EIGHT, "nominal": REFERENCE_VALUES, "predictor": "output-error", **settings}
    return Problem(three_mass("speed"), **given)  # type: ignore[arg-type]


def perturbed(rng: np.random.Generator, spread: float) -> dict[str, float]:
    """Start values."""
    return dict(zip(EIGHT, TRUE * np.exp(spread * rng.standard_normal(len(EIGHT))), strict=True))


def all_errors(predictor: RecordPredictor, xi: Floats) -> Floats:
    found = predictor.errors(xi)
    assert all(e.good for e in found)
    return np.concatenate([e.eps for e in found])


def all_gradients(predictor: RecordPredictor, xi: Floats) -> Floats:
    """d eps / d xi (all samples, P)."""
    found = predictor.errors(xi)
    out = np.zeros((sum(e.eps.size for e in found), xi.size))
    row = 0
    for i, e in enumerate(found):
        out[row : row + e.eps.size, predictor.columns(i)] = -e.psi
        row += e.eps.size
    return out * predictor.layout.rates(xi)


def by_differences(predictor: RecordPredictor, xi: Floats, steps: Sequence[float]) -> Floats:
    """The same by differences of fourth order."""
    columns = []
    for j, h in enumerate(steps):
        e = h * np.eye(xi.size)[j]
        near = all_errors(predictor, xi + e) - all_errors(predictor, xi - e)
        far = all_errors(predictor, xi + 2 * e) - all_errors(predictor, xi - 2 * e)
        columns.append((8 * near - far) / (12 * h))
    return np.stack(columns, axis=1)


def check_gradients(predictor: RecordPredictor, tolerance: float) -> None:
    """Of all entries of the vector at its start, in units of their largest."""
    xi = predictor.start()
    analytic = all_gradients(predictor, xi)
    size = abs(analytic).max(axis=0)
    moved = np.sqrt(np.mean(all_errors(predictor, xi) ** 2)) / np.where(size > 0, size, 1.0)
    steps = 3e-4 * np.minimum(moved, 1.0)  # between rounding and what the fourth order leaves
    delay = [k for k, name in enumerate(predictor.layout.names) if name == "delay"]
    steps[delay] = np.minimum(steps[delay], 1e-5)
    numeric = by_differences(predictor, xi, steps)
    scale = np.where(size > 0, size, 1.0)
    np.testing.assert_allclose(analytic / scale, numeric / scale, rtol=0, atol=tolerance)
