"""By how many samples a torque is late, beside friction and a weight; one that is not late stays where it is."""

import numpy as np
import pytest

from monitor_core.identification import Record, samples_late

H_S, N = 0.004, 12_000
TIMES = H_S * np.arange(N, dtype=np.float64)


def moved(rng: np.random.Generator, late_s: float, weight: float) -> Record:
    """A rigid mass that follows random accelerations, with the torque of that time sent late."""
    fine, step = H_S / 8, 8
    change = np.repeat(rng.uniform(-400, 400, N * step // 240), 240) * np.exp(-rng.uniform(0, 1))
    w = 40 * np.sin(np.cumsum(change) * fine / 40)
    angle = np.cumsum(w) * fine
    u = 0.01 * np.gradient(w, fine) + 0.01 * w + 0.3 * np.tanh(w / 0.5) + weight * np.sin(angle / 100)
    # What acts is held from a sample to the next; the mean is as good.
    u = np.repeat(u[: N * step].reshape(-1, step).mean(axis=1), step)
    sent = np.concatenate([np.full(round(late_s / fine), u[0]), u])[: N * step : step]
    sent = sent + 0.02 * rng.standard_normal(N)
    return Record(TIMES, sent, angle[: N * step : step] + 1e-4 * rng.standard_normal(N), "angle", "x")


@pytest.mark.parametrize("weight", [0.0, 4.0])
@pytest.mark.parametrize("late", [0, 1, 3, 8])
def test_it_is_found(late: int, weight: float, seed: int) -> None:
    record = moved(np.random.default_rng(seed), late * H_S, weight)
    assert samples_late([record]) == late
    turned = Record(record.t, -record.u, record.y, "angle", "x")
    assert samples_late([turned]) == late


def test_what_stands_or_is_noise_tells_nothing(seed: int) -> None:
    rng = np.random.default_rng(seed)
    assert samples_late([Record(TIMES, rng.standard_normal(N), np.zeros(N), "angle", "x")]) == 0
    assert samples_late([Record(TIMES, rng.standard_normal(N), rng.standard_normal(N), "angle", "x")]) == 0
    assert samples_late([Record(TIMES[:100], rng.standard_normal(100), TIMES[:100], "angle", "x")]) == 0
