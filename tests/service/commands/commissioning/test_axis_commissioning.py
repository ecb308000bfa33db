"""The steps of one axis: another drive, fewer parameters, another memory, and what of it the report states."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from monitor_core.calibration import CalibrationOptions
from monitor_core.identification import (
    ContactForce,
    Effect,
    FitQuality,
    IdentificationError,
    LinkWeights,
    Obstacle,
    Rejection,
    TurningWeight,
    Watched,
)
from monitor_core.identification.parameter_selection import ScheduledTerm
from service.commands.command_line.exit_codes import MISTAKE
from service.commands.commissioning.axis import axis_commissioning, axis_identification, axis_processes
from service.commands.commissioning.axis.axis_commissioning import commission_axis, unmonitored_words
from service.commands.commissioning.axis.axis_identification import lacks_of, not_identified
from service.commands.commissioning.axis.axis_job import AxisJob
from service.commands.commissioning.axis.identification_retries import (
    Retry,
    followers_monitored,
    memories_of,
    memory_change,
    retry,
    without_unsettled,
)
from service.commands.commissioning.axis.load_search import LinkLoad, LoadSearch, PressingGate
from service.commands.commissioning.signals import exchanged_torques, signal_proposals
from service.commands.commissioning.signals.signal_proposals import Review
from service.config import AxisConfig
from service.config.written.commissioned import configured
from service.config.written.corrections import Correction
from service.reports import identification_html
from service.reports.commissioning_report import Outcome, as_html, next_step, overview
from service.reports.formats import Provenance
from service.reports.outlook_words import outlook_words
from tests.service.command_line import axiswatch
from tests.service.config.config_texts import FILE, furnish

TEXT = """
[[robot]]
name = "cell"
[[robot.axis]]
name = "a1"
sample_interval_s = 0.005
torque = { column = "u" }
angle = { column = "phi" }
model = { drive = "three-mass", monitor = ["kT", "1/Ja", "fm"], nominal = { kT = 1, r = 0.01, Jg = 3.0 } }
"""
MASS = TEXT.replace('"three-mass", monitor = ["kT", "1/Ja", "fm"]', '"one-mass", monitor = ["kT", "fm"]').replace(
    ", r = 0.01, Jg = 3.0 }", " }"
)
TWO = MASS + MASS[MASS.index("[[robot.axis]]") :].replace('"a1"', '"a2"')
NAME = "cell.a1"


def report(
    *watched: Watched,
    rejection: str | None = None,
    follows: tuple[str, ...] = (),
    missing: tuple[Effect, ...] = (),
    quality: FitQuality = FitQuality.GOOD,
) -> Any:
    """What is looked at of an identification."""
    scheduled = [SimpleNamespace(parameter=name) for name in follows]
    estimate = SimpleNamespace(drive=SimpleNamespace(constant_torques=lambda: ("tau0",)), moving=())
    result = SimpleNamespace(
        watched=watched,
        options=SimpleNamespace(scheduled=scheduled),
        memory_s=5.0,
        verdict=SimpleNamespace(missing=missing, slow=0.1, quality=quality),
        estimate=estimate,
        slow_left_out=0.0,
        not_following=(),
        warm_up=None,
        rejection=Rejection.POOR if rejection else None,
    )
    return SimpleNamespace(
        rejection=rejection, result=result, outlook="", obstacles="", warnings=(), is_poor=bool(missing)
    )


KT, FM = Watched("kT", 0.1, None), Watched("fm", 0.2, None)
NO_FM = Watched("fm", np.nan, Obstacle.NO_SIZE)


def load_of(changes: tuple[Correction, ...], *terms: str, explained: float = 0.9, before: float = 0.3) -> LinkLoad:
    """A load of links with these terms, which explain this share of the torque."""
    return LinkLoad(LinkWeights(terms, explained, before), changes)


def next_try(
    folder: Path,
    found: Any,
    text: str = TEXT,
    before: Sequence[str] = (),
    links: LinkLoad | None = None,
    turn: TurningWeight | None = None,
    pressing: PressingGate | None = None,
) -> Retry | None:
    """What is tried after this identification with the configuration of this text."""
    search: Any = SimpleNamespace(links=links, pressing=pressing)
    return retry(found, text, configured(text, NAME, folder)[1], before, search, lambda: turn)


def retried(folder: Path, found: Any, text: str = TEXT, **given: Any) -> tuple[Retry, AxisConfig]:
    """The same where there is something to try, and the axis with it."""
    again = next_try(folder, found, text, **given)
    assert again is not None
    return again, configured(again.text, NAME, folder)[1].config


# --- Another drive ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("found", [report(KT, FM, rejection="the fit has not converged"), report(NO_FM)])
def test_several_masses_that_are_not_identified_become_one(found: Any, tmp_path: Path) -> None:
    again, axis = retried(tmp_path, found)
    assert again.words == 'model.drive = "one-mass"'
    model = axis.model
    assert (model.drive, model.monitor, dict(model.nominal)) == ("one-mass", ("kT", "fc", "fm"), {"kT": 1})
    assert next_try(tmp_path, found, again.text, ["three-mass"]) is None, "there is nothing else"


def test_keys_of_parameters_that_are_not_monitored_any_more_are_left_out_and_named(tmp_path: Path) -> None:
    more = 'bounds = { kT = [0.5, 2.0] }, limits = { Ja = 9.0 } }\nalarms = { latched = ["1/Ja"] }\n'
    text = TEXT.replace("Jg = 3.0 } }", f"Jg = 3.0 }}, {more}")
    _, before = configured(text, NAME, tmp_path)
    assert list(unmonitored_words(before.config, ("kT", "fm"))) == [
        "1/Ja is not monitored, so it is left out of limits and latched in the new configuration."
    ]
    _, axis = retried(tmp_path, report(KT, FM, follows=("Ja",)), text)
    assert (axis.model.limits, axis.alarms.latched) == ({}, ())
    assert axis.model.bounds == {"kT": (0.5, 2.0)}


def test_a_drawn_drive_is_not_replaced(tmp_path: Path) -> None:
    text = TEXT[: TEXT.index("model = ")] + "[robot.axis.model]\n" + FILE
    furnish(tmp_path)
    for missing in ((), (Effect.POSE,)):
        found = report(rejection="poor", missing=missing)
        assert next_try(tmp_path, found, text, links=load_of((), "cos(a1)")) is None


def test_one_mass_that_is_not_identified_becomes_three_at_fast_samples(tmp_path: Path) -> None:
    text = MASS.replace("kT = 1", "kT = 2")
    _, axis = retried(tmp_path, report(rejection="poor"), text)
    assert (axis.model.drive, dict(axis.model.nominal)) == ("three-mass", {"kT": 2, "r": 1})
    assert next_try(tmp_path, report(rejection="poor"), text.replace("0.005", "0.02")) is None


@pytest.mark.parametrize("drive", ["one-mass", "two-mass", "three-mass"])
def test_where_the_torque_shows_a_weight_the_drive_gets_one(drive: str, tmp_path: Path) -> None:
    """Of an angle; a speed does not tell where the weight is."""
    text = TEXT.replace("three-mass", drive).replace("kT = 1, r = 0.01, Jg = 3.0", "kT = 2")
    text = text.replace('"1/Ja"', '"fc"')
    found = report(rejection="poor", missing=(Effect.POSE,))
    _, axis = retried(tmp_path, found, text)
    assert (axis.model.drive, dict(axis.model.nominal)) == (f"{drive}-weight", {"kT": 2, "r": 1})
    other, _ = retried(tmp_path, found, text.replace("angle =", "speed ="))
    assert "weight" not in other.words


@pytest.mark.parametrize(
    ("text", "interval_s", "missing", "drive"),
    [
        (MASS, 0.005, (Effect.FAST, Effect.POSE), "three-mass"),
        (MASS, 0.005, (Effect.POSE, Effect.FAST), "one-mass-weight"),
        (MASS, 0.02, (Effect.FAST, Effect.POSE), "one-mass-weight"),
        (TEXT, 0.005, (Effect.FAST, Effect.POSE), "three-mass-weight"),
    ],
)
def test_springs_come_before_a_weight_that_takes_hardly_any_torque(
    text: str, interval_s: float, missing: tuple[Effect, ...], drive: str, tmp_path: Path
) -> None:
    """Where samples are fast enough for springs, and they were not tried before."""
    found = report(rejection="poor", missing=missing)
    again, _ = retried(tmp_path, found, text.replace("0.005", f"{interval_s}"))
    assert again.words.startswith(f'model.drive = "{drive}"')


@pytest.mark.parametrize(
    ("text", "turn", "ratio"),
    [
        (MASS, TurningWeight(0.01024, 0.006, 0.012), 0.0102),
        (MASS, TurningWeight(1.1, 0.8, 1.3), 1),
        (MASS, None, 1),
        (TEXT.replace("r = 0.01, Jg = 3.0", "r = 0.02"), TurningWeight(0.01024, 0.006, 0.012), 0.02),
    ],
)
def test_a_weight_shows_the_gear_ratio_that_is_not_configured(
    text: str, turn: TurningWeight | None, ratio: float, tmp_path: Path
) -> None:
    """Of the angle of a motor; that of an arm turns with the weight."""
    again, axis = retried(tmp_path, report(rejection="poor", missing=(Effect.POSE,)), text, turn=turn)
    assert axis.model.nominal["r"] == ratio
    assert ("model.nominal.r = 0.0102" in again.words) == (ratio == 0.0102)


def test_slow_motion_asks_for_no_other_drive(tmp_path: Path) -> None:
    """Springs have no other friction; only a record of faster motion helps."""
    found = report(rejection="poor", missing=(Effect.SLOW,))
    assert next_try(tmp_path, found) is None
    assert "set min_speed = 0.1 in [[robot.axis]]" in not_identified(found, "", lacks_of(found, ""))


# --- What follows a signal, or presses --------------------------------------------------------------------------------


def test_only_what_can_be_watched_follows_the_heat(tmp_path: Path) -> None:
    assert next_try(tmp_path, report(KT, FM, follows=("fm",))) is None
    again, axis = retried(tmp_path, report(KT, NO_FM, follows=("fm",)))
    assert not again.changes
    assert axis.model.monitor == ("kT",)
    endless = next_try(tmp_path, report(KT, NO_FM, follows=("fm",)), again.text)
    assert endless is None, "it would be the same for ever"


def test_what_follows_is_monitored_where_a_better_fit_waits_for_consent(tmp_path: Path) -> None:
    """A proposal that nobody confirmed is not applied; the axis is calibrated without it."""
    found = report(KT, NO_FM, follows=("fm",), quality=FitQuality.FAIR)
    proposed = next_try(tmp_path, found, MASS, links=load_of((), "cos(a1)"))
    assert proposed is not None
    assert proposed.schedule
    again = followers_monitored(found, MASS, configured(MASS, NAME, tmp_path)[1])
    assert again is not None
    assert not again.changes
    assert configured(again.text, NAME, tmp_path)[1].config.model.monitor == ("kT",)


def test_a_weight_follows_the_pose_without_being_monitored(tmp_path: Path) -> None:
    assert next_try(tmp_path, report(KT, NO_FM, follows=("tau0",))) is None


def test_of_links_only_the_first_fit_is_tried_again(tmp_path: Path) -> None:
    """With the angles of both axes as signals, and one mass."""
    signals = tuple(Correction(("signal", name, "axis"), name, "a weight") for name in ("a1", "a2"))
    load = load_of(signals, "cos(a1)", "cos(a1 + a2)")
    two = TEXT + TEXT[TEXT.index("[[robot.axis]]") :].replace('"a1"', '"a2"')
    found = report(rejection="poor")
    again, axis = retried(tmp_path, found, two, links=load)
    assert again.schedule == ("tau0: cos(a1), cos(a1 + a2)",)
    assert again.words.startswith('model.drive = "one-mass", signal.a1.axis = "a1"')
    assert (axis.model.drive, [s.axis for s in axis.signal]) == ("one-mass", ["a1", "a2"])
    assert axis.model.monitor == ("kT", "fc", "fm")
    other = next_try(tmp_path, found, two, ["one-mass"], load)
    assert other is None or not other.schedule


def test_what_presses_is_left_out_unless_a_load_explains_it_as_well(tmp_path: Path) -> None:
    signal = 'signal = [{ name = "closed", column = "c" }]\n'
    text = MASS.replace("angle =", f"{signal}angle =", 1)
    force = ContactForce("closed", 0.0, 1.0, 0.9)
    gate = Correction(("gate", "closed", "below"), 0.5, "it presses")

    def tried(found: Any, load: LinkLoad | None = None, before: Sequence[str] = ()) -> Retry | None:
        return next_try(tmp_path, found, text, before, links=load, pressing=PressingGate(force, (gate,)))

    poor = report(rejection="poor")
    for load in (None, load_of((), "closed", explained=0.8)):
        again = tried(poor, load)
        assert again is not None
        assert again.words == "gate.closed.below = 0.5"
        (given,) = configured(again.text, NAME, tmp_path)[1].config.gate
        assert (given.signal, given.below) == ("closed", 0.5)
    again = tried(poor, load_of((), "closed", explained=0.88))
    assert again is not None
    assert again.words == "tau0: closed"
    assert tried(report(KT, FM)) is None
    second = tried(poor, before=["one-mass"])
    assert second is None or "gate" not in second.words


def test_beside_what_presses_the_load_of_links_is_followed_in_the_rest(tmp_path: Path) -> None:
    signal = 'signal = [{ name = "closed", column = "c" }]\n'
    text = MASS.replace("angle =", f"{signal}angle =", 1)
    gate = Correction(("gate", "closed", "below"), 0.5, "it presses")
    angle = Correction(("signal", "a1", "axis"), "a1", "a weight")
    rest = load_of((angle,), "cos(a1)", explained=0.93)
    found = PressingGate(ContactForce("closed", 0.0, 1.0, 0.93), (gate,), rest)
    load = load_of((), "closed", explained=0.8)
    again = next_try(tmp_path, report(rejection="poor"), text, links=load, pressing=found)
    assert again is not None
    assert again.changes == (gate, angle)
    assert again.schedule == ("tau0: cos(a1)",)
    config = configured(again.text, NAME, tmp_path)[1].config
    assert [(g.signal, g.below) for g in config.gate] == [("closed", 0.5)]
    assert [s.name for s in config.signal] == ["closed", "a1"]


# --- The load of links ------------------------------------------------------------------------------------------------


def test_links_are_looked_for_where_one_mass_is_only_fair(tmp_path: Path) -> None:
    """A good fit needs none that explain little more, and a drive of several masses that was chosen is kept."""
    axis = Correction(("signal", "a2-acceleration", "axis"), "a2", "links")
    for text, quality, explained, schedule in (
        (MASS, FitQuality.FAIR, 0.93, ("tau0: a2-acceleration",)),
        (MASS, FitQuality.GOOD, 0.93, ()),
        (MASS, FitQuality.GOOD, 0.95, ("tau0: a2-acceleration",)),
        (TEXT, FitQuality.FAIR, 0.95, ()),
    ):
        links = load_of((axis,), "a2-acceleration", explained=explained, before=0.92)
        found = next_try(tmp_path, report(KT, FM, quality=quality), text, links=links)
        assert (found.schedule if found else ()) == schedule
    signals = (Correction(("signal", "a2-acceleration", "acceleration"), True, "links"), axis)
    for terms, shown in (
        (("a2-acceleration",), "what it takes to move the links"),
        (
            ("cos(a2)", "a2-acceleration"),
            "the weight of links at these angles and what it takes to move the links",
        ),
    ):
        links = load_of(signals, *terms)
        again = next_try(tmp_path, report(rejection="poor"), MASS, links=links)
        assert again is not None
        assert again.shown == shown


def unsettled(*moving: str) -> Any:
    """A fit with four terms of the torque offset that has not converged, as these parameters would still move."""
    found = report(KT, rejection="the fit has not converged")
    found.result.rejection, found.result.estimate.moving = Rejection.NOT_CONVERGED, moving
    terms = ("cos(a2)", "a2-acceleration", "a2-acceleration * cos(a2)", "a2-acceleration * sin(a2)")
    found.result.options.scheduled = [ScheduledTerm("tau0", term, 0.0, -1.0, 1.0) for term in terms]
    return found


def test_the_term_that_moves_most_is_left_out_where_only_terms_do_not_settle() -> None:
    again = without_unsettled(unsettled("tau0 per a2-acceleration", "tau0 per cos(a2)"), MASS)
    assert again is not None
    assert again.schedule == ("tau0: cos(a2), a2-acceleration * cos(a2), a2-acceleration * sin(a2)",)
    assert (again.text, again.left_out) == (MASS, "a2-acceleration")
    assert without_unsettled(unsettled("tau0 per a2-acceleration", "J"), MASS) is None, "the drive itself moves"
    assert without_unsettled(unsettled(), MASS) is None
    assert without_unsettled(report(KT, rejection="poor"), MASS) is None


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
    search = SimpleNamespace(links=load, pressing=None, motors_without_ratio=())
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
    search = SimpleNamespace(links=load, pressing=None, motors_without_ratio=("a1", "a2"))
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
    search = SimpleNamespace(links=load, pressing=None, motors_without_ratio=())
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


# --- What is reported -------------------------------------------------------------------------------------------------


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


def test_memories_to_choose_from_are_round(tmp_path: Path) -> None:
    """They are written into the configuration."""
    _, axis = configured(TEXT.replace("0.005", "0.004"), NAME, tmp_path)
    assert memories_of(axis.config) == (1.0, 2.0, 5.0)


def test_a_memory_that_is_given_stays(tmp_path: Path) -> None:
    _, axis = configured(TEXT, NAME, tmp_path)
    (change,) = memory_change(report(KT), axis.config)
    assert change.change == "estimator.memory_s = 5"
    given = TEXT + "estimator = { memory_s = 2.0 }\n"
    _, axis = configured(given, NAME, tmp_path)
    assert memory_change(report(KT), axis.config) == ()


def test_what_the_thresholds_find_comes_first() -> None:
    """The records alone promise more than the tests may say that allow for the scatter of friction."""
    half = Outcome("cell.a1", within_s=50.0, smallest=(("kT", 0.05, -0.05), ("fc", None, -0.5), ("fm", None, None)))
    assert half.finding == "Found within 50 s, either way: kT from 5 %; as far as was tried, not fc, fm."
    assert replace(half, smallest=half.smallest[:1]).finding == "Found within 50 s, either way: kT from 5 %."
    assert Outcome("cell.a1").finding == ""


def test_an_axis_on_which_nothing_is_found_in_time_is_not_ready() -> None:
    blind = Outcome("cell.a1", watched=("kT",), within_s=50.0, smallest=(("kT", None, None),))
    some = Outcome("cell.a2", watched=("kT", "fm"), smallest=(("kT", 0.1, -0.2), ("fm", 0.5, None)))
    assert blind.state == "no change that was tried is found within 50 s"
    assert (some.state, some.finds) == ("ready", {"kT": 0.2})
    rows = overview([blind, some]).rows
    assert [row[2] for row in rows] == ["", "kT 20 %"]
    page = as_html([blind, some], "", Path("made/axiswatch.toml"), Provenance.now())
    assert "1 of 2 axes ready." in page


def test_what_all_axes_share_stands_once_and_commands_are_marked() -> None:
    axes = [Outcome(f"cell.a{n}", watched=("kT",), notes=("One <day>.", f"Axis {n}.")) for n in (1, 2)]
    refused = Outcome("cell.a3", refusal="not identified: it stands")
    step = "Next: `axiswatch run --config <file>`."
    page = as_html([*axes, refused], step, Path("made/axiswatch.toml"), Provenance.now())
    assert [page.count(f"<li>{words}</li>") for words in ("One &lt;day&gt;.", "Axis 1.", "Axis 2.")] == [
        1,
        1,
        1,
    ]
    assert page.index("One &lt;day&gt;.") < page.index("<h2>cell.a1</h2>") < page.index("Axis 1.")
    assert "Next: <code>axiswatch run --config &lt;file&gt;</code>." in page


def test_a_planned_motion_is_for_the_axes_that_have_one() -> None:
    moved = Outcome("a1", nominal_file="n", thresholds_file="t", watched=("kT",), motion="m.csv")
    others = [(), (Outcome("a2", refusal="not identified"),)]
    first, second = (next_step([moved, *more], Path("a.toml"), False, "again") for more in others)
    assert "What is missing takes a record of the planned motion: `again`." in first
    assert "What the records do not show of a1 takes a record of the planned motion: `again`." in second


def test_the_next_step_names_the_axes_whose_records_show_no_warm_up() -> None:
    ready = Outcome("a1", nominal_file="n", thresholds_file="t", watched=("kT",))
    cold = replace(ready, axis_id="a2", no_warm_up=True)
    refused = Outcome("a3", refusal="not identified", no_warm_up=True)
    words = "The records of {} show no warm-up"
    steps = [next_step(axes, Path("a.toml"), False, "again") for axes in ([ready], [ready, cold, refused])]
    assert words.format("a2") in steps[1]
    assert [step.count("show no warm-up") for step in steps] == [0, 1]


def test_the_next_step_warns_of_axes_that_are_tested_without_a_calibration() -> None:
    ready = Outcome("a1", nominal_file="n", thresholds_file="t", watched=("kT",))
    identified = Outcome("a2", refusal="not calibrated", nominal_file="n", watched=("kT",))
    refused = Outcome("a3", refusal="not identified")
    steps = [next_step(axes, Path("a.toml"), False, "again") for axes in ([ready, refused], [ready, identified])]
    assert ["thresholds" in step for step in steps] == [False, True]
    assert "That file tests a2 with thresholds that are not from the records" in steps[1]
