"""Records that thresholds cannot be had from are refused, with the place and numbers."""

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from monitor_core.arrays import Floats
from monitor_core.calibration import record_doubts
from monitor_core.calibration.budget import Rates
from monitor_core.calibration.healthy_records import RecordDeviations, deviations, time_with_standstill
from monitor_core.calibration.monitored_axis import MonitoredAxis
from monitor_core.calibration.record_doubts import (
    CalibrationError,
    check_healthy,
    check_promise,
    check_records,
    check_settings,
)
from monitor_core.calibration.scatter import scatter
from monitor_core.drive.axis_model import AxisModel
from monitor_core.excitation import multisine
from monitor_core.excitation.reference_experiment import BAND_HZ, TORQUE_RMS
from monitor_core.modeling.standard_drives import reference_model
from monitor_core.monitoring import MonitoringOptions, recommended_settings
from monitor_core.samples import SampleBlock
from monitor_core.settings import Settings
from monitor_core.wording import duration
from tests.core import supervised
from tests.core.calibration.forgetting import MEMORY, forgotten
from tests.core.supervised import TORQUE_NOISE, H, moved

MODEL = reference_model("speed", ("kT", "fm"))
SETTINGS = Settings.paper(0.005, lam=1 - 1 / MEMORY)
AXIS = MonitoredAxis(MODEL, SETTINGS)
SD = 0.02
"""Of the deviations, in sizes."""


def record(rng: np.random.Generator, memories: int = 100) -> RecordDeviations:
    d = SD * forgotten(rng, memories)
    N = len(d)
    t = np.arange(N, dtype=np.int64) * 5000
    return RecordDeviations("day.csv", t, d, np.full((N, 2), 1.4 * SD), np.ones((N, 2), np.bool_), 0, 0, ())


def changed(healthy: RecordDeviations, at: int, i: int, step: float) -> RecordDeviations:
    """The estimate moves to a new value within a memory."""
    d: Floats = healthy.d.copy()
    after = np.arange(len(d) - at)
    d[at:, i] += step * (1 - np.exp(-after / MEMORY))
    return replace(healthy, d=d)


@pytest.mark.parametrize("i", [0, 1])
@pytest.mark.parametrize("sign", [1, -1])
def test_a_change_inside_is_found_with_its_place(i: int, sign: int, seed: int) -> None:
    """Of ten standard deviations: its time is right within five memories, 1.25 s."""
    rng = np.random.default_rng([seed, i])
    at = int(rng.integers(1000, 4000))
    faulty = changed(record(rng), at, i, sign * 10 * SD)
    with pytest.raises(CalibrationError, match=rf"day\.csv: {MODEL.monitored[i]} changes by") as caught:
        check_healthy(AXIS, [record(rng), faulty])
    words = str(caught.value)
    seconds = re.search(r"about ([\d.]+) s after", words)
    assert seconds
    assert abs(float(seconds[1]) - at * 0.005) < 1.25
    assert ("+" in words.split("changes by")[1][:3]) == (sign > 0)
    assert caught.value.changes


