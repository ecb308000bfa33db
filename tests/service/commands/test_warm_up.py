"""Warm-up without a thermometer, by the commands: cold records, two days of monitoring, faults, restarts."""

from __future__ import annotations

import copy
import math
import re
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from monitor_core.drive import MARGIN
from monitor_core.drive.thermal_state import MOVED
from monitor_core.monitoring import NotTested
from monitor_core.monitoring.heat_observer import corrected
from monitor_core.monitoring.lane_status import Deviations
from monitor_core.settings import Threshold
from service.commands.command_line.exit_codes import NOT_TESTED
from service.config import NamedAxis, conditions_of, load
from service.config.axis_detectors import alarm_source_of
from service.config.conditions import thermal_of
from service.config.remarks import remarks
from service.ingest.records.loaded_records import begins_cold
from service.pipeline.axes.axis_pipeline import Heat
from service.reports.replay_report import heat_words
from service.texts.alarm_words import episode_words
from service.texts.not_tested_words import not_tested_sentences
from tests.core.mismatch import Block
from tests.core.mismatch_monitor import FOUND
from tests.core.warming import Warming, WarmingPlant
from tests.service.command_line import refused, shown
from tests.service.warming_axis import CUSUM, PARAMETERS, Watcher, after_fault, identified, on_a_bus, write

pytestmark = pytest.mark.usefixtures("without_pictures")

QUICK = Warming(fast_s=60.0, slow_s=200.0)
DAY_S, NIGHT_S, STEP_S = 240.0, 8 * 3600.0, 2.5
TOO_SHORT = "becomes warmer than in any record. More than a tenth beyond that only larger changes are found"
WEIGHT = 0.2
"""N m, at a pose of 1."""


class Made(NamedTuple):
    """An axis that has been commissioned on two days, cold in the morning."""

    plant: WarmingPlant
    records: list[Path]
    config: Path
    output: str


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory, seed: int) -> Made:
    folder = tmp_path_factory.mktemp("warming")
    plant, records = WarmingPlant(np.random.default_rng(seed), warming=QUICK), list[Path]()
    for name in ("monday.csv", "tuesday.csv"):
        records.append(write(folder / name, plant.take(DAY_S)))
        plant.rest(NIGHT_S)
    words = ("--start", "values", "--free", "kT,fm,fc")
    config, output = identified(folder, FOUND, records, *words)
    text = config.read_text(encoding="utf-8").replace(CUSUM, f"{CUSUM}, alpha_2 = 400.0")
    config.write_text(text, encoding="utf-8")
    return Made(plant, records, config, output)


def in_one_hall(made: Made) -> Path:
    """The configuration of an axis whose hall is always as warm as in its records."""
    text = (made.config.parent / "nominal.toml").read_text(encoding="utf-8")
    alone = re.sub("^ambient_w = .*", "ambient_w = 0.0", text, flags=re.MULTILINE)
    assert alone != text
    made.config.with_name("one_hall_nominal.toml").write_text(alone, encoding="utf-8")
    path = made.config.with_name("one_hall.toml")
    config = made.config.read_text(encoding="utf-8").replace("nominal.toml", "one_hall_nominal.toml")
    path.write_text(config, encoding="utf-8")
    return path


def test_days_in_colder_and_warmer_halls_are_quiet_and_faults_are_named(made: Made) -> None:
    """By a fourth of the warm-up or more; without an ambient heat friction is off all day."""
    plant, fm = copy.deepcopy(made.plant), PARAMETERS.index("fm")
    watchers = [Watcher(made.config), Watcher(in_one_hall(made))]
    for hall in (-0.5, 0.3):
        plant.enter(hall)
        off = list[list[float]]()
        for _ in range(16):
            block = plant.take(DAY_S / 8)
            assert watchers[0].take(block) == []
            watchers[1].take(block)
            found = [watcher.monitor.deviations() for watcher in watchers]
            off.append([math.nan if each is None else each.d[fm] for each in found])
        followed, alone = np.abs(np.mean(off[8:], axis=0))
        assert followed < 0.6 * alone
        assert np.sign(watchers[0].thermal.ambient) == np.sign(hall)
        for name, factor in (("kT", 1.2), ("fm", 1.8)):
            (alarm,) = after_fault(plant, watchers[0], {name: factor}, 60.0)
            assert (alarm.parameter, alarm.direction) == (name, "up"), alarm
        plant.rest(NIGHT_S)
        watchers = [watcher.restarted() for watcher in watchers]


