"""Encoders as they are: angles that start again, steps, angles of the arm behind a gear that turns the other way."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from monitor_core.drive.kalman import filter_gain
from monitor_core.samples import SampleBlock
from service.config import ConfigErrors, load
from service.config.axis_settings import axis_settings
from service.config.drives import axis_model
from service.ingest.records.loaded_records import load as load_record
from service.pipeline.axes.axis_monitors import AxisMonitors, FramePipeline
from service.simulation.robot import SimulatedFault
from tests.service import robot_tables
from tests.service.axis_with_columns import written
from tests.service.pipeline.robots import blocks, live, replayed
from tests.shares import soaked

H, N, FAULT = 0.005, 4400, 3000  # the first 2000 samples find P(0)
R = 0.00847457627118644  # of the demo: angle of the arm over that of the motor
SIGNAL = 'signal = "Angle"\ncolumn = "phi"'
WATCHED = 'monitor = ["kT", "1/Ja", "fm"]'
Course = tuple[np.ndarray, np.ndarray]


def config(folder: Path, angle: str = "", *changes: tuple[str, str]) -> Path:
    """The demo's first axis; ``angle`` are further lines of its [robot.axis.angle]."""
    folder.mkdir(exist_ok=True)
    return written(folder, (SIGNAL, f"{SIGNAL}\n{angle}"), *changes, monitor=WATCHED)


@pytest.fixture(scope="module")
def course(seed: int, tmp_path_factory: pytest.TempPathFactory) -> Course:
    """Torque and motor angle; the torque constant falls by a third."""
    axis = load(config(tmp_path_factory.mktemp("course")), {}).axes[0]
    u, y = robot_tables.course(axis, seed, N, {"kT": 0.66}, FAULT)
    return u, y + 0.01  # its first angle is not about to start again


def table(folder: Path, course: Course, shown: Callable[[np.ndarray], np.ndarray], skip: range = range(0)) -> Path:
    u, y = course
    rows = zip(np.arange(N) * H, u, shown(y), strict=True)
    lines = [f"{t:.6f},{float(a)!r},{float(b)!r}" for k, (t, a, b) in enumerate(rows) if k not in skip]
    (folder / "a.csv").write_text("\n".join(["t,u,phi", *lines]))
    return folder / "a.csv"


def alike(a: dict[str, Any], b: dict[str, Any]) -> None:
    """The same estimates and alarms; the last digits of the angles differ."""
    for p, q in zip(a["parameters"], b["parameters"], strict=True):
        assert p["estimate"] == pytest.approx(q["estimate"], rel=1e-6)
    kept = ("parameter", "direction", "raised", "crossings")
    assert [[x[k] for k in kept] for x in a["alarms"]] == [[x[k] for k in kept] for x in b["alarms"]]
    assert a["counters"] == b["counters"]


COUNTS = 65536
ENCODERS: dict[str, tuple[Callable[[np.ndarray], np.ndarray], str]] = {
    "a resolver": (lambda y: y % (2 * math.pi), f"wrap_period = {2 * math.pi!r}"),
    "degrees around zero": (
        lambda y: (np.degrees(y) + 180) % 360 - 180,
        f"wrap_period = 360\nfactor = {math.radians(1)!r}",
    ),
    "turned round": (
        lambda y: (-y / 6.0 * COUNTS) % COUNTS,
        f"wrap_period = {COUNTS}\nfactor = {-6.0 / COUNTS!r}\noffset = 1.5",
    ),
    "arm, other direction": (lambda y: -R * y + 0.3, f"factor = {-1 / R!r}\noffset = {0.3 / R!r}"),
    "arm, in degrees, about to start again": (
        lambda y: (np.degrees(-R * y) + 359.999) % 360,
        f"factor = {-math.radians(1) / R!r}\nwrap_period = 360",
    ),
}


@pytest.mark.parametrize("encoder", soaked(ENCODERS, "turned round", "arm, in degrees, about to start again"))
def test_what_the_encoder_shows_changes_nothing(encoder: str, course: Course, tmp_path: Path) -> None:
    shown, angle = ENCODERS[encoder]
    plain = replayed(config(tmp_path / "plain"), table(tmp_path, course, lambda y: y))
    file = config(tmp_path / "encoder", angle)
    record = table(tmp_path, course, shown)
    if "wrap_period" in angle:
        assert np.abs(np.diff(shown(course[1]))).max() > 1  # it does start again
    assert "kT" in [a["parameter"] for a in plain["alarms"]]
    alike(replayed(file, record), plain)


def test_records_one_after_the_other_and_parts_of_one(course: Course, tmp_path: Path) -> None:
    file = config(tmp_path / "a", "wrap_period = 0.5")
    record = table(tmp_path, course, lambda y: y % 0.5)
    head, *rows = record.read_text().splitlines()
    cut = far(course)
    (tmp_path / "b.csv").write_text("\n".join([head, *rows[:cut]]))
    (tmp_path / "c.csv").write_text("\n".join([head, *rows[cut:]]))
    at_once, parts = replayed(file, record), replayed(file, tmp_path / "b.csv", tmp_path / "c.csv")
    assert at_once["parameters"] == parts["parameters"]
    assert at_once["alarms"] == parts["alarms"]


def far(course: Course) -> int:
    """A sample more than a period of 0.5 rad away from where it began."""
    return 1 + int(np.flatnonzero(np.abs(course[1] - course[1][0]) > 1)[0])


def samples(course: Course, a: int, b: int) -> dict[str, SampleBlock]:
    t = 1_000_000 + np.arange(a, b) * 5000
    return {"demo.axis1": SampleBlock(t, course[0][a:b], course[1][a:b] % 0.5)}


