"""The time of the torque of a sample: held until the next one, that at the sample, or the mean since the one before."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from monitor_core.identification import TorqueTime, times_of_robot, torque_time
from monitor_core.identification.records.measured_record import Record
from tests.core.mismatch import NOMINAL, MismatchPlant
from tests.core.sampled_torques import LATE, record_of


@pytest.mark.parametrize("weight", [0.0, 4.0])
@pytest.mark.parametrize("interval_s", [0.004, 0.012, 0.02])
@pytest.mark.parametrize("sends", LATE)
def test_the_time_of_the_torque_is_found(sends: str, interval_s: float, weight: float, seed: int) -> None:
    found = torque_time([record_of(sends, interval_s, np.random.default_rng(seed), weight)])
    assert found is not None
    assert found.late == pytest.approx(LATE[sends], abs=0.2)  # steps of the drive are 0.08 of an interval
    assert found.sd < 0.1
    assert found.halves(interval_s) == LATE[sends]


def test_the_standard_deviation_is_that_of_repeated_records(seed: int) -> None:
    found = []
    for k in range(16):
        record = record_of("at the sample", 0.012, np.random.default_rng([seed, k]), noise=0.3)
        time = torque_time([record])
        assert time is not None
        found.append(time)
    late, sd = np.array(found).T
    assert 0.5 < np.std(late, ddof=1) / np.sqrt(np.mean(sd**2)) < 1.5
    assert np.abs(np.mean(late) - 0.5) < 0.2


def test_the_torque_of_an_axis_at_rest_does_not_count(seed: int) -> None:
    """Friction holds it, whatever it is."""
    rng = np.random.default_rng(seed)
    record = record_of("at the sample", 0.012, rng)
    parts, rest = [], 400
    for u, y in zip(np.array_split(record.u, 20), np.array_split(record.y, 20), strict=True):
        held = 2.0 * np.interp(np.arange(rest), np.arange(0, rest + 40, 40), rng.normal(size=rest // 40 + 1))
        parts.append((np.append(u, held), np.append(y, np.full(rest, y[-1]))))
    u, y = (np.concatenate(values) for values in zip(*parts, strict=True))
    found = torque_time([Record(0.012 * np.arange(u.size, dtype=np.float64), u, y, "angle", "x")])
    assert found is not None
    assert found.halves(0.004) == 0.5


@pytest.mark.parametrize("interval_s", [0.004, 0.012])
def test_friction_that_is_not_viscous_does_not_pass_for_time(interval_s: float, seed: int) -> None:
    """With viscous friction alone the torque seems held at 12 ms, with a standard deviation of a tenth of a sample."""
    record = record_of("at the sample", interval_s, np.random.default_rng(seed))
    speed = np.gradient(record.y, interval_s)
    found = torque_time([replace(record, u=record.u + 2e-3 * np.abs(speed) * speed)])
    assert found is not None
    assert abs(found.late - 0.5) < 2 * found.sd
    assert found.halves(0.012) == 0.5


def test_models_that_disagree_make_the_time_uncertain(seed: int) -> None:
    """Noise hides which is right."""
    record = record_of("at the sample", 0.012, np.random.default_rng(seed), noise=0.3)
    speed = np.gradient(record.y, 0.012)
    drag = replace(record, u=record.u + 6e-4 * np.abs(speed) * speed)
    plain, other = torque_time([record]), torque_time([drag])
    assert plain is not None
    assert other is not None
    assert other.sd > 1.3 * plain.sd


def test_an_elastic_axis_shows_none_that_is_not_there(seed: int) -> None:
    """Its arm follows the motor late, which is no time of the torque; it is held here.

    Windows of other lengths show other times, so that it says little of its robot.
    """
    for k in range(3):
        block = MismatchPlant(NOMINAL, np.random.default_rng([seed, k])).take(600.0)
        t = 1e-6 * block[0].astype(np.float64)
        found = torque_time([Record(t - t[0], block[1], block[2], "angle", "x")])
        assert found is None or (found.halves(0.005) == 0 and found.sd > 0.3)


def test_what_stands_or_is_noise_or_short_shows_none(seed: int) -> None:
    rng, N = np.random.default_rng(seed), 12_000
    t = 0.004 * np.arange(N, dtype=np.float64)
    assert torque_time([Record(t, rng.standard_normal(N), np.zeros(N), "angle", "x")]) is None
    noise = torque_time([Record(t, rng.standard_normal(N), rng.standard_normal(N), "angle", "x")])
    assert noise is None or noise.halves(0.004) == 0
    assert torque_time([Record(t[:1000], t[:1000], t[:1000] ** 2, "angle", "x")]) is None


def test_a_long_interval_needs_evidence_for_a_held_torque_and_a_short_one_against_it() -> None:
    unknown = TorqueTime(0.3, 0.4)
    assert (unknown.halves(0.004), unknown.halves(0.012)) == (0.0, 0.5)
    assert TorqueTime(-0.1, 0.4).halves(0.012) == 0.5
    assert TorqueTime(-0.2, 0.3).halves(0.012) == 0.0
    assert TorqueTime(0.6, 0.3).halves(0.004) == 0.5
    assert TorqueTime(1.6, 0.3).halves(0.004) == 1.5
    assert TorqueTime(0.26, 0.001).halves(0.004) == 0.5
    assert TorqueTime(1.9, 0.5).halves(0.012) == 1.5  # only what is sure
    assert TorqueTime(2.7, 1.3).halves(0.004) == 0.0  # not known to half a sample
    assert TorqueTime(2.7, 1.3).halves(0.012) == 0.5


def test_axes_of_a_robot_share_their_time_unless_one_differs() -> None:
    # The scatter is beyond the standard deviations, so that the mean is less certain.
    times = {"a": TorqueTime(0.4, 0.1), "b": TorqueTime(0.6, 0.1), "c": TorqueTime(-3.0, 5.0), "d": None}
    found = times_of_robot(times)
    assert {*found} == {*times}
    for time in found.values():
        assert time.late == pytest.approx(0.5, abs=0.01)
        assert time.sd == pytest.approx(0.1 / math.sqrt(2) * math.sqrt(2.5 / 2), rel=0.01)
    # The axis that differs keeps its own, and does not count for the others.
    apart = times_of_robot({"a": TorqueTime(0.0, 0.1), "b": TorqueTime(0.1, 0.1), "c": TorqueTime(2.0, 0.4), "d": None})
    assert apart["c"] == TorqueTime(2.0, 0.4)
    for name in "abd":
        assert apart[name].late == pytest.approx(0.05)
        assert apart[name].sd == pytest.approx(0.1 / math.sqrt(2))
    # Nor is an axis that rings: where windows of other lengths show other times, its own is not known.
    ringing = times_of_robot({"a": TorqueTime(0.0, 0.1), "b": TorqueTime(0.1, 0.1), "c": TorqueTime(2.8, 1.3)})
    assert [time.late for time in ringing.values()] == pytest.approx([0.05] * 3, abs=0.02)
    two = {"a": TorqueTime(0.0, 0.1), "b": TorqueTime(1.6, 0.1)}
    assert times_of_robot({**two, "c": None}) == two
    assert times_of_robot({"a": None}) == {}
    assert times_of_robot({}) == {}
