"""The errors that copies have because of their innovations are distinguished from those within each copy."""

import numpy as np
import pytest

from monitor_core.arrays import Floats
from monitor_core.calibration.copy_excursions import copy_covariance, excess_covariance, part_sums

P, PARTS, COPIES, SAMPLES = 2, 30, 64, 200
REPEATED = 5
NONE = np.zeros(P)


def own_variances(
    rng: np.random.Generator, of_parts: Floats = NONE, off: Floats = NONE, louder: Floats = NONE
) -> Floats:
    """Variances (2, p) of copies whose parameters (p,) differ by so much in mean and log sigma."""
    differ = rng.standard_normal((2, P, COPIES)) * np.stack([off, louder])[:, :, np.newaxis]
    parts = []
    for _ in range(PARTS):
        d = rng.standard_normal((SAMPLES, P, COPIES)) * np.exp(differ[1]) + differ[0]
        parts.append(part_sums(d + of_parts[:, np.newaxis] * rng.standard_normal((P, 1))))
    return np.diag(copy_covariance(parts)).reshape(2, P)


@pytest.mark.parametrize(("row", "size"), [(0, 0.05), (0, 0.3), (1, 0.05)], ids=["off", "far off", "louder"])
def test_copies_that_differ_make_it(row: int, size: float, seed: int) -> None:
    """As much of the one parameter, and nothing of the other and of the other number."""
    rng, much = np.random.default_rng(seed), np.zeros((2, P))
    much[row, 1] = size
    found = np.sqrt(np.mean([own_variances(rng, NONE, *much) for _ in range(REPEATED)], axis=0))
    print(f"standard deviations {found.round(3).tolist()}")
    assert found[row, 1] == pytest.approx(size, rel=0.25)
    found[row, 1] = 0.0
    assert found.max() < 0.02


def test_parts_that_differ_make_none_and_hide_none(seed: int) -> None:
    """How an axis scatters from part to part belongs to its motion."""
    rng = np.random.default_rng(seed)
    of_parts, off = np.array([0.5, 0.5]), np.array([0.0, 0.05])
    found = np.sqrt(np.mean([own_variances(rng, of_parts, off) for _ in range(REPEATED)], axis=0))
    print(f"standard deviations {found.round(3).tolist()}")
    assert found[0, 1] == pytest.approx(0.05 / np.sqrt(1 + 0.5**2), rel=0.25)
    found[0, 1] = 0.0
    assert found.max() < 0.02


def test_errors_that_go_together_are_seen_to(seed: int) -> None:
    """Copies that are off and louder by the same chance."""
    rng = np.random.default_rng(seed)
    of_copy, parts = rng.standard_normal(COPIES), []
    for _ in range(PARTS):
        d = rng.standard_normal((SAMPLES, P, COPIES)) * np.exp(0.1 * of_copy) - 0.2 * of_copy
        parts.append(part_sums(d))
    error = copy_covariance(parts)
    sd = np.sqrt(np.diag(error))
    together = error / np.outer(sd, sd)
    assert (together[:P, P:] < -0.85).all()
    assert (together[:P, :P] > 0.9).all()


def test_what_stands_out_of_chance_is_told_without_it(seed: int) -> None:
    """Of 64 copies of nine numbers: nothing of chance alone, a strong one as it is, a weak one not too large."""
    rng, n = np.random.default_rng(seed), 9
    A = rng.standard_normal((n, 3 * n))
    chance = A @ A.T / (3 * n)
    root, way = np.linalg.cholesky(chance), rng.standard_normal(n)
    way /= np.linalg.norm(way)

    def found_strength(strength: float) -> float:
        x = rng.standard_normal((n, COPIES)) + np.sqrt(strength) * way[:, np.newaxis] * rng.standard_normal(COPIES)
        error = excess_covariance(np.cov(root @ x), chance, COPIES)
        return float(np.trace(np.linalg.solve(chance, error)))

    none, weak, strong = (np.mean([found_strength(s) for _ in range(200)]) for s in (0.0, 1.0, 10.0))
    print(f"of 0, 1 and 10: {none:.2f}, {weak:.2f}, {strong:.2f}")
    assert none < 0.2
    assert weak < 1.3
    assert strong == pytest.approx(10, rel=0.15)