def test_saved_and_restored_within_a_gap(course: Course, tmp_path: Path) -> None:
    """The unwrapped angle goes on from where the saved predictor was."""
    axes = load(config(tmp_path / "a", "wrap_period = 0.5"), {}).axes
    cut = far(course)
    uninterrupted, first, second = AxisMonitors(axes), AxisMonitors(axes), AxisMonitors(axes)
    uninterrupted.update(samples(course, 0, cut))
    uninterrupted.update(samples(course, cut, N))
    first.update(samples(course, 0, cut))
    second.update({})
    second.by_id["demo.axis1"].from_arrays(first.by_id["demo.axis1"].to_arrays())
    second.update(samples(course, cut, N))
    a, b = (m.by_id["demo.axis1"].to_arrays()["floats"] for m in (uninterrupted, second))
    np.testing.assert_array_equal(a, b)


def test_half_a_turn_away_is_refused_and_counted(course: Course, tmp_path: Path) -> None:
    u, y = course
    broken = y.copy()
    broken[2500:2503] += math.pi
    file = config(tmp_path / "a", f"wrap_period = {2 * math.pi!r}")
    result = replayed(file, table(tmp_path, (u, broken), lambda y: y % (2 * math.pi)))
    assert result["dropped"]["ambiguous"] == 3
    assert sum(result["counters"].values()) == N - 3
    alike(result, replayed(file, table(tmp_path, course, lambda y: y % (2 * math.pi), skip=range(2500, 2503))))


def test_a_record_to_identify_from_is_made_whole(course: Course, tmp_path: Path) -> None:
    file = config(tmp_path / "a", f"wrap_period = {2 * math.pi!r}")
    text = str(table(tmp_path, course, lambda y: y % (2 * math.pi)))
    record, source = load_record(text, load(file, {}), "demo.axis1")
    np.testing.assert_allclose(record.y - record.y[0], course[1] - course[1][0], atol=1e-9)
    assert source.dropped["ambiguous"] == 0


def test_a_simulated_encoder_on_the_bus(seed: int, tmp_path: Path) -> None:
    """Frames as such an encoder makes them; the daemon's own pipeline sees one course."""
    fault = [SimulatedFault("demo.axis1", {"kT": 0.66}, 14.0)]
    period = 1.0
    wrapping, plain = (
        load(config(tmp_path / name, line), {}) for name, line in (("a", f"wrap_period = {period!r}"), ("b", ""))
    )
    courses = [list(blocks(read, 20.0, seed, fault)) for read in (wrapping, plain)]
    a, b = FramePipeline(wrapping), FramePipeline(plain)
    for core, frames in zip((a, b), courses, strict=True):
        live(core, frames)
    values = (v for block in courses[0] for v in a.ingests[wrapping.bus[0].name].feed_values(block))
    angles = [si for v in values if v.quantity == "angle" for si in v.si.tolist()]
    assert 0.9 * period < max(angles) - min(angles) <= period
    assert max(map(abs, angles)) <= 0.51 * period  # the signal has a sign
    facts = [core.monitors.by_id["demo.axis1"].status() for core in (a, b)]
    assert facts[0].counters == facts[1].counters
    for p, q in zip(*(f.parameters for f in facts), strict=True):
        # Steps differ by a part of one.
        assert p.estimate == pytest.approx(q.estimate, abs=0.3 * p.standard_deviation)
    kT = facts[0].parameters[0]
    assert kT.estimate == pytest.approx(0.66, abs=6 * kT.standard_deviation)


def test_resolution_is_a_noise(tmp_path: Path) -> None:
    noises = ("output_noise = 0.0001\n", "")
    file = config(tmp_path / "a", f"factor = {math.radians(1)!r}\nresolution = 0.02", noises)
    axis = load(file, {}).axes[0]
    model = axis_model(axis.config)
    noise = math.radians(0.02) / math.sqrt(12)
    assert axis_settings(axis, model).lam0 == filter_gain(model, H, 0.05, noise)[1]
    given = load(config(tmp_path / "b", "resolution = 0.02"), {}).axes[0]
    assert axis_settings(given, model).lam0 == filter_gain(model, H, 0.05, 1e-4)[1]


GRAVITY = "gc = 1.0\ngs = 0.0\nJ = 0.006\n"


@pytest.mark.parametrize(
    ("ratio", "wrap_period", "fine"),
    [(1.0, 2 * math.pi, True), (R, 2 * math.pi, False), (1.0, math.pi, False), (R, 2 * math.pi / R, True)],
)
def test_gravity_needs_to_know_where_the_arm_stands(
    ratio: float, wrap_period: float, fine: bool, tmp_path: Path
) -> None:
    weight = ("[robot.axis.model.nominal]\n", f"[robot.axis.model.nominal]\n{GRAVITY}")
    drive = ('drive = "three-mass"\n', 'drive = "one-mass-weight"\n')
    gear = (f"\nr = {R!r} ", f"\nr = {ratio!r} ")
    text = config(tmp_path / "a", f"wrap_period = {wrap_period!r}", weight, drive, gear)
    lines = text.read_text().splitlines()
    gone = ("Jm =", "Jg =", "Ja =", "kg =", "ka =", "dg =", "da =", "scales =")
    kept = [line for line in lines if not line.startswith(gone)]
    text.write_text("\n".join(kept).replace(WATCHED, 'monitor = ["kT", "fm"]'))
    if fine:
        assert load(text, {}).axes
        return
    with pytest.raises(ConfigErrors) as caught:
        load(text, {})
    assert [p.key for p in caught.value.problems] == ["robot[1].axis[1].angle.wrap_period"]
    assert "gravity depends on the position of the arm" in str(caught.value.problems[0])