def test_the_cusum_tests_follow_the_hall_beyond_the_records_unless_the_axis_waits(made: Made) -> None:
    """They raise the alarms by default, as their allowance can grow; the models wait."""
    (hall,), (alone,) = (load(path, {}).axes for path in (made.config, in_one_hall(made)))

    def with_detector(axis: NamedAxis, **keys: object) -> NamedAxis:
        detector = axis.config.detector.model_copy(update={"alarm_source": None, **keys})
        return axis._replace(config=axis.config.model_copy(update={"detector": detector}))

    assert alarm_source_of(with_detector(hall).config, from_record=True) == "cusum"
    assert alarm_source_of(with_detector(alone).config, from_record=True) == "multimodel"
    for axis, keys, beyond in (
        (hall, {}, True),
        (hall, {"outside_calibration": "wait"}, False),
        (hall, {"alarm_source": "multimodel"}, False),
        (alone, {"outside_calibration": "widen"}, True),
        (alone, {}, False),
    ):
        margins = {schedule.margin for schedule in conditions_of(with_detector(axis, **keys)).schedules}
        assert margins == ({math.inf} if beyond else {MARGIN})


@pytest.mark.parametrize(("source", "one_hall"), [("multimodel", False), ("multimodel", True), ("cusum", False)])
def test_a_fixed_allowance_for_other_halls_is_remarked(made: Made, source: str, one_hall: bool) -> None:
    config, path = in_one_hall(made) if one_hall else made.config, made.config.with_name("source.toml")
    path.write_text(config.read_text(encoding="utf-8").replace('"cusum"', f'"{source}"'), encoding="utf-8")
    found = [remark for remark in remarks(load(path)) if "a colder or warmer hall may raise alarms" in remark]
    assert len(found) == (source == "multimodel" and not one_hall)


def test_identify_finds_that_friction_falls(made: Made) -> None:
    found = tomllib.loads((made.config.parent / "nominal.toml").read_text(encoding="utf-8"))
    assert QUICK.fast_s / 2 < found["thermal"]["time_constant_s"] < QUICK.slow_s
    falls = {
        s["parameter"]: s["slope"] * found["thermal"]["largest_w"] / found["values"][s["parameter"]]
        for s in found["schedule"]
    }
    assert set(falls) == {"fm", "fc"}
    # Of the plant they fall by 38 and 25 %, from cold on, at a warmth of 0.95.
    assert -0.65 < falls["fm"] < -0.3
    assert -0.45 < falls["fc"] < -0.1
    assert {s["signal"] for s in found["schedule"]} == {"heat"}


def test_the_records_of_the_identification_begin_cold_for_calibrate_too(made: Made) -> None:
    """Else the heat is found from the motion, and may leave the range of the records, where nothing is tested."""
    (axis,) = load(made.config, {}).axes
    first, second = map(str, made.records)
    assert begins_cold(axis, [first, second])
    assert not begins_cold(axis, [second, first])
    assert not begins_cold(axis, [f"{first}@60:"])


def test_records_that_end_before_the_axis_is_warm_are_called_too_short(made: Made) -> None:
    """Of the axis with one time constant of minutes; two times four of them are recorded."""
    found = tomllib.loads((made.config.parent / "nominal.toml").read_text(encoding="utf-8"))
    assert (TOO_SHORT in " ".join(made.output.split())) == (3 * found["thermal"]["time_constant_s"] > DAY_S)


