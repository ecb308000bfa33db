"""Which parameters are free, what is found in a record of a known drive, and what the parts of it mean."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2

from monitor_core.identification import FitQuality, Record
from monitor_core.identification.assessment.bode import band
from monitor_core.identification.assessment.drive_response import drive_response
from monitor_core.identification.greybox import colour_of, traces_of
from monitor_core.identification.identification_result import ParameterRow, Start
from monitor_core.identification.parameter_selection import ParameterSelection, select_parameters
from monitor_core.identification.problem import IdentificationError, Problem
from monitor_core.modeling.standard_drives import REFERENCE_VALUES, three_mass
from service.commands.commissioning.axis.identification_task import IdentificationTask, Request, prepare
from service.config import Config
from service.config.drive_sources import model_called
from service.ingest.records.loaded_records import load
from service.reports.identification_report import IdentificationReport
from tests.service.commands.identify.conftest import FREE, GUESS, PROVENANCE, with_estimate
from tests.shares import soaked


def task(folder: Path, robot: Config, *records: str, request: Request | None = None) -> IdentificationTask:
    paths = [str(folder / name) for name in records]
    return prepare(robot, robot.axes[0], paths, [], request or Request(start="values", free=FREE))


def test_the_truth_is_within_what_is_reported_beside_what_was_before(found: IdentificationReport) -> None:
    e = found.result.estimate
    off = e.theta - np.array([REFERENCE_VALUES[name] for name in e.names])
    assert e.names == FREE
    assert float(off @ np.linalg.solve(e.covariance, off)) < chi2.isf(1e-6, len(FREE))
    assert (e.sd < 0.1 * np.abs(e.theta)).all()
    rows = {row.name: row for row in found.result.rows()}
    assert rows["Jm"].before == GUESS["Jm"]
    assert rows["Jm"].change == pytest.approx(rows["Jm"].value / GUESS["Jm"] - 1)
    assert (rows["kT"].sd, rows["kT"].value) == (None, 1.0)
    assert set(rows) == {*REFERENCE_VALUES, "fc", "tau0"}


def without(folder: Path, made: Path, *gaps_s: tuple[float, float]) -> str:
    """The healthy record, of which nothing was received in these spans."""
    first, *rows = (folder / "healthy.csv").read_text(encoding="utf-8").splitlines(keepends=True)
    times = [float(row.partition(",")[0]) for row in rows]
    kept = [row for row, t in zip(rows, times, strict=True) if not any(a < t < b for a, b in gaps_s)]
    made.write_text(first + "".join(kept), encoding="utf-8")
    return str(made)


def test_a_bus_that_was_away_for_moments_does_not_spoil_the_record(folder: Path, robot: Config, tmp_path: Path) -> None:
    path = without(folder, tmp_path / "torn.csv", (6.5, 6.95), (13.2, 13.65))
    made = prepare(robot, robot.axes[0], [path], [], Request(start="values", free=FREE))
    ends_s = [end for part in made.records.estimation for end in (part.source.start_s, part.source.end_s)]
    assert ends_s == pytest.approx([0.0, 6.5, 6.95, 13.2, 13.65, 19.995])
    complete = load(path, robot, "demo.axis1").source
    assert sum(part.source.used for part in made.records.estimation) == complete.used
    assert made.options.begins_s == pytest.approx((0.0, 6.95, 13.65))
    assert any(
        words == "torn.csv: cut at its gaps; 100 % of the samples, in 3 parts, are used." for words in made.warnings
    )
    found = made.run(PROVENANCE)
    e = found.result.estimate
    off = e.theta - np.array([REFERENCE_VALUES[name] for name in e.names])
    assert float(off @ np.linalg.solve(e.covariance, off)) < chi2.isf(1e-6, len(FREE))
    assert found.rejection == ""
    assert found.result.verdict.quality is FitQuality.GOOD


def test_a_record_of_nothing_but_gaps_is_used_as_it_is(folder: Path, robot: Config, tmp_path: Path) -> None:
    gaps = [(k + 0.5, k + 0.6) for k in range(20)]
    path = without(folder, tmp_path / "torn.csv", *gaps)
    made = prepare(robot, robot.axes[0], [path], [], Request(start="values", free=FREE))
    assert [len(part.record) for part in made.records.estimation] == [load(path, robot, "demo.axis1").source.used]
    assert any("used as a whole, since little is left between its gaps" in words for words in made.warnings)


def test_the_responses_agree_where_the_torque_is(found: IdentificationReport) -> None:
    """Drive, black box and record, each by its own deviations; a drive as before does not. An angle as its speed."""
    b = found.result.bode
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
    e, shown = found.result.estimate, found.result.bode.drive
    low = shown.frequency_hz[:100]
    speed = drive_response(three_mass("speed"), e.values, e.interval_s, low)
    assert shown.db[:100] == pytest.approx(speed.db, abs=0.1)


def test_the_largest_error_is_that_of_the_records(found: IdentificationReport) -> None:
    """One in ten thousand of white errors is beyond 3.9 standard deviations."""
    e = found.result.estimate
    assert 3.0 < e.largest_error / np.sqrt(e.lam0) < 6.0


def test_colour_is_that_of_the_errors(found: IdentificationReport, robot: Config) -> None:
    """With a gain far too small the errors are slow, and the daemon's estimates scatter more than white ones would."""
    records = [load(str(source.path), robot, found.axis_id).record for source in found.estimation]
    slow = replace(found.result.estimate, K=found.result.estimate.K / 30)
    assert colour_of(slow, ("kT", "fm"), records) > 3 * found.result.colour


