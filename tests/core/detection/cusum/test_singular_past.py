"""A P that has become singular says nothing, and breaks nothing: the alarm it belongs to is still told."""

import numpy as np
import pytest

from monitor_core.detection.onset import Past, change_of, scatter

N, P = 60, 2


def past(seed: int) -> Past:
    """Of estimates that scatter as P says."""
    rng = np.random.default_rng(seed)
    t_us = 1_000_000 * np.arange(N, dtype=np.int64)
    d = np.sqrt(0.5) * rng.standard_normal((N, P))
    return Past(t_us, d, np.tile(np.eye(P), (N, 1, 1)), 0.01, np.zeros(P), 1.0, 0.0)


@pytest.mark.parametrize("alone", [True, False])
@pytest.mark.parametrize("at", [0, 30, N - 2])
def test_a_singular_P_in_the_past(alone: bool, at: int, seed: int) -> None:
    sound = past(seed)
    singular = sound._replace(P=sound.P.copy())
    singular.P[at] = 1.0
    assert scatter(singular, 0) == pytest.approx(scatter(sound, 0), rel=0.5)
    assert (change_of(singular, 0, alone) is None) == (change_of(sound, 0, alone) is None)


def test_all_of_it_singular() -> None:
    nothing = past(1)._replace(P=np.ones((N, P, P)))
    assert scatter(nothing, 0) == 1.0
    assert change_of(nothing, 0, alone=False) is None
