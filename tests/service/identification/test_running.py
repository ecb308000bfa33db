"""What is found in a record of a known drive, and what the parts of it mean."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2

from monitor_core.identification.drive_response import drive_response
from monitor_core.identification.greybox import compare
from monitor_core.identification.problem import Problem
from monitor_core.identification.record import Record
from monitor_core.modeling.standard_drives import REFERENCE_VALUES, three_mass
from service.config import Config
from service.identification.bode import band
from service.identification.errors import IdentificationError
from service.identification.estimate_scatter import colour_of
from service.identification.identification_result import Found, Row
from service.identification.initial_values import Start
from service.identification.running import run
from service.identification.task import Task, Wishes, task_of
from service.identification.traces import traces_of
from tests.service.identification.conftest import FREE, GUESS, PROVENANCE


def task(folder: Path, robot: Config, *records: str, wishes: Wishes | None = None) -> Task:
    paths = [str(folder / name) for name in records]
    return task_of(robot, robot.axes[0], paths, [], wishes or Wishes(start="values", free=FREE))


def test_the_truth_is_within_what_is_reported(found: Found) -> None:
    e = found.estimate
    off = e.theta - np.array([REFERENCE_VALUES[name] for name in e.names])
    assert e.names == FREE
    assert float(off @ np.linalg.solve(e.covariance, off)) < chi2.isf(1e-6, len(FREE))
    assert (e.sd < 0.1 * np.abs(e.theta)).all()


def test_rows_hold_what_was_before(found: Found) -> None:
    rows = {row.name: row for row in found.rows()}
    assert rows["Jm"].before == GUESS["Jm"]
    assert rows["Jm"].change == pytest.approx(rows["Jm"].value / GUESS["Jm"] - 1)
    assert (rows["kT"].sd, rows["kT"].value) == (None, 1.0)
    assert set(rows) == {*REFERENCE_VALUES, "fc", "tau0"}


def test_traces_have_the_fits_of_the_engine(found: Found) -> None:
    records = [one.record for one in (*found.task.estimation, *found.task.validation)]
    expected = compare(found.estimate.problem, records)
    traces = (*found.estimation, *found.validation)
    assert [t.fit for t in traces] == pytest.approx([c.one_step for c in expected], abs=1e-6)
    assert [t.fit_simulation for t in traces] == pytest.approx([c.simulation for c in expected], abs=1e-6)
    assert min(t.fit_simulation for t in traces) > 90


def test_the_responses_agree_where_the_torque_is(found: Found) -> None:
    """Drive, black box and record, each by its own deviations; a drive as before does not."""
    b = found.bode
    assert b.before is not None
    assert b.words == ()
    assert b.black_box is not None
    assert b.measured is not None
    middle = slice(60, 240)
    for other in (b.black_box, b.measured):
        sd = np.hypot(b.drive.sd_db, other.sd_db)[middle]
        off = np.abs(b.drive.db - other.db)[middle] / sd
        assert np.median(off) < 3
        assert np.median(np.abs(b.before.db - other.db)[middle] / sd) > 10


def test_nothing_is_coloured_where_the_noise_model_is_right(found: Found) -> None:
    assert 1 <= found.colour < 2


def test_colour_is_that_of_the_errors(found: Found) -> None:
    """With a gain far too small the errors are slow, and the daemon's estimates scatter more than white ones would."""
    records = [one.record for one in found.task.estimation]
    slow = replace(found.estimate, K=found.estimate.K / 30)
    assert colour_of(slow, ("kT", "fm"), records) > 3 * found.colour


def test_what_cannot_be_told_makes_no_nominal_values(found: Found) -> None:
    assert found.trustworthy() == ""
    covariance = found.estimate.covariance.copy()
    covariance[2, 2] = np.inf
    lost = replace(found, estimate=replace(found.estimate, covariance=covariance))
    assert "Ja cannot be told" in lost.trustworthy()
    stuck = replace(found, estimate=replace(found.estimate, converged=False))
    assert "not converged" in stuck.trustworthy()


def test_a_delay_and_a_disturbance_are_found_too(folder: Path, robot: Config) -> None:
    wishes = Wishes(start="values", free=("Jm", "fm", "Ja", "kg", "ka"), delay=True, disturbance_s=0.3)
    result = run(task(folder, robot, "healthy.csv", wishes=wishes), PROVENANCE)
    rows = {row.name: row for row in result.rows()}
    assert abs(rows["delay"].value) < 1e-4
    assert rows["delay"].unit == "s"
    assert len(result.estimate.K) == 7


