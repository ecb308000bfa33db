"""Conditions of an axis beside those of its calibration: speed and signals, however the samples are cut."""

from itertools import pairwise

import numpy as np
import pytest

from monitor_core.arrays import Floats
from monitor_core.drive.structure import Output
from monitor_core.modeling.standard_drives import reference_model
from monitor_core.monitoring import (
    RMS_SPEED,
    AxisMonitor,
    CalibratedRange,
    ConditionRange,
    ConditionTracker,
    ranges,
)
from monitor_core.monitoring.calibrated_range import TOP_SPEED
from monitor_core.samples import SampleBlock, concatenate
from monitor_core.settings import Settings

H, MEMORY = 0.005, 20
SETTINGS = Settings.paper(H, lam=1 - 1 / MEMORY)


def block(seed: int, samples: int, rms: float, temperature: Floats | float, start: int = 0) -> SampleBlock:
    """Speed of noise."""
    y = rms * np.random.default_rng(seed).standard_normal(samples)
    t_us = (start + np.arange(samples)) * round(H * 1e6)
    return SampleBlock(t_us, np.zeros(samples), y, signals=np.full((samples, 1), temperature))


def tracker(output: Output = "speed") -> ConditionTracker:
    return ConditionTracker(output, SETTINGS, ("temperature",))


def test_the_rms_speed_is_known_after_ten_memories_and_near_the_truth(seed: int) -> None:
    speed, _, temperature = tracker().take(block(seed, 4000, 3.0, 20.0)).T
    assert np.isnan(speed[:199]).all()
    assert np.isfinite(speed[200:]).all()
    # The mean of 400 squares of noise: a scatter of 3.5 % of the root; six times that.
    assert abs(speed[1000:] / 3.0 - 1).max() < 0.21
    assert (temperature == 20.0).all()


@pytest.mark.parametrize("output", ["speed", "angle"])
def test_any_cut_of_the_samples_gives_the_same_bits(output: Output, seed: int) -> None:
    rng = np.random.default_rng(seed)
    samples = block(seed, 1000, 3.0, rng.uniform(10, 40, (1000, 1)))
    samples.y[rng.integers(0, 1000, 20)] = np.nan
    later = samples._replace(t_us=samples.t_us + np.where(np.arange(1000) > 600, 10**9, 0))
    at_once, piecewise = tracker(output), tracker(output)
    cuts = [0, *sorted(rng.integers(0, 1000, 30).tolist()), 1000]
    parts = [piecewise.take(later.select(slice(a, b))) for a, b in pairwise(cuts)]
    np.testing.assert_array_equal(at_once.take(later), np.concatenate(parts))


def test_the_speed_from_an_angle_is_that_of_the_speed() -> None:
    t_us = np.arange(2000) * round(H * 1e6)
    t, zero = t_us * 1e-6, np.zeros(2000)
    angle = tracker("angle").take(SampleBlock(t_us, zero, np.sin(20 * t)))
    speed = tracker("speed").take(SampleBlock(t_us, zero, 20 * np.cos(20 * t)))
    assert angle[-1, 0] == pytest.approx(speed[-1, 0], rel=0.01)


def test_outside_is_what_the_records_did_not_have_with_a_margin(seed: int) -> None:
    records = [block(seed, 2000, 3.0, 20.0), block(seed + 1, 2000, 3.0, 30.0, 2000)]
    known = ranges("speed", SETTINGS, ("temperature",), records)
    assert [r.condition for r in known] == [RMS_SPEED, TOP_SPEED, "temperature"]
    assert known[1].low == 0.0
    assert known[2] == ConditionRange("temperature", 20.0, 30.0)
    calibrated = CalibratedRange(known, tracker())
    assert calibrated.take(concatenate(records)).conditions.all()
    assert list(calibrated.outside) == []
    assert calibrated.take(block(seed, 10, 3.0, 32.9, 4000)).conditions.all()
    assert not calibrated.take(block(seed, 10, 3.0, 33.1, 4010)).conditions.any()
    assert list(calibrated.outside) == ["temperature = 33.1, calibrated from 20 to 30"]
    assert calibrated.take(block(seed, 10, 3.0, np.nan, 4020)).conditions.all()  # unknown: a gate is for that
    faster = calibrated.take(block(seed, 2000, 6.0, 25.0, 4030)).conditions
    assert not faster[-1]
    assert calibrated.outside[0].startswith("rms speed = ")


