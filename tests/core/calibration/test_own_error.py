"""What copies are off by for their innovations' sake: told from what they differ by all along, and only from that."""

import numpy as np
import pytest

from monitor_core.calibration.own_error import own_error
from monitor_core.kernel.tables import Floats

P, PARTS, COPIES, SAMPLES = 2, 30, 64, 100
REPEATED = 40


def told(of_parts: Floats, of_copies: Floats, louder: Floats, rng: np.random.Generator) -> Floats:
    """Variances (2, p) of noise to which parts and copies (p,) add their own, and which copies make so much louder."""
    shape = (PARTS, SAMPLES, P, COPIES)
    d = rng.standard_normal(shape) * np.exp(louder[:, np.newaxis] * rng.standard_normal((P, COPIES)))
    d += of_parts[:, np.newaxis] * rng.standard_normal((PARTS, 1, P, 1))
    d += of_copies[:, np.newaxis] * rng.standard_normal((P, COPIES))
    sums = np.stack([d.sum(axis=1), (d * d).sum(axis=1)], axis=1)
    return np.diag(own_error(sums, np.full(PARTS, float(SAMPLES)))).reshape(2, P)


def test_copies_that_differ_make_it_and_parts_do_not(seed: int) -> None:
    """How an axis scatters from part to part belongs to its motion."""
    rng = np.random.default_rng(seed)
    of_parts, of_copies, louder = np.array([0.2, 0.2]), np.array([0.0, 0.1]), np.array([0.05, 0.0])
    mean, log = np.mean([told(of_parts, of_copies, louder, rng) for _ in range(REPEATED)], axis=0)
    print(f"variances of the mean {mean}, of log sigma {log}")
    assert mean[1] == pytest.approx(0.1**2, rel=0.2)
    assert log[0] == pytest.approx(0.05**2, rel=0.2)
    assert mean[0] < 3e-4
    assert log[1] < 3e-4


def test_chance_alone_makes_hardly_any(seed: int) -> None:
    """Of copies of one standard deviation, whose means scatter by one of 54."""
    rng = np.random.default_rng(seed)
    none = np.zeros(P)
    variances = np.mean([told(none, none, none, rng) for _ in range(REPEATED)], axis=0)
    assert variances.max() < 0.25 / (PARTS * SAMPLES)


def test_errors_that_go_together_are_seen_to(seed: int) -> None:
    """Copies that are off and louder by the same chance."""
    rng = np.random.default_rng(seed)
    of_copy = rng.standard_normal(COPIES)
    d = rng.standard_normal((PARTS, SAMPLES, P, COPIES)) * np.exp(0.1 * of_copy) - 0.2 * of_copy
    sums = np.stack([d.sum(axis=1), (d * d).sum(axis=1)], axis=1)
    found = own_error(sums, np.full(PARTS, float(SAMPLES)))
    sd = np.sqrt(np.diag(found))
    together = found / sd[:, np.newaxis] / sd
    assert (together[:P, P:] < -0.85).all()
    assert (together[:P, :P] > 0.9).all()
