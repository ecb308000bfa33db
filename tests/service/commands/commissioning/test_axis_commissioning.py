"""The steps of one axis: fits that are repeated, which of them is kept, and why an axis is refused."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from monitor_core.calibration import CalibrationOptions
from monitor_core.identification import (
    Effect,
    FitQuality,
    IdentificationError,
    Obstacle,
    Rejection,
    Watched,
)
from service.commands.command_line.exit_codes import MISTAKE
from service.commands.commissioning.axis import axis_commissioning, axis_identification, axis_processes
from service.commands.commissioning.axis.axis_commissioning import commission_axis
from service.commands.commissioning.axis.axis_identification import lacks_of, not_identified
from service.commands.commissioning.axis.axis_job import AxisJob
from service.commands.commissioning.axis.load_search import LinkLoad, LoadSearch
from service.commands.commissioning.signals import exchanged_torques, signal_proposals
from service.commands.commissioning.signals.signal_proposals import Review
from service.config.written.commissioned import Found, configured
from service.config.written.corrections import Correction
from service.reports import identification_html
from service.reports.commissioning_report import Outcome
from service.reports.formats import Provenance
from service.reports.outlook_words import outlook_words
from tests.service.command_line import axiswatch
from tests.service.commands.commissioning.identified_axis import (
    FM,
    KT,
    NAME,
    NO_FM,
    TEXT,
    TWO,
    load_of,
    report,
    unsettled,
)


@pytest.mark.parametrize("settles", [True, False])
@pytest.mark.parametrize("fair", [False, True])
def test_a_fit_that_does_not_settle_is_repeated_with_fewer_terms(
    fair: bool, settles: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Twice at most; what the first drive lacked is no advice then, as these terms have it.

    A fair fit without these terms stands only after that.
    """
    load = load_of((Correction(("signal", "a2-acceleration", "axis"), "a2", "links"),), "cos(a2)")
    poor = report(rejection="poor", missing=(Effect.FOREIGN,))
    before = [report(KT, quality=FitQuality.FAIR)] * 2 if fair else [poor]  # a part of the records, and all of them
    reports = [*before, *[unsettled("tau0 per a2-acceleration")] * 3]
    if settles:
        reports[-1] = report(KT)
    schedules = list[tuple[str, ...]]()
    task = SimpleNamespace(records=SimpleNamespace(fitted=[()]), run=lambda *_: reports.pop(0))
    task.with_most_moving_parts = lambda: task

    def prepare(*given: Any) -> Any:
        schedules.append(given[-1].schedule)
        return task

    monkeypatch.setattr(axis_identification, "prepare", prepare)
    search = SimpleNamespace(links=_as_load(load), terms=load, pressing=None, motors_without_ratio=())
    loads: Any = SimpleNamespace(search=lambda _: search)
    monkeypatch.setattr(axis_identification, "motion_for", lambda *_: None)
    monkeypatch.setattr(axis_identification, "memory_change", lambda *_: ())
    monkeypatch.setattr(identification_html, "as_html", lambda _: "")
    monkeypatch.setattr(axis_identification, "verdict_line", lambda _: "")
    monkeypatch.setattr(axis_identification, "as_toml", lambda _: "")
    (tmp_path / "a.csv").touch()
    job = AxisJob(
        TWO, NAME, (str(tmp_path / "a.csv"),), tmp_path, CalibrationOptions(600.0), Provenance.now(), shorten=True
    )
    outcome = axis_identification.identified(job, Outcome(NAME, ""), loads, lambda *_: None)
    assert not reports
    assert [len(schedule) for schedule in schedules] == [0, 1, 1, 1]
    assert "a2-acceleration, " not in schedules[-1][0]
    left_out = sum(note.endswith("so this term is left out.") for note in outcome.notes)
    assert left_out == (0 if fair and not settles else 2)
    assert outcome.refusal == ("" if settles or fair else "not identified: the fit has not converged")


def _as_load(terms: LinkLoad | None) -> LinkLoad | None:
    """What a search that found these terms says of the load."""
    return terms if terms is not None and terms.weights.is_load else None


def commissioned_from(
    reports: list[Any],
    load: LinkLoad,
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    consent: bool = True,
    text: str = TWO,
) -> Outcome:
    """The outcome of an axis whose identifications have these reports, and whose torque shows this load of links.

    ``consent``: --yes.
    """
    task = SimpleNamespace(records=SimpleNamespace(fitted=[()]), run=lambda *_: reports.pop(0))
    task.with_most_moving_parts = lambda: task
    monkeypatch.setattr(axis_identification, "prepare", lambda *_: task)
    search = SimpleNamespace(links=_as_load(load), terms=load, pressing=None, motors_without_ratio=("a1", "a2"))
    monkeypatch.setattr(axis_commissioning, "LoadSearches", lambda *_: SimpleNamespace(search=lambda _: search))
    monkeypatch.setattr(axis_identification, "motion_for", lambda *_: None)
    monkeypatch.setattr(identification_html, "as_html", lambda _: "")
    monkeypatch.setattr(axis_identification, "verdict_line", lambda _: "")
    monkeypatch.setattr(axis_identification, "as_toml", lambda _: "")
    (folder / "a.csv").touch()
    job = AxisJob(text, NAME, (str(folder / "a.csv"),), folder, CalibrationOptions(600.0), Provenance.now(), consent)
    return commission_axis(job, Review((), (), (), ""))