def test_the_ranges_of_a_long_record_are_those_of_its_conditions(seed: int) -> None:
    """However the samples are cut; of a signal that is never known there is no range."""
    rng = np.random.default_rng(seed)
    record = block(seed, 150_000, 3.0, rng.uniform(10, 40, (150_000, 1)))
    conditions = tracker().take(record)
    found = ranges("speed", SETTINGS, ("temperature",), [record])
    assert [(r.low, r.high) for r in found] == [
        (np.nanmin(conditions[:, 0]), np.nanmax(conditions[:, 0])),
        (0.0, np.nanmax(conditions[:, 1])),
        (conditions[:, 2].min(), conditions[:, 2].max()),
    ]
    unknown = record._replace(signals=np.full((150_000, 1), np.nan))
    assert [r.condition for r in ranges("speed", SETTINGS, ("temperature",), [unknown])] == [RMS_SPEED, TOP_SPEED]


def test_a_faster_program_with_longer_stops_is_outside_at_once() -> None:
    """Its root mean square of the speed is that of the records, and the first fast move is beyond their top speed."""
    t_us = np.arange(8000) * round(H * 1e6)
    t, zero = t_us * 1e-6, np.zeros(8000)

    def moves(top: float, share: float) -> SampleBlock:
        """Moves at this speed, each for ``share`` of a fifth of a second."""
        return SampleBlock(t_us, zero, np.where(t % 0.2 < 0.2 * share, top, 0.0), signals=np.zeros((8000, 1)))

    known = ranges("speed", SETTINGS, ("temperature",), [moves(1.0, 0.8)])
    calibrated = CalibratedRange(known, tracker())
    assert calibrated.take(moves(1.05, 0.8)).conditions.all()
    slower = CalibratedRange(known, tracker())
    assert slower.take(moves(0.98, 0.82)).conditions.all()
    faster = CalibratedRange(known, tracker())
    assert not faster.take(moves(1.4, 0.4)).conditions[2:].any()
    assert any(words.startswith("top speed = ") for words in faster.outside)
    slow = moves(1.0, 0.8)
    later = faster.take(slow._replace(t_us=slow.t_us + 8000 * round(H * 1e6))).conditions
    assert not later[0]
    assert later[-1]  # the fast moves are forgotten
    wrong = moves(1.0, 0.8)
    wrong.y[[400, 900, 2600]] = 50.0, -50.0, 50.0
    tops = tracker().take(wrong)[:, 1]
    assert np.isnan(tops[:2]).all()
    assert tops[2:].max() == pytest.approx(1.0)


def test_an_alarm_states_whether_it_was_raised_inside() -> None:
    """Of a parameter that is far off at once."""
    model = reference_model()
    settings = Settings.paper(H, P0=tuple((0.01 * model.scale) ** 2), settle_s=0.0)
    raised = []
    for inside in (True, False, None):
        monitor = AxisMonitor(model, settings)
        monitor.update(SampleBlock(np.array([0, 5000]), np.zeros(2), np.zeros(2)))
        monitor.batch.state.theta[0] = 2.0
        own = None if inside is None else np.full(400, inside)
        t_us = 10_000 + 5000 * np.arange(400)
        changes = monitor.update(SampleBlock(t_us, np.zeros(400), np.zeros(400), inside=own))
        raised.append(changes[0].alarm.inside_calibration)
        assert monitor.open_alarms[0].inside_calibration is inside
    assert raised == [True, False, None]