def test_what_is_not_identifiable_makes_no_nominal_values(found: IdentificationReport) -> None:
    assert found.rejection == ""
    covariance = found.result.estimate.covariance.copy()
    covariance[2, 2] = np.inf
    lost = with_estimate(found, covariance=covariance)
    assert "Ja cannot be determined" in lost.rejection
    stuck = with_estimate(found, converged=False, moving=("Ja",))
    assert "not converged" in stuck.rejection
    assert "Ja would still move" in stuck.rejection


def test_output_error_with_the_angle_is_not_for_the_daemon(folder: Path, robot: Config) -> None:
    made = task(folder, robot, "healthy.csv", request=Request(start="values", free=FREE, predictor="output-error"))
    assert any("not for the daemon" in words for words in made.warnings)


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
    found: IdentificationReport, delay_s: float, sd_s: float, kept_s: float, refused: bool
) -> None:
    e = found.result.estimate
    covariance = np.zeros((len(FREE) + 1,) * 2)
    covariance[:-1, :-1], covariance[-1, -1] = e.covariance, sd_s**2
    skewed = replace(
        e, names=(*FREE, "delay"), theta=np.append(e.theta, delay_s), covariance=covariance, delay_s=delay_s
    )
    result = replace(found, result=replace(found.result, estimate=skewed))
    assert result.result.delay_s == kept_s
    assert bool(result.rejection) == refused


def test_a_torque_that_is_recorded_too_late_or_too_early(folder: Path, robot: Config, tmp_path: Path) -> None:
    """By two samples and back: all pictures are still made."""
    table = np.loadtxt(folder / "second.csv", delimiter=",", skiprows=1)
    for shift in (2, -1):
        table[:, 1] = np.roll(table[:, 1], -shift)
        name = tmp_path / f"shifted{shift}.csv"
        np.savetxt(name, table[5:-5], delimiter=",", header="t,torque,angle", comments="", fmt="%.13g")
        request = Request(start="values", free=("Jm", "fm"), delay=True)
        problem_with = prepare(robot, robot.axes[0], [str(name)], [], request)
        result = problem_with.run(PROVENANCE)
        assert np.isfinite(result.result.bode.drive.db).all()


@pytest.mark.parametrize(
    ("start", "phases"),
    soaked([("search", ["fit", "search"]), ("records", ["search"])], ("search", ["fit", "search"])),
)
def test_other_starts_end_where_the_first_did_and_report_progress_in_every_phase(
    folder: Path, robot: Config, found: IdentificationReport, start: Start, phases: list[str]
) -> None:
    """Even without looking at the guess, which is wrong by up to two."""
    made = task(folder, robot, "healthy.csv", request=Request(free=FREE, start=start))
    reported = list[tuple[str, int, int]]()
    result = made.run(PROVENANCE, lambda *step: reported.append(step))
    assert result.result.estimate.cost == pytest.approx(found.result.estimate.cost, rel=1e-3)
    words = [text.split()[0].rstrip(",") for text, _, _ in reported]
    assert list(dict.fromkeys(words)) == [*phases, "validation"]
    for phase in phases:
        steps = [step for word, step in zip(words, reported, strict=True) if word == phase]
        done = [step[1] for step in steps]
        assert done == sorted(done)
        assert len(set(done)) > 2
        assert all(0 <= step[1] <= step[2] for step in steps)


def test_a_search_that_finds_nothing_leaves_the_fit_from_the_values(
    folder: Path, robot: Config, found: IdentificationReport, monkeypatch: pytest.MonkeyPatch
) -> None:
    def nothing(*_: object, **__: object) -> None:
        raise ValueError("no response")

    monkeypatch.setattr("monitor_core.identification.identification_procedure.fit_from", nothing)
    result = task(folder, robot, "healthy.csv", request=Request(free=FREE)).run(PROVENANCE)
    assert result.result.estimate.cost == pytest.approx(found.result.estimate.cost)