def test_noises_may_be_held(folder: Path, robot: Config) -> None:
    wishes = Wishes(start="values", free=("Jm", "fm", "Ja", "kg", "ka"), hold_noise=True)
    noise = task(folder, robot, "healthy.csv", wishes=wishes).problem.disturbance
    assert noise is not None
    assert (noise.torque, noise.output) == (0.05, 0.0001)
    found = run(task(folder, robot, "healthy.csv", wishes=wishes), PROVENANCE).estimate.noise
    assert found["torque"] / found["output"] == pytest.approx(500)


@pytest.mark.parametrize(
    ("wishes", "words"),
    [
        (Wishes(start="values", predictor="output-error", hold_noise=True), "no noise"),
        (Wishes(start="values", predictor="output-error", disturbance_s=1.0), "no noise"),
    ],
)
def test_wishes_that_contradict_one_another(folder: Path, robot: Config, wishes: Wishes, words: str) -> None:
    with pytest.raises(IdentificationError, match=words):
        task(folder, robot, "healthy.csv", wishes=wishes)


def test_output_error_with_the_angle_is_not_for_the_daemon(folder: Path, robot: Config) -> None:
    made = task(
        folder, robot, "healthy.csv", wishes=Wishes(start="values", free=FREE, predictor="output-error")
    )
    assert any("not for the daemon" in words for words in made.warnings)


def test_all_refused_records_are_named(folder: Path, robot: Config) -> None:
    with pytest.raises(IdentificationError, match=r"(?s)refused.*healthy.csv: only 41 .*second.csv: only 21"):
        task(folder, robot, "healthy.csv@2:2.2", "second.csv@1:1.1")


def test_the_band_is_that_of_the_torque() -> None:
    t = np.arange(0, 20, 0.002)
    u = sum(np.sin(2 * np.pi * f * t + f) for f in range(2, 21))
    f = band([Record(t, np.asarray(u), np.cumsum(u), "speed")])
    assert 0.5 <= f[0] <= 2.5
    assert 19 <= f[-1] <= 24


@pytest.mark.parametrize(
    ("delay_s", "sd_s", "kept_s", "refused"),
    [
        (0.001, 1e-4, 0.001, False),
        (-2e-5, 1e-5, 0.0, False),
        (-2e-3, 1e-5, -2e-3, True),
        (0.00501, 1e-5, 0.005, False),
        (0.012, 1e-5, 0.012, True),
    ],
)
def test_a_skew_that_the_daemon_cannot_follow(
    found: Found, delay_s: float, sd_s: float, kept_s: float, refused: bool
) -> None:
    e = found.estimate
    covariance = np.zeros((len(FREE) + 1,) * 2)
    covariance[:-1, :-1], covariance[-1, -1] = e.covariance, sd_s**2
    skewed = replace(
        e, names=(*FREE, "delay"), theta=np.append(e.theta, delay_s), covariance=covariance, delay_s=delay_s
    )
    result = replace(found, estimate=skewed)
    assert result.delay_s == kept_s
    assert bool(result.trustworthy()) == refused


def test_a_torque_that_is_recorded_too_late_or_too_early(folder: Path, robot: Config, tmp_path: Path) -> None:
    """By two samples and back: all pictures are still made."""
    table = np.loadtxt(folder / "second.csv", delimiter=",", skiprows=1)
    for shift in (2, -1):
        table[:, 1] = np.roll(table[:, 1], -shift)
        name = tmp_path / f"shifted{shift}.csv"
        np.savetxt(name, table[5:-5], delimiter=",", header="t,torque,angle", comments="", fmt="%.13g")
        wishes = Wishes(start="values", free=("Jm", "fm"), delay=True)
        problem_with = task_of(robot, robot.axes[0], [str(name)], [], wishes)
        result = run(problem_with, PROVENANCE)
        assert np.isfinite(result.bode.drive.db).all()


@pytest.mark.parametrize("start", ["search", "records"])
def test_other_starts_end_where_the_first_did(
    folder: Path, robot: Config, found: Found, start: Start
) -> None:
    """Even without looking at the guess, which is wrong by up to two."""
    made = task(folder, robot, "healthy.csv", wishes=Wishes(free=FREE, start=start))
    result = run(made, PROVENANCE)
    assert result.estimate.cost == pytest.approx(found.estimate.cost, rel=1e-3)