@pytest.mark.parametrize("with_links", [report(KT), report(KT, rejection="poor"), report(NO_FM)])
def test_a_fair_fit_is_kept_where_that_with_links_cannot_be_watched(
    with_links: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    alone = report(KT, FM, quality=FitQuality.FAIR)
    reports = [alone, alone, with_links, with_links]  # a first look at part of the records, and all of them
    signals = (
        Correction(("signal", "a2", "axis"), "a2", "links"),
        Correction(("signal", "a2-acceleration", "axis"), "a2", "links"),
        Correction(("signal", "a2-acceleration", "acceleration"), True, "links"),
    )
    taken = list[Any]()

    def memory_change(*given: Any) -> tuple[()]:
        taken.append(given)
        return ()

    monkeypatch.setattr(axis_identification, "memory_change", memory_change)
    outcome = commissioned_from(reports, load_of(signals, "a2-acceleration"), tmp_path, monkeypatch)
    assert outcome.refusal.startswith("not calibrated: "), "no values are in that file"
    ((chosen, axis),) = taken
    better = with_links.rejection is None and with_links.result.watched == (KT,)
    assert chosen is (with_links if better else alone)
    assert outcome.watched == (("kT",) if better else ("kT", "fm"))
    assert [s.name for s in axis.signal] == (["a2", "a2-acceleration"] if better else [])
    # Of a fair fit, and where the motion of another axis counts, the pose of the arm would do so, too.
    assert outcome.notes[-1].startswith(
        "The angles of a1 and a2 turn by more than two turns, so they are those of motors"
    )
    assert (len(outcome.corrections), len(outcome.notes) - 1) == ((3, 1) if better else (1, 0))


@pytest.mark.parametrize(
    ("explained", "consent", "text", "poses"),
    [(0.93, True, TWO, ["a2"]), (0.921, True, TWO, []), (0.93, False, TWO, []), (0.93, True, TEXT, [])],
)
def test_where_links_explain_little_more_their_angles_are_signals_without_a_term(
    explained: float, consent: bool, text: str, poses: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The inertia of a base may follow them: in poses that no record has nothing is tested then."""
    good = report(KT, FM)
    angle = Correction(("signal", "a2", "axis"), "a2", "links")
    moving: dict[str, Any] = {"axis": "a2", "acceleration": True}
    signals = [Correction(("signal", "a2-acceleration", key), value, "links") for key, value in moving.items()]
    load = load_of((angle, *signals), "a2-acceleration * cos(a2)", explained=explained, before=0.92)
    outcome = commissioned_from([good, good], load, tmp_path, monkeypatch, consent, text)
    changes = {c.key: c.value for c in outcome.corrections if c.key[0] == "signal"}
    assert changes == {("signal", name, "axis"): name for name in poses}


@pytest.mark.parametrize("links", [True, False])
def test_links_are_looked_for_where_nothing_can_be_fitted_without_them(
    links: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As where a slow motion under the weight of other links gives no frequency response."""
    schedules = list[tuple[str, ...]]()

    def run(*_: Any) -> Any:
        if not schedules[-1]:
            raise IdentificationError("no fit: the records do not give a frequency response")
        return report(KT)

    task = SimpleNamespace(records=SimpleNamespace(fitted=[()]), run=run)
    task.with_most_moving_parts = lambda: task

    def prepare(*given: Any) -> Any:
        schedules.append(given[-1].schedule)
        return task

    monkeypatch.setattr(axis_identification, "prepare", prepare)
    load = load_of((Correction(("signal", "a2", "axis"), "a2", "links"),), "cos(a2)") if links else None
    search = SimpleNamespace(links=_as_load(load), terms=load, pressing=None, motors_without_ratio=())
    loads: Any = SimpleNamespace(search=lambda _: search)
    monkeypatch.setattr(axis_identification, "memory_change", lambda *_: ())
    monkeypatch.setattr(identification_html, "as_html", lambda _: "")
    monkeypatch.setattr(axis_identification, "verdict_line", lambda _: "")
    monkeypatch.setattr(axis_identification, "as_toml", lambda _: "")
    (tmp_path / "a.csv").touch()
    records = (str(tmp_path / "a.csv"),)
    job = AxisJob(TWO, NAME, records, tmp_path, CalibrationOptions(600.0), Provenance.now(), shorten=True)
    outcome = axis_identification.identified(job, Outcome(NAME, ""), loads, lambda *_: None)
    if links:
        assert (outcome.watched, outcome.refusal) == (("kT",), "")
        assert schedules == [(), ("tau0: cos(a2)",)]
    else:
        assert outcome.refusal.startswith("not identified: no fit: the records do not give a frequency response")


def test_each_axis_sees_the_corrections_of_the_others(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The motion of one may be a signal of another, in the unit and at the interval that were found for it."""
    (tmp_path / "axes.toml").write_text(TWO, encoding="utf-8")
    (tmp_path / "record.csv").write_text("u,phi\n" + "0.1,0.2\n" * 10, encoding="utf-8")
    reviews = {
        NAME: Review((Correction(("angle", "factor"), 0.5, "degrees"),), (), (), ""),
        "cell.a2": Review((Correction(("sample_interval_s",), 0.008, "as measured"),), (), (), ""),
    }
    seen = list[AxisJob]()

    def outcomes(given: Sequence[AxisJob], *_: object) -> Iterator[Outcome]:
        seen.extend(given)
        yield from (Outcome(job.axis_id) for job in given)

    monkeypatch.setattr(axis_processes, "outcomes", outcomes)
    monkeypatch.setattr(exchanged_torques, "exchanged", lambda *_: {})
    monkeypatch.setattr(signal_proposals, "review", lambda _text, axis_id, *_: reviews[axis_id])
    monkeypatch.chdir(tmp_path)
    assert axiswatch("commission", "record.csv", "--config", "axes.toml", "--yes").exit_code == MISTAKE
    for job in seen:
        first, second = configured(job.text, job.axis_id, tmp_path)[0].axes
        assert first.config.motion.factor == 0.5
        assert (first.config.sample_interval_s, second.config.sample_interval_s) == (0.005, 0.008)
    assert [job.axis_id for job in seen] == [NAME, "cell.a2"]


def test_an_axis_that_is_refused_does_not_stay_as_an_earlier_call_has_found_it(tmp_path: Path) -> None:
    """Where another call works on other axes, and takes the rest from earlier ones."""
    kept = tmp_path / "cell.a1.json"
    kept.write_text("{}", encoding="utf-8")
    job = AxisJob(
        TEXT, "cell.a1", (), tmp_path, CalibrationOptions(3600.0), Provenance("0", "2026-01-01", "test"), True
    )
    assert commission_axis(job, Review((), ("the torque is stuck",), (), "")).refusal
    assert not kept.exists()


@pytest.mark.parametrize(("changes", "motors"), [(True, ("a1", "a2")), (True, ()), (False, ("a1", "a2"))])
def test_a_change_in_a_record_may_be_another_program_where_gear_ratios_are_unknown(
    changes: bool, motors: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    refusal = "not calibrated: day.csv: kT changes by -0.154"

    def refused(_job: AxisJob, outcome: Outcome, _progress: object) -> Outcome:
        return replace(outcome, refusal=refusal, changes=changes)

    monkeypatch.setattr(axis_commissioning, "with_coupling", lambda job, outcome, _loads, _progress: (job, outcome))
    monkeypatch.setattr(
        axis_commissioning,
        "identified",
        lambda _job, outcome, _loads, _progress: replace(outcome, nominal_file="n.toml", watched=("kT",)),
    )
    monkeypatch.setattr(axis_commissioning, "calibrated", refused)
    monkeypatch.setattr(LoadSearch, "motors_without_ratio", motors)
    job = AxisJob(
        TEXT, "cell.a1", (), tmp_path, CalibrationOptions(3600.0), Provenance("0", "2026-01-01", "test"), True
    )
    found = commission_axis(job, Review((), (), (), "")).refusal
    assert found.startswith(refusal)
    asked = "If only another program begins there, the pose of the arm may explain the change"
    assert (asked in found) == (changes and bool(motors))
    assert ("the gear ratios of a1 and a2. Give the angle" in found) == (changes and bool(motors))


def test_a_drive_that_lacks_something_is_refused_with_what_that_is() -> None:
    """No other motion for one of its parameters is asked for: that would not help."""
    found = report(Watched("kT", 2.0, Obstacle.NOT_SHOWN), rejection="poor", missing=(Effect.FOREIGN,))
    found.result.rejection = Rejection.POOR
    words = not_identified(found, "", lacks := lacks_of(found, ""))
    assert words.startswith("not identified: poor. The records show what the drive lacks: what is missing")
    assert "record this axis alone" in words
    assert outlook_words(found.result, found.rejection) == (
        "Nothing can be watched with this. Alarms would come from what the drive lacks."
    )
    found.is_poor = False
    assert not_identified(found, "", lacks_of(found, "")) == "not identified: poor"
    assert lacks_of(found, lacks) == lacks == lacks_of(report(rejection="poor"), lacks)


def test_an_axis_with_its_results_still_knows_the_angles_of_the_others(tmp_path: Path) -> None:
    """They are part of the pose at its calibration, also where no term follows them."""
    signal = Correction(("signal", "a2-angle", "axis"), "a2", "links")
    job = AxisJob(TWO, NAME, ("a.csv",), tmp_path, CalibrationOptions(600.0), Provenance.now(), True)
    own = job.corrected([signal]).with_results(Found("a1.toml", None, ["kT"]))
    assert 'nominal_file = "a1.toml"' in own.text
    assert '{name = "a2-angle", axis = "a2"}' in own.text
    assert own.text.count("[[robot.axis]]") == 2
    assert job.alone(Found("a1.toml", None, ["kT"])).text.count("[[robot.axis]]") == 1
