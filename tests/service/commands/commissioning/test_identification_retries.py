"""What is tried after an identification: another drive, fewer parameters, another memory."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from monitor_core.identification import (
    ContactForce,
    Effect,
    FitQuality,
    TurningWeight,
)
from service.commands.commissioning.axis.axis_commissioning import unmonitored_words
from service.commands.commissioning.axis.axis_identification import lacks_of, not_identified
from service.commands.commissioning.axis.identification_retries import (
    Retry,
    followers_monitored,
    memories_of,
    memory_change,
    retry,
    without_unsettled,
)
from service.commands.commissioning.axis.load_search import LinkLoad, PressingGate
from service.config import AxisConfig
from service.config.written.commissioned import configured
from service.config.written.corrections import Correction
from tests.service.commands.commissioning.identified_axis import (
    FM,
    KT,
    MASS,
    NAME,
    NO_FM,
    TEXT,
    load_of,
    report,
    unsettled,
)
from tests.service.config.config_texts import FILE, furnish


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


def test_the_term_that_moves_most_is_left_out_where_only_terms_do_not_settle() -> None:
    again = without_unsettled(unsettled("tau0 per a2-acceleration", "tau0 per cos(a2)"), MASS)
    assert again is not None
    assert again.schedule == ("tau0: cos(a2), a2-acceleration * cos(a2), a2-acceleration * sin(a2)",)
    assert (again.text, again.left_out) == (MASS, "a2-acceleration")
    assert without_unsettled(unsettled("tau0 per a2-acceleration", "J"), MASS) is None, "the drive itself moves"
    assert without_unsettled(unsettled(), MASS) is None
    assert without_unsettled(report(KT, rejection="poor"), MASS) is None


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
