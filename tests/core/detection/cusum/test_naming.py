"""The reference experiment, from samples to names: shares named right, onset, size, a second fault, sensors."""

from collections.abc import Callable, Mapping

import numpy as np
import pytest

from monitor_core.arrays import Floats
from monitor_core.detection import Alarm
from monitor_core.excitation import multisine
from monitor_core.excitation.reference_experiment import (
    BAND_HZ,
    FAULT_AT,
    TORQUE_RMS,
    Experiment,
    experiments,
    faulty,
)
from monitor_core.modeling.standard_drives import INTERVAL_S, REFERENCE_VALUES, three_mass
from monitor_core.monitoring import AxisMonitor
from monitor_core.samples import SampleBlock
from tests.core.figures import settings_of
from tests.core.naming import (
    FAULTS,
    H_US,
    MODEL,
    SAMPLES,
    Outcomes,
    alarm_versions,
    first_named,
    histories,
    outcomes,
)
from tests.core.simulated import changing_output
from tests.shares import soaked


def test_causes_onsets_and_sizes_of_the_reference_experiment(seed: int) -> None:
    """+/-20 % in kT, 1/Ja and fm.  Of 600 such runs (100 each) all 579 that were named were named right, 98 % of
    the intervals held the onset and 91 % of the sizes lay within 1.645 of their standard deviations; of fm 81 to 87 %,
    see below.  tests/soak/test_naming.py counts more."""
    found = Outcomes.joined(outcomes(*fault, 16, seed + 100 * k) for k, fault in enumerate(FAULTS))
    print({field: np.mean(getattr(found, field)) for field in ("named", "right", "crossed", "onset", "size")})
    assert np.mean(found.named) > 0.8
    assert np.mean(found.right) > 0.94
    assert np.mean(found.right) >= np.mean(found.crossed)
    assert np.mean(found.onset) > 0.85
    assert np.mean(found.size) > 0.74
    assert "drift" not in found.kind
    assert np.mean(found.kind == "step") > 0.8


def two_faults(seed: int, first: Mapping[str, float], second: Mapping[str, float], W: int = 8) -> Experiment:
    """The first after 5 s, the second after 20 s, of 40 s."""
    rngs = [np.random.default_rng(seed + k) for k in range(W)]
    N, at = 8000, (FAULT_AT, 4000)
    u = np.stack([multisine(rng, N, INTERVAL_S, BAND_HZ, TORQUE_RMS) for rng in rngs], axis=1)
    with_first = faulty(REFERENCE_VALUES, first)
    values = (REFERENCE_VALUES, with_first, faulty(with_first, second))
    y = changing_output(three_mass("speed"), zip(values, np.split(u, at), strict=True))
    noise = np.stack([rng.standard_normal(N) for rng in rngs], axis=1)
    return Experiment(np.arange(N, dtype=np.int64) * H_US, u, y + noise)


@pytest.mark.parametrize(
    ("first", "second", "open_at_the_end"),
    soaked(
        [
            ({"kT": 1.2}, {"1/Ja": 0.8}, {"kT", "1/Ja"}),
            ({"fm": 1.5}, {"kT": 1.2}, {"fm", "kT"}),
            ({"kT": 1.2}, {"kT": 1 / 1.2}, set()),
        ],
        ({"kT": 1.2}, {"1/Ja": 0.8}, {"kT", "1/Ja"}),
        ({"kT": 1.2}, {"kT": 1 / 1.2}, set()),
    ),
)
def test_a_second_fault_is_seen_while_the_first_alarm_stands(
    first: Mapping[str, float], second: Mapping[str, float], open_at_the_end: set[str], seed: int
) -> None:
    t_us, u, y = two_faults(seed, first, second)
    versions, monitors = histories(seed, t_us.tolist(), u, y)
    found = [{e.parameter for e in m.open_alarms if e.stage == "named"} for m in monitors]
    alarms = [len({(e.raised_us, e.first) for e in episodes}) for episodes in versions]
    print(f"open at the end {found}, alarms {alarms}")
    assert sum(f == open_at_the_end for f in found) >= 6
    assert np.median(alarms) == max(len(open_at_the_end), 1)


def opposite(y: Floats) -> Floats:
    return -y


def stuck(y: Floats) -> Floats:
    return np.zeros_like(y)


@pytest.mark.parametrize(("broken", "doubt"), [(opposite, "sign"), (stuck, "still")])
def test_a_sensor_is_one_alarm_and_no_parameter(broken: Callable[[Floats], Floats], doubt: str, seed: int) -> None:
    t_us, u, y = experiments(range(seed, seed + 8), samples=SAMPLES)
    y = np.concatenate([y[:FAULT_AT], broken(y[FAULT_AT:])])
    versions, _ = histories(seed, t_us.tolist(), u, y)
    doubts: list[str] = [e.doubt for episodes in versions if (e := first_named(episodes)) is not None]
    assert len(doubts) >= 7
    assert doubts.count(doubt) >= 6


def test_names_and_onsets_do_not_depend_on_how_samples_are_cut(seed: int) -> None:
    t_us, u, y = experiments([seed], {"kT": 1.2}, samples=SAMPLES)
    at_once, cut = (AxisMonitor(MODEL, settings_of("speed", seed)) for _ in range(2))
    expected, _ = alarm_versions(at_once, SampleBlock(t_us, u[:, 0], y[:, 0]))
    rng = np.random.default_rng(seed)
    found: list[Alarm] = []
    for part in np.split(np.arange(SAMPLES), np.sort(rng.integers(0, SAMPLES, 9))):
        found += alarm_versions(cut, SampleBlock(t_us[part], u[part, 0], y[part, 0]))[0]
        again = AxisMonitor(MODEL, settings_of("speed", seed))
        again.from_arrays(cut.to_arrays())
        cut = again
    assert found == expected
    assert first_named(found) is not None
