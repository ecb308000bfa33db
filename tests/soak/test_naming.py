"""Six hundred faults of the reference experiment: how many are found, named, and named right; onsets and sizes."""

import numpy as np
import pytest

from tests.core.naming import FAULTS, Outcomes, outcomes

pytestmark = pytest.mark.soak

EACH = 100


@pytest.mark.parametrize("joint", [False, True], ids=["paper", "joint state"])
def test_names_of_six_hundred_faults(joint: bool, seed: int) -> None:
    """+/-20 % of kT, 1/Ja and fm, thresholds of the paper; 15 s are watched after the fault."""
    several = [outcomes(*fault, EACH, seed + 1000 * k, joint) for k, fault in enumerate(FAULTS)]
    print(f"\n{'joint state' if joint else 'the paper'}, {EACH} each: found, named, right, onset and size in 90 %")
    for (name, factor), outcome in zip([*FAULTS, ("all", 1.0)], [*several, Outcomes.joined(several)], strict=True):
        shares = [float(np.mean(part)) if len(part) else np.nan for part in (*outcome[:3], outcome.onset, outcome.size)]
        print(f"{name} x {factor:g}: " + ", ".join(f"{100 * share:.1f} %" for share in shares))
    found = Outcomes.joined(several)
    assert np.mean(found.found) > 0.9
    assert np.mean(found.named) > 0.85
    assert np.mean(found.right) > 0.98
    assert np.mean(found.onset) > 0.93
    assert np.mean(found.size) > (0.87 if joint else 0.84)