def test_a_search_that_finds_nothing_leaves_the_fit_from_the_values(
    folder: Path, robot: Config, found: Found, monkeypatch: pytest.MonkeyPatch
) -> None:
    def nothing(*_: object, **__: object) -> None:
        raise ValueError("no response")

    monkeypatch.setattr("service.identification.running.fit_from", nothing)
    result = run(task(folder, robot, "healthy.csv", wishes=Wishes(free=FREE)), PROVENANCE)
    assert result.estimate.cost == pytest.approx(found.estimate.cost)


def test_the_simulation_makes_its_own_friction(folder: Path, robot: Config) -> None:
    """By the simulated speed, not the measured one, which no simulation knows."""
    (angle,) = (one.record for one in task(folder, robot, "second.csv").estimation)
    record = Record(angle.t, angle.u, np.gradient(angle.y, angle.t), "speed")
    values = {**REFERENCE_VALUES, "fc": 0.3, "tau0": 0.0}
    problem = Problem(three_mass("speed"), values, ("fm",), K=(0.0, 0.0, 0.3, 0.0, 0.0))
    (expected,) = compare(problem, [record])
    (trace,) = traces_of(problem, [record])
    assert trace.fit_simulation == pytest.approx(expected.simulation, abs=1e-6)
    assert trace.fit == pytest.approx(expected.one_step, abs=1e-6)


def test_an_angle_is_shown_as_the_speed_it_makes(found: Found) -> None:
    e, shown = found.estimate, found.bode.drive
    low = shown.frequency_hz[:100]
    speed = drive_response(three_mass("speed"), e.values, e.interval_s, low)
    assert shown.db[:100] == pytest.approx(speed.db, abs=0.1)


def test_a_configured_delay_is_that_of_the_fit(folder: Path, robot: Config) -> None:
    (axis,) = robot.axes
    late = axis._replace(config=axis.config.model_copy(update={"torque_delay_s": 0.0013}))
    made = task_of(robot, late, [str(folder / "healthy.csv")], [], Wishes(start="values", free=FREE))
    assert made.problem.delay_s == 0.0013


@pytest.mark.parametrize(("start", "phases"), [("search", ["fit", "search"]), ("records", ["search"])])
def test_progress_is_told_in_every_phase(
    folder: Path, robot: Config, start: Start, phases: list[str]
) -> None:
    told = list[tuple[str, int, int]]()
    wishes = Wishes(start=start, free=FREE)
    run(task(folder, robot, "second.csv", wishes=wishes), PROVENANCE, lambda *step: told.append(step))
    words = [text.split()[0].rstrip(",") for text, _, _ in told]
    assert list(dict.fromkeys(words)) == phases
    for phase in phases:
        steps = [step for word, step in zip(words, told, strict=True) if word == phase]
        done = [step[1] for step in steps]
        assert done == sorted(done)
        assert len(set(done)) > 2
        assert all(0 <= step[1] <= step[2] for step in steps)


@pytest.mark.parametrize(("start", "hint"), [("records", True), ("values", False)])
def test_records_that_tell_nothing_are_said_with_what_would_help(
    folder: Path, robot: Config, monkeypatch: pytest.MonkeyPatch, start: Start, hint: bool
) -> None:
    def nothing(*_: object, **__: object) -> None:
        raise ValueError("no response")

    for name in ("fit", "fit_from_scratch"):
        monkeypatch.setattr(f"service.identification.running.{name}", nothing)
    with pytest.raises(IdentificationError, match="no fit: no response") as caught:
        run(task(folder, robot, "second.csv", wishes=Wishes(start=start, free=FREE)), PROVENANCE)
    assert ("; give values to start from" in str(caught.value)) == hint


def test_where_a_fit_started_is_no_doubt(found: Found) -> None:
    words = ("Jm is doubtful.", "Started from somewhere.")
    started = replace(found, estimate=replace(found.estimate, words=words))
    assert (started.warnings[-1], started.origin) == words
    assert "Started from somewhere." not in started.warnings
    assert found.origin == ""
    held, zero = (Row("tau0", "N m", "", 0.01, sd, None) for sd in (0.001, 0.005))
    assert (held.about_zero, zero.about_zero) == (False, True)