@pytest.mark.soak
def test_an_axis_that_bears_a_weight_warms_up_too(made: Made, tmp_path: Path) -> None:
    """A weight at a pose needs another torque for the same motion: so much of it is exact."""
    found = tomllib.loads((made.config.parent / "nominal.toml").read_text(encoding="utf-8"))
    plant, rng = WarmingPlant(np.random.default_rng(3), warming=QUICK), np.random.default_rng(4)
    plant.rest(NIGHT_S)
    block = plant.take(5 * found["thermal"]["time_constant_s"])
    pose = np.repeat(rng.uniform(-1.0, 1.0, block.u.size // 1000 + 1), 1000)[: block.u.size]
    record = write(tmp_path / "long.csv", block._replace(u=block.u + WEIGHT * pose), pose=pose)
    words = ("--start", "values", "--free", "fm,fc,tau0", "--schedule", "tau0: pose")
    lines = '[[robot.axis.signal]]\nname = "pose"\ncolumn = "pose"\n'
    _, output = identified(tmp_path, FOUND, [record], *words, lines=lines)
    follows = {
        s["parameter"]: (s["signal"], s["slope"])
        for s in tomllib.loads((tmp_path / "nominal.toml").read_text(encoding="utf-8"))["schedule"]
    }
    assert {name: signal for name, (signal, _) in follows.items()} == {
        "tau0": "pose",
        "fm": "heat",
        "fc": "heat",
    }
    assert follows["tau0"][1] == pytest.approx(-WEIGHT, rel=0.05)
    assert follows["fm"][1] < 0
    assert TOO_SHORT not in " ".join(output.split())


def test_two_days_are_quiet_and_faults_are_named(made: Made) -> None:
    plant, watcher = copy.deepcopy(made.plant), Watcher(made.config)
    for _ in range(2):
        assert watcher.take(plant.take(DAY_S)) == []
        for name, factor in (("kT", 1.2), ("fm", 1.5)):
            (alarm,) = after_fault(plant, watcher, {name: factor}, 60.0)
            assert (alarm.parameter, alarm.direction) == (name, "up"), alarm
        plant.rest(NIGHT_S)
        watcher = watcher.restarted()
    assert watcher.monitor.status().untested_so_far() == {}


@pytest.mark.parametrize(("name", "factor"), [("kT", 1.2), ("fm", 1.5)])
def test_an_alarm_of_friction_names_what_would_look_the_same(made: Made, name: str, factor: float) -> None:
    plant, watcher = copy.deepcopy(made.plant), Watcher(made.config)
    watcher.take(plant.take(150.0))
    plant.break_down({name: factor})
    *_, alarm = watcher.take(plant.take(60.0))
    assert (alarm.stage, alarm.parameter) == ("named", name)
    words = episode_words(alarm, 1.0, "1")
    assert ("a warmer or colder gearbox would look the same" in words) == (name == "fm")


def test_the_monitor_leaves_out_what_the_fit_did(made: Made) -> None:
    """The axis stands for a third of the time; learned from that, too, friction would be off for good."""
    found = tomllib.loads((made.config.parent / "nominal.toml").read_text(encoding="utf-8"))
    (axis,) = load(made.config, {}).axes
    assert conditions_of(axis).min_speed == found["predictor"]["min_speed"] > 0.5


def test_sizes_count_the_largest_of_what_healthy_estimates_are_off_by(made: Made) -> None:
    monitor = Watcher(made.config).monitor
    settings, scale = monitor.settings, monitor.model.scale
    found = tomllib.loads((made.config.parent / "nominal.toml").read_text(encoding="utf-8"))
    lacks = np.array([found["thermal"]["model_error"].get(name, 0.0) for name in PARAMETERS]) / scale
    np.testing.assert_allclose(settings.size_errors(3), lacks)
    own = (Threshold(3.0, 20.0), Threshold(3.0, 20.0, 0.6, 0.15), Threshold(3.0, 20.0, 0.0, 0.15))
    calibrated = replace(settings, thresholds=own).size_errors(3)
    np.testing.assert_allclose(calibrated, [0.0, 0.2, max(lacks[2], 0.15)])


def test_a_start_at_an_unknown_heat_is_observed_from_the_motion(made: Made) -> None:
    """The one that has always watched knows the heat, another one finds it; until then nothing is tested."""
    plant, knows = copy.deepcopy(made.plant), Watcher(made.config)
    knows.take(plant.take(DAY_S))
    finds = Watcher(made.config)
    finds.take(plant.take(20.0))
    reasons = {p.not_tested for p in finds.monitor.status().parameters}
    assert reasons == set(finds.monitor.status().untested_so_far()) == {NotTested.WARM_UP}
    before = finds.heat
    assert before is not None
    assert not before.known
    block = plant.take(120.0)
    for watcher in (knows, finds):
        watcher.take(block)
    assert finds.heat is not None
    assert finds.heat.known
    assert {p.not_tested for p in finds.monitor.status().parameters} == {None}
    assert knows.heat is not None
    assert abs(finds.heat.heat_w - knows.heat.heat_w) < 4 * np.hypot(finds.heat.sd_w, knows.heat.sd_w)


def test_how_long_it_takes_at_most_is_stated_and_true(made: Made) -> None:
    """Of an axis whose friction shows nothing, as what is allowed for hides it."""
    plant, text = copy.deepcopy(made.plant), made.config.read_text(encoding="utf-8")
    config = made.config.with_name("doubtful.toml")
    config.write_text(text.replace("alpha_2 = 400.0", "alpha_1 = 0.3, alpha_2 = 4000.0"), encoding="utf-8")
    finds, started = Watcher(config), None
    for second in range(600):
        finds.take(plant.take(1.0))
        status = finds.monitor.status()
        if status.judged_in_s is not None and started is None:
            started = second, status.judged_in_s
            (words,) = not_tested_sentences(status.untested(), status)
            assert "more of samples at most" in words
            assert 'or `start = "cold"` in [robot.axis.thermal]' in words
        if started is not None and status.judged_in_s is None:
            break
    assert started is not None
    print(f"after {started[0]} s: {started[1]:.0f} s more at most; it took {second - started[0]} s")
    assert second - started[0] <= started[1] + 1.0
    text = text.replace('unwatched = "stood"', 'unwatched = "stood", start = "cold"')
    config.write_text(text, encoding="utf-8")
    cold = Watcher(config)
    cold.take(plant.take(20.0))
    assert NotTested.WARM_UP not in cold.monitor.status().untested()


def test_seconds_without_samples_in_a_motion_hardly_change_the_heat(made: Made) -> None:
    """As of a restart in the middle of production, after which the axis is at another angle."""
    plant, knows, watcher = copy.deepcopy(made.plant), Watcher(made.config), Watcher(made.config)
    day = plant.take(DAY_S)
    for each in (knows, watcher):
        each.take(day)
    way = 0.0
    while abs(way) < 2 * MOVED:
        knows.take(missed := plant.take(2.0))
        way = missed.y[-1] - day.y[-1]
    rest = plant.take(15.0)
    for each in (knows, watcher):
        each.take(rest)
    assert watcher.heat is not None
    assert knows.heat is not None
    assert watcher.heat.known
    assert watcher.heat.heat_w == pytest.approx(knows.heat.heat_w, rel=0.1)
    assert {p.not_tested for p in watcher.monitor.status().parameters} == {None}


def test_after_a_pause_the_models_wait_longer_than_the_tests_of_the_estimates(made: Made) -> None:
    """What is left of the heat is not certain then; the tests of the estimates tolerate more."""
    by_tests, plant = in_one_hall(made), copy.deepcopy(made.plant)
    config, text = made.config.with_name("models.toml"), by_tests.read_text(encoding="utf-8")
    config.write_text(re.sub("detector = .*", 'detector = { alarm_source = "multimodel" }', text), encoding="utf-8")
    watchers, waited = [Watcher(path) for path in (by_tests, config)], list[list[int]]()
    for seconds, pause_s in ((DAY_S / 3, 1.5), (5.0, 100.0), (100.0, 0.0)):
        waited.append([0, 0])
        for _ in range(round(seconds / STEP_S)):
            block = plant.take(STEP_S)
            for k, watcher in enumerate(watchers):
                watcher.take(block)
                reasons = {p.not_tested for p in watcher.monitor.status().parameters}
                waited[-1][k] += NotTested.WARM_UP in reasons
        plant.rest(pause_s)
    (_, short, long) = waited
    assert short == [0, 0]
    assert long[0] < long[1] < 100 / STEP_S


def test_after_a_pause_the_tests_allow_for_a_heat_that_is_not_certain(made: Made) -> None:
    """By its standard deviation, which falls with the heat; what follows nothing is tested as before."""
    plant, config = copy.deepcopy(made.plant), in_one_hall(made)
    watcher = Watcher(config)
    watcher.take(plant.take(DAY_S))
    (thermal,) = (thermal_of(axis.config) for axis in load(config, {}).axes)
    assert thermal is not None
    monitor, more = watcher.monitor, list[np.ndarray]()
    usual = monitor.settings.tests(len(PARAMETERS))[2] * monitor.model.scale
    slopes = {
        s["parameter"]: abs(s["slope"])
        for s in tomllib.loads(made.config.with_name("nominal.toml").read_text())["schedule"]
    }
    plant.rest(15.0)
    for seconds in (5.0, 120.0):
        watcher.take(plant.take(seconds))
        heat = watcher.heat
        assert heat is not None
        assert heat.known
        more.append(monitor.batch.allowance[:, monitor.lane] - usual)
        uncertain_w = math.sqrt(heat.sd_w**2 - thermal.error**2)
        for name, extra in zip(PARAMETERS, more[-1].tolist(), strict=True):
            # As it was some seconds ago: that is set every four memories.
            doubt = slopes.get(name, 0.0) * uncertain_w
            assert 0.99 * doubt <= extra <= 2 * doubt
    kT, fc, fm = (PARAMETERS.index(name) for name in ("kT", "fc", "fm"))
    assert more[0][kT] == 0
    assert (more[0][[fc, fm]] > 2 * more[1][[fc, fm]]).all()


def test_friction_that_no_heat_explains_does_not_move_the_heat() -> None:
    """20 W, known to 1 W, and slopes by which 1 W is 1 % of each: 2 % more friction is 2 W less, 30 % is no heat."""
    slopes, covariance = np.array([-0.01, -0.01]), 1e-6 * np.eye(2)
    for d, moves in ((0.02, True), (0.3, False)):
        found = Deviations(np.full(2, d), covariance, np.ones(2), np.zeros(2))
        observed = corrected(np.diag([1.0, 0.0]), slopes, found)
        assert (observed is not None) == moves
        assert observed is None or (observed.step.sum() < -1.0 and observed.covariance.sum() < 1.0)


def narrowed(made: Made, largest_w: float, config: str) -> Path:
    """The axis with records that were less warm, and this further line of [robot.axis.detector]."""
    folder = made.config.parent
    text = (folder / "nominal.toml").read_text(encoding="utf-8")
    schedules = tomllib.loads(text)["schedule"]
    assert {s["range"][1] for s in schedules} == {schedules[0]["range"][1]}
    text = re.sub(r"^range = \[.*\]", f"range = [0.0, {largest_w}]", text, flags=re.MULTILINE)
    (folder / "narrow.toml").write_text(text, encoding="utf-8")
    path = folder / f"axis_{config}.toml"
    detector = f'alarm_source = "cusum", outside_calibration = "{config}", '
    axis = made.config.read_text(encoding="utf-8").replace('alarm_source = "cusum", ', detector)
    path.write_text(axis.replace("nominal.toml", "narrow.toml"), encoding="utf-8")
    return path


def test_warmer_than_in_the_records_it_waits_or_allows_for_more(made: Made) -> None:
    """As configured; what is allowed for is what the straight lines change there, and faults are named yet."""
    plant = copy.deepcopy(made.plant)
    waits, widens = (Watcher(narrowed(made, 8.0, way)) for way in ("wait", "widen"))
    for seconds in (180.0, 20.0):
        block, before = plant.take(seconds), widens.heat
        for watcher in (waits, widens):
            assert watcher.take(block) == []
    assert {p.not_tested for p in waits.monitor.status().parameters} == {NotTested.CONDITIONS}
    (why,) = waits.not_tested
    assert "operating conditions exclude the samples (heat = " in why
    assert '; or `outside_calibration = "widen"`' in why.split("Needed: ")[1]
    assert waits.outside == ()
    assert {p.not_tested for p in widens.monitor.status().parameters} == {None}
    (words,) = widens.outside
    assert words.startswith("heat = ")
    assert words.endswith(", friction known from 0 to 8: tested with a wider allowance")
    monitor = widens.monitor
    usual = monitor.settings.tests(len(PARAMETERS))[2] * monitor.model.scale
    more = monitor.batch.allowance[:, monitor.lane] - usual
    slopes = {
        s["parameter"]: s["slope"] for s in tomllib.loads(made.config.with_name("nominal.toml").read_text())["schedule"]
    }
    (thermal,) = (thermal_of(axis.config) for axis in load(made.config, {}).axes)
    assert thermal is not None
    # Beyond the records, and by the start, at which nothing was known; as it was some seconds ago.
    tolerated = [
        heat.heat_w - 8.0 + math.sqrt(heat.sd_w**2 - thermal.error**2)
        for heat in (before, widens.heat)
        if heat is not None
    ]
    for name, extra in zip(PARAMETERS, more.tolist(), strict=True):
        slope, near = abs(slopes.get(name, 0.0)), 0.2 * abs(slopes["fc"])
        assert slope * min(tolerated) - near <= extra <= slope * max(tolerated) + near
    (alarm,) = after_fault(plant, widens, {"kT": 1.2}, 60.0)
    assert (alarm.parameter, alarm.direction) == ("kT", "up")


def test_the_tests_allow_for_what_the_model_lacks(made: Made) -> None:
    found = tomllib.loads((made.config.parent / "nominal.toml").read_text(encoding="utf-8"))
    lacks = found["thermal"]["model_error"]
    assert set(lacks) == {"fm", "fc"}
    monitor = Watcher(made.config).monitor
    allowed = dict(zip(PARAMETERS, monitor.settings.tests(len(PARAMETERS))[2].tolist(), strict=True))
    assert allowed["kT"] == 0.0
    for name, error in lacks.items():
        assert allowed[name] == pytest.approx(2 * error / found["values"][name])


def test_the_heat_does_not_depend_on_the_cuts_between_blocks(made: Made) -> None:
    block = copy.deepcopy(made.plant).take(120.0)
    at_once, parts = Watcher(made.config), Watcher(made.config)
    at_once.take(block)
    for start in range(0, block.y.size, 777):
        cut = slice(start, start + 777)
        parts.take(Block(block.t_us[cut], block.u[cut], block.y[cut], block.temperature[cut]))
    assert at_once.heat is not None
    assert at_once.heat.known
    assert at_once.heat == parts.heat
    for mine, other in zip(at_once.monitor.to_arrays().values(), parts.monitor.to_arrays().values(), strict=True):
        np.testing.assert_array_equal(mine, other)


def test_the_thermal_start_is_an_option_of_the_command_line(made: Made, tmp_path: Path) -> None:
    """Of a quarter of a minute, in which an unknown heat is not found yet."""
    config, record = on_a_bus(made.config), tmp_path / "short.csv"
    lines = made.records[0].read_text(encoding="utf-8").splitlines(keepends=True)
    record.write_text("".join(lines[:3000]), encoding="utf-8")
    for start, known in (("unknown", False), ("cold", True)):
        output = shown("replay", record, "--config", config, "--thermal", start, code=NOT_TESTED)
        assert ("not known yet" in output) != known
    shipped = Path(__file__).resolve().parents[3] / "config" / "reference.toml"
    assert "no axis follows its heat" in refused("replay", record, "--config", shipped, "--thermal", "cold")


def test_replay_reports_the_heat_and_what_standing_excludes(made: Made) -> None:
    output = shown("replay", made.records[0], "--config", on_a_bus(made.config))
    assert re.search(r"samples, \d\d % of them excluded by operating conditions \(gated\)", output)
    assert "cell1.axis1: its heat is " in output
    assert "No alarms." in output


@pytest.mark.parametrize(
    ("heat", "words"),
    [
        (Heat(12.34, 1.0, True, -2.1), "its heat is 12.3 ± 1 W at the end, -2.1 W of it by a colder hall"),
        (Heat(12.34, 0.0, False, 3.0), "its heat is 12.3 W at the end, +3 W of it by a warmer hall, not known yet"),
        (Heat(12.34, 1.0, True), "its heat is 12.3 ± 1 W at the end"),
    ],
)
def test_replay_says_how_warm_the_axis_and_its_hall_are(heat: Heat, words: str) -> None:
    assert heat_words(heat) == words
    assert heat_words(heat, 5.0) == words
    unknown = heat_words(heat, 95.0)
    assert unknown.startswith(f"{words}. For 1.6 min of motion it was not known, so nothing was tested")
    assert unknown.endswith("where the record begins cold, --thermal cold")
