"""Six hundred faults of the reference experiment: how many are found, named, and named right; onsets and sizes."""

from __future__ import annotations

import numpy as np
import pytest

from monitor_core.detection import Alarm
from monitor_core.excitation.reference_experiment import FAULT_AT, experiments
from tests.core.naming import FAULTS, H_US, MODEL, SAMPLES, first_named, histories

pytestmark = pytest.mark.soak

EACH = 100


@pytest.mark.parametrize("joint", [False, True], ids=["paper", "joint state"])
def test_names_of_six_hundred_faults(joint: bool, seed: int) -> None:
    """+/-20 % of kT, 1/Ja and fm, thresholds of the paper; 15 s are watched after the fault."""
    of = [_outcomes(name, factor, joint, seed + 1000 * k) for k, (name, factor) in enumerate(FAULTS)]
    print(
        f"\n{'joint state' if joint else 'the paper'}, {EACH} each: found, named, right, onset in 90 %, size in 90 %"
    )
    for (name, factor), outcome in zip(FAULTS, of, strict=True):
        shares = [float(np.mean(part)) if len(part) else np.nan for part in outcome]
        print(f"{name} x {factor:g}: " + ", ".join(f"{100 * share:.0f} %" for share in shares))
    found, named, right, onset, size = (np.concatenate(part) for part in zip(*of, strict=True))
    print(f"all: {[int(part.sum()) for part in (found, named, right)]} of {len(found)}")
    print(f"onset in its interval {np.mean(onset):.3f}, size {np.mean(size):.3f}")
    assert np.mean(found) > 0.9
    assert np.mean(named) > 0.85
    assert np.mean(right) > 0.98
    assert np.mean(onset) > 0.93
    assert np.mean(size) > (0.87 if joint else 0.84)


def _outcomes(name: str, factor: float, joint: bool, seed: int) -> tuple[np.ndarray, ...]:
    """Of each fault whether it was found and named; of those named whether right; of these onset and size."""
    t_us, u, y = experiments(range(seed, seed + EACH), {name: factor}, samples=SAMPLES)
    said, _ = histories(seed, t_us.tolist(), u, y, joint)
    after = [[e for e in episodes if e.raised_us >= FAULT_AT * H_US] for episodes in said]
    named = [e for episodes in after if (e := first_named(episodes)) is not None]
    right = [e for e in named if e.parameter == name]
    size = (factor - 1) * MODEL.theta0[MODEL.monitored.index(name)]
    return (
        np.array([bool(episodes) for episodes in after]),
        np.array([first_named(episodes) is not None for episodes in after]),
        np.array([e.parameter == name for e in named]),
        np.array([_holds_onset(e) for e in right if e.onset_high_us is not None]),
        np.array([abs(e.size - size) < 1.645 * e.size_sd for e in right]),
    )


def _holds_onset(e: Alarm) -> bool:
    assert e.onset_high_us is not None
    return (e.onset_low_us or 0) <= FAULT_AT * H_US <= e.onset_high_us