def test_a_load_that_changes_need_not_be_monitored(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Another payload, or the error of another program: the other parameters may be healthy."""
    rng = np.random.default_rng(seed)
    monkeypatch.setattr(record_doubts, "LOAD", "fm")
    for i, without in ((0, ()), (1, ("fm",))):
        with pytest.raises(CalibrationError, match="this is no healthy record") as caught:
            check_healthy(AXIS, [changed(record(rng), 2500, i, 10 * SD)])
        assert caught.value.without == without
        assert ("or take fm out of `monitor`" in str(caught.value)) == bool(without)


def test_healthy_records_pass(seed: int) -> None:
    rng = np.random.default_rng(seed)
    for _ in range(20):
        check_healthy(AXIS, [record(rng)])


def test_a_small_change_is_no_fault(seed: int) -> None:
    check_healthy(AXIS, [changed(record(np.random.default_rng(seed)), 2500, 0, SD)])


def test_a_change_that_the_tests_allow_for_is_no_fault(seed: int) -> None:
    """Estimates scatter little, so that all of these changes are sure: by another program, or by the heat."""
    healthy = record(np.random.default_rng(seed))
    precise = replace(healthy, d=0.25 * healthy.d)
    known = AXIS._replace(settings=replace(SETTINGS, model_error=(0.0, 0.1)))
    check_healthy(AXIS, [changed(precise, 2500, 1, 0.08)])
    check_healthy(known, [changed(precise, 2500, 1, 0.17)])
    for axis, i, step in ((AXIS, 1, 0.17), (known, 0, 0.17), (known, 1, 0.25)):
        with pytest.raises(CalibrationError, match="changes by"):
            check_healthy(axis, [changed(precise, 2500, i, step)])


def test_nominal_values_of_another_axis(seed: int) -> None:
    healthy = record(np.random.default_rng(seed))
    off = replace(healthy, d=healthy.d + np.array([0.0, 0.3]))
    with pytest.raises(
        CalibrationError, match=r"fm differs from its nominal value throughout, by \+(29|30|31).* identify"
    ):
        check_healthy(AXIS, [off])


def shortened(healthy: RecordDeviations) -> RecordDeviations:
    return replace(
        healthy,
        t_us=healthy.t_us[: 12 * MEMORY],
        d=healthy.d[: 12 * MEMORY],
        tested=healthy.tested[: 12 * MEMORY],
    )


def without_P0(healthy: RecordDeviations) -> RecordDeviations:
    return replace(shortened(healthy), tested=np.zeros((12 * MEMORY, 2), np.bool_), seeding=12 * MEMORY)


def without_excitation(healthy: RecordDeviations) -> RecordDeviations:
    tested = healthy.tested.copy()
    tested[500:, 1] = False
    return replace(healthy, tested=tested, confounded=("fm is not observed",))


def test_time_that_a_gate_leaves_out_does_not_count(seed: int) -> None:
    """A robot that stands between its motions: all is observed while it moves."""
    healthy = record(np.random.default_rng(seed))
    tested = np.repeat((np.arange(len(healthy.d)) % 100 < 40)[:, np.newaxis], 2, axis=1)
    rests = replace(healthy, tested=tested)
    with pytest.raises(CalibrationError, match="observed in 40 % of the time"):
        check_records(AXIS, [rests])
    check_records(AXIS, [replace(rests, gated=int(np.count_nonzero(~tested[:, 0])))])


@pytest.mark.parametrize(
    ("spoiled", "words"),
    [
        (shortened, r"3 s of the records can be used, 12 memories.*20 are needed, 5 s"),
        (without_P0, r"hold 3 s, which is too short for the tests to begin: .* at least 8.8 s"),
        (without_excitation, r"fm is observed in 10 % of the time .*2\.5 of 25 s; fm is not observed: give"),
    ],
)
def test_records_that_are_too_short_or_do_not_move(
    spoiled: Callable[[RecordDeviations], RecordDeviations], words: str
) -> None:
    with pytest.raises(CalibrationError, match=words) as caught:
        check_records(AXIS, [spoiled(record(np.random.default_rng(1)))])
    assert caught.value.without == (("fm",) if spoiled is without_excitation else ())


def test_how_long_records_must_be_where_the_axis_mostly_stands() -> None:
    """30 memories of 0.25 s of motion, ten of them to find P(0), take ten times as long where a tenth is motion."""
    healthy = record(np.random.default_rng(1))
    moving = np.repeat((np.arange(len(healthy.d)) % 100 < 10)[:, np.newaxis], 2, axis=1)
    rests = replace(healthy, tested=moving, gated=int(np.count_nonzero(~moving[:, 0])))
    words = r"5 s; the axis is at rest, or a gate is closed, for 90 % of the time, so give records of about 75 s, or"
    with pytest.raises(CalibrationError, match=words):
        check_records(AXIS, [rests])


def test_nominal_values_that_cannot_be_told() -> None:
    with pytest.raises(CalibrationError, match="fm and fc cannot be distinguished"):
        check_settings(replace(SETTINGS, unidentifiable=(("fm", "fc"),)))
    check_settings(SETTINGS)


def test_a_budget_that_cannot_be_promised(seed: int) -> None:
    rng = np.random.default_rng(seed)
    scattered = scatter([record(rng, 25)], MEMORY, rng)
    ones = np.ones(2)
    sure, unsure = Rates(ones, 1e-6, 1e-8, 1e-5, 1.0), Rates(ones, 1e-12, 1e-16, 1e-8, 1.0)
    check_promise(scattered, sure, sure, 1e5, 0.005)
    for of_copies in (unsure, replace(unsure, upper=1e-11)):
        with pytest.raises(
            CalibrationError, match=r"25 memories: too short to promise one false alarm in 58 days.*budget of"
        ):
            check_promise(scattered, of_copies, unsure, 1e9, 0.005)


def test_how_wide_it_may_be_goes_with_the_root_of_a_far_budget(seed: int) -> None:
    rng = np.random.default_rng(seed)
    scattered = scatter([record(rng, 25)], MEMORY, rng)
    ones = np.ones(2)

    def refused(times: float, memories: float) -> bool:
        stated = Rates(ones, 1e-20, 1e-21, times * 1e-20, 1.0)
        try:
            check_promise(scattered, stated, stated, memories * MEMORY, 0.005)
        except CalibrationError:
            return True
        return False

    assert [refused(times, 1e4) for times in (900.0, 1100.0)] == [False, True]
    assert [refused(times, 4e6) for times in (1900.0, 2100.0)] == [False, True]


@pytest.mark.parametrize(
    ("seconds", "words"),
    [
        *[(5.0, "5 s"), (600.0, "10 min"), (3600.0, "an hour"), (7200.0, "2 hours"), (3 * 86400.0, "3 days")],
        *[(31557600.0, "a year"), (2.5 * 31557600.0, "2.5 years")],
    ],
)
def test_times_in_words(seconds: float, words: str) -> None:
    assert duration(seconds) == words


# --- What is advised where P(0) was not found gets it found -----------------------------------------------------------


OPTIONS = MonitoringOptions(torque_noise=TORQUE_NOISE, output_noise=1.0, settling_time_s=1.0)


def checked(model: AxisModel, options: MonitoringOptions, block: SampleBlock) -> str:
    """What is wrong with a record; empty: it can be used."""
    axis = MonitoredAxis(model, recommended_settings(model, H, options))
    try:
        check_records(axis, deviations(axis, [block]))
    except CalibrationError as error:
        return str(error)
    return ""


def moving(seed: int, seconds: float, band_hz: tuple[float, float] = BAND_HZ) -> SampleBlock:
    rng = np.random.default_rng(seed)
    return SampleBlock(*moved("speed", multisine(rng, round(seconds / H), H, band_hz, TORQUE_RMS), rng))


def test_a_longer_record_or_a_shorter_memory(seed: int) -> None:
    words = checked(supervised.MODEL, OPTIONS, moving(seed, 8.0))
    match = re.search(r"give at least ([\d.]+) s .*, or set memory_s = ([\d.]+)( and joint_state = true)?$", words)
    assert match, words
    assert checked(supervised.MODEL, OPTIONS, moving(seed, float(match[1]))) == ""
    shorter = replace(OPTIONS, memory_s=float(match[2]), joint_state=True if match[3] else None)
    assert checked(supervised.MODEL, shorter, moving(seed, 8.0)) == ""


@pytest.mark.parametrize("seconds", [14.0, 25.0])
def test_a_memory_for_which_there_is_enough(seconds: float, seed: int) -> None:
    """Where P(0) was found, too."""
    axis = MonitoredAxis(supervised.MODEL, recommended_settings(supervised.MODEL, H, OPTIONS))
    block = moving(seed, seconds)
    with pytest.raises(CalibrationError, match="20 are needed, 20 s, or memory_s = ") as caught:
        check_records(axis, deviations(axis, [block]))
    error = caught.value
    assert error.memory_s is not None
    shorter = replace(OPTIONS, memory_s=error.memory_s, joint_state=error.joint_state or None)
    assert checked(supervised.MODEL, shorter, block) == ""


def test_without_the_parameter_that_cannot_be_determined(seed: int) -> None:
    slow, options = moving(seed, 15.0, (0.0, 3.0)), replace(OPTIONS, memory_s=0.3, settling_time_s=0.5)
    with_dg = replace(supervised.MODEL, monitored=("kT", "fm", "dg"), scales={}, bounds={})
    words = checked(with_dg, options, slow)
    assert words.startswith("P(0) was not found, because dg cannot be determined within a memory of 0.3 s: take it out")
    assert checked(replace(with_dg, monitored=("kT", "fm")), options, slow) == ""


def test_a_longer_memory_determines_it(seed: int) -> None:
    slow, options = moving(seed, 70.0, (0.0, 3.0)), replace(OPTIONS, memory_s=0.3, settling_time_s=0.5)
    with_dg = replace(supervised.MODEL, monitored=("kT", "fm", "dg"), scales={}, bounds={})
    assert "raise memory_s" in checked(with_dg, options, slow)
    assert checked(with_dg, replace(options, memory_s=2.0), slow) == ""


def test_the_time_to_find_a_change_contains_the_time_without_tests() -> None:
    """As far as a quarter of the longest record is longer."""

    def found(count: int, seeding: int, gated: int) -> RecordDeviations:
        values = np.zeros((count, 1))
        return RecordDeviations("a", np.arange(count), values, values, values > 0, seeding, gated, ())

    assert time_with_standstill(50.0, [found(20_000, 5_000, 0)], 0.1) == 50.0
    assert time_with_standstill(50.0, [found(20_000, 5_000, 10_000)], 0.1) == 150.0
    assert time_with_standstill(50.0, [found(20_000, 5_000, 0), found(10_000, 0, 10_000)], 0.1) == 83.0
    assert time_with_standstill(50.0, [found(20_000, 0, 19_900)], 0.1) == 500.0
    assert time_with_standstill(50.0, [found(1_000, 0, 999)], 0.1) == 50.0