def test_the_simulation_makes_its_own_friction(folder: Path, robot: Config) -> None:
    """By the simulated speed, not the measured one, which no simulation knows."""
    (angle,) = (part.record for part in task(folder, robot, "second.csv").records.estimation)
    record = Record(angle.t, angle.u, np.gradient(angle.y, angle.t), "speed")
    values = {**REFERENCE_VALUES, "fc": 0.3, "tau0": 0.0}
    problem = Problem(three_mass("speed"), values, ("fm",), K=(0.0, 0.0, 0.3, 0.0, 0.0))
    blind = replace(problem, predictor="output-error", K=None, motion="simulated")
    (trace,), (simulated,) = (traces_of(variant, [record]) for variant in (problem, blind))
    assert trace.fit_simulation == pytest.approx(simulated.fit, abs=1e-9)
    assert trace.fit > trace.fit_simulation + 1e-3


def test_a_configured_delay_is_that_of_the_fit(folder: Path, robot: Config) -> None:
    (axis,) = robot.axes
    late = axis._replace(config=axis.config.model_copy(update={"torque_delay_s": 0.0013}))
    made = prepare(robot, late, [str(folder / "healthy.csv")], [], Request(start="values", free=FREE))
    assert made.problem.delay_s == 0.0013


@pytest.mark.parametrize(("start", "hint"), [("records", True), ("values", False)])
def test_records_without_information_are_reported_with_what_would_help(
    folder: Path, robot: Config, monkeypatch: pytest.MonkeyPatch, start: Start, hint: bool
) -> None:
    def nothing(*_: object, **__: object) -> None:
        raise ValueError("no response")

    for name in ("fit", "fit_from_scratch"):
        monkeypatch.setattr(f"monitor_core.identification.identification_procedure.{name}", nothing)
    with pytest.raises(IdentificationError, match="no fit: no response") as caught:
        task(folder, robot, "second.csv", request=Request(start=start, free=FREE)).run(PROVENANCE)
    assert ("; give values to start from" in str(caught.value)) == hint


def test_a_value_about_zero() -> None:
    held, zero = (ParameterRow("tau0", "N m", "", 0.01, sd, None) for sd in (0.001, 0.005))
    assert (held.is_about_zero, zero.is_about_zero) == (False, True)


# --- free: all that can be told, or what the user says, if that makes sense ---------------------------------


VALUES = {**REFERENCE_VALUES, "fc": 0.08, "tau0": 0.01}


def chosen(*free: str, fix: tuple[str, ...] = (), values: dict[str, float] = VALUES) -> ParameterSelection:
    model = model_called("three-mass", None, "angle")
    return select_parameters(model.space, model.drive, values, free, fix)


def test_what_is_free() -> None:
    """All but kT and r; fixed ones are held beside these; free ones are the only ones, and may be reciprocals."""
    found = chosen()
    assert set(found.free) == set(VALUES) - {"kT", "r"}
    assert set(found.held) == {"kT", "r"}
    found = chosen(fix=("fc", "Jm"))
    assert set(found.free) == set(VALUES) - {"kT", "r", "fc", "Jm"}
    assert found.held["fc"] == "fixed by --fix"
    found = chosen("1/Ja", "fm", "kT")
    assert found.free == ("1/Ja", "fm", "kT")
    assert set(found.held) == set(VALUES) - {"Ja", "fm", "kT"}


EVERYTHING = ("kT", "Jm", "Jg", "Ja", "kg", "ka", "dg", "da", "fm")


def test_more_free_parameters_than_identifiable_are_refused_with_the_number() -> None:
    zeros = {**VALUES, "fc": 0.0, "tau0": 0.0}
    with pytest.raises(IdentificationError, match=r"9 parameters are free, but .* only 8 numbers.*Hold kT"):
        chosen(*EVERYTHING, values=zeros)
    # A known friction gives the scale.
    assert chosen(*EVERYTHING).free == EVERYTHING


@pytest.mark.parametrize(
    ("free", "fix", "words"),
    [
        (("jm",), (), 'did you mean "Jm"'),
        ((), ("tau",), 'did you mean "tau0"'),
        (("Jm", "fm"), ("Jm",), "Jm: cannot be both"),
        (("1/Ja",), ("Ja",), "Ja: cannot be both"),
        ((), tuple(VALUES), "nothing is free"),
    ],
)
def test_options_that_contradict_each_other_are_refused(
    free: tuple[str, ...], fix: tuple[str, ...], words: str
) -> None:
    with pytest.raises(IdentificationError, match=words):
        chosen(*free, fix=fix)
