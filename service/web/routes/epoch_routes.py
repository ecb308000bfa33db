"""REST under /api/v1/axes/{axis}/: epochs of an axis, and new nominal values after a repair."""

from typing import Annotated, Literal, Self

from fastapi import APIRouter, Path
from pydantic import Field, model_validator

from service.pipeline.reconfiguration.baselines import Baselines, BaselineUnavailableError, UnknownEpochError, reason_of
from service.pipeline.snapshot import AxisSnapshot
from service.store.alarm_transitions import Note
from service.store.epochs import Epoch as RecordedEpoch
from service.store.epochs import EpochEvent as RecordedEvent
from service.store.epochs import EpochEventName, EpochSource, EpochState
from service.web import views
from service.web.access import Admin
from service.web.app_state import AppState
from service.web.models import (
    SENTENCES,
    AlarmNote,
    Body,
    GivenText,
    Number,
    Sentence,
    TextOrNull,
    Time,
    sentence_bodies,
)
from service.web.problem_details import UnknownResourceError, described

_NOT_FOUND = described(404, "The axis or the epoch does not exist")
_NO_STORE = described(503, "The epochs cannot be read or written, or the worker does not answer")
_CONFLICT = described(409, "Not possible now, e.g. a learning window runs already")
_UNFIT = described(422, "A body that is not as described, or a window or files that do not fit the axis")
_HOUR_S = 3600.0

EpochNumber = Annotated[int, Path(ge=1, le=2**63 - 1)]
VerifyHours = Annotated[
    float,
    Field(
        ge=0,
        le=8784,
        allow_inf_nan=False,
        description="hours of operation for which the new values are then verified; 0: not at all",
    ),
]


class NominalValue(Body):
    """A nominal value of a monitored parameter."""

    name: str
    unit: str
    value: Number = Field(description="in unit")
    former: Number = Field(description="in the epoch before; null: there was none")
    standard_deviation: Number = Field(description="in unit; null: not known")
    kept: TextOrNull = Field(description="why a learning window left the former value; null: it did not")


class EpochEvent(Body):
    """An event of an epoch."""

    at: Time = Field(description="UTC")
    event: EpochEventName
    who: str = Field(description="a person; axiswatch: the daemon; configuration: the file was changed")
    comment: TextOrNull
    work_order: TextOrNull


class Epoch(Body):
    """Nominal values and thresholds of an axis, and the time for which they were in force."""

    number: int
    state: EpochState = Field(
        description="learning: its values are being learned, the former epoch is in force; verifying, current: it is in"
        " force; closed: another one followed; rolled_back: a former one was restored; cancelled: it never was in force"
    )
    source: EpochSource = Field(description="where its values are from")
    restored_from: int | None = Field(description="the epoch that it has the values of; null: it has its own")
    began: Time = Field(description="UTC")
    in_force: Time | None = Field(description="when its values were taken over, UTC; null: never")
    ended: Time | None = Field(description="UTC; null: it has not ended")
    who: str
    comment: TextOrNull
    work_order: TextOrNull
    reason: TextOrNull = Field(description="why it never was in force; null: it is, was, or will be")
    sentences: list[Sentence] = Field(description=SENTENCES)
    done_s: Number = Field(description="operating time of the window that is under way [s]; null: none is")
    length_s: Number = Field(description="operating time that it needs [s]; null: none is under way")
    values: list[NominalValue] = Field(description="of the monitored parameters; empty while they are learned")
    events: list[EpochEvent] = Field(description="oldest first")


class AxisEpochs(Body):
    """All epochs of an axis."""

    axis: str
    current: int = Field(description="number of the epoch that is in force")
    epochs: list[Epoch] = Field(description="newest first")


class EpochNote(AlarmNote):
    """Why; both may be left out."""


class Baseline(EpochNote):
    """The source of the values of a new epoch: a learning window, or files."""

    mode: Literal["window", "files"]
    hours: float | None = Field(
        None,
        gt=0,
        le=8784,
        allow_inf_nan=False,
        description="window: hours of operation that are learned from",
    )
    nominal: GivenText | None = Field(None, description="files: the text of nominal.toml")
    thresholds: GivenText | None = Field(
        None, description="files: the text of thresholds.toml; null: those of the configuration's keys"
    )
    verify_hours: VerifyHours = 8.0

    @model_validator(mode="after")
    def _of_its_mode(self) -> Self:
        files = self.nominal is not None or self.thresholds is not None
        if self.mode == "window" and (self.hours is None or files):
            raise ValueError("mode window: give hours, and no files")
        if self.mode == "files" and (self.nominal is None or self.hours is not None):
            raise ValueError("mode files: give nominal, perhaps thresholds, and no hours")
        return self


class Restoration(EpochNote):
    """Request to put a former epoch in force again."""

    verify_hours: VerifyHours = 8.0


def router(state: AppState) -> APIRouter:
    """The routes; changes need the scope admin, as a wrong baseline hides a fault permanently."""
    api = APIRouter(prefix="/axes/{axis}", responses=_NOT_FOUND | _NO_STORE)

    @api.get("/epochs", summary="Epochs of an axis")
    def epochs(axis: str) -> AxisEpochs:
        """All epochs of an axis: its nominal values and thresholds, who has changed them, when and why."""
        found = state.axis(axis)
        recorded, events = state.journal.epochs.of_axis(axis), state.journal.epochs.events(axis)
        bodies = [_epoch(epoch, events.get(epoch.number, []), found) for epoch in recorded]
        return AxisEpochs(axis=axis, current=found.epoch.number, epochs=bodies)

    @api.post("/baseline", summary="Begin a new epoch", responses=_CONFLICT | _UNFIT)
    def baseline(axis: str, body: Baseline, who: Admin) -> Epoch:
        """New nominal values of an axis after a repair: from a learning window from now on, or from files at once."""
        state.axis(axis)
        verify_s, note = body.verify_hours * _HOUR_S, _note(state, who, body)
        if body.hours is not None:
            return _answer(state, axis, _baselines(state).learn(axis, body.hours * _HOUR_S, verify_s, note))
        assert body.nominal is not None
        return _answer(state, axis, _baselines(state).use_files(axis, body.nominal, body.thresholds, verify_s, note))

    @api.post("/baseline/cancel", summary="End a learning window", responses=_CONFLICT)
    def cancel(axis: str, body: EpochNote, who: Admin) -> Epoch:
        """End a learning window without new values: the epoch before stays in force."""
        state.axis(axis)
        return _answer(state, axis, _baselines(state).cancel(axis, _note(state, who, body)))

    @api.post("/epochs/{number}/restore", summary="Roll back to an epoch", responses=_CONFLICT | _UNFIT)
    def restore(axis: str, number: EpochNumber, body: Restoration, who: Admin) -> Epoch:
        """Put the values of a former epoch in force again, as a new epoch."""
        state.axis(axis)
        note = _note(state, who, body)
        try:
            epoch = _baselines(state).restore(axis, number, body.verify_hours * _HOUR_S, note)
        except UnknownEpochError as error:
            raise UnknownResourceError(str(error), map(str, error.known)) from None
        return _answer(state, axis, epoch)

    return api


def _baselines(state: AppState) -> Baselines:
    if state.baselines is None:
        raise BaselineUnavailableError("no worker runs")
    return state.baselines


def _note(state: AppState, who: str, body: EpochNote) -> Note:
    return Note(state.now_us(), who, body.comment, body.work_order)


def _answer(state: AppState, axis: str, epoch: RecordedEpoch) -> Epoch:
    return _epoch(epoch, state.journal.epochs.events(axis).get(epoch.number, []), state.snapshot().axis(axis))


def _epoch(epoch: RecordedEpoch, events: list[RecordedEvent], axis: AxisSnapshot | None) -> Epoch:
    shown = None if axis is None else axis.epoch
    length_s = {"learning": epoch.learn_s, "verifying": epoch.verify_s}.get(epoch.state)
    done_s = shown.done_s if shown is not None and shown.state == epoch.state else None
    return views.body(
        Epoch,
        epoch,
        done_s=None if length_s is None else (done_s or 0.0),
        length_s=length_s,
        sentences=sentence_bodies(map(reason_of, (epoch.reason, *(v.kept for v in epoch.nominal)))),
        values=epoch.nominal,
        events=[views.body(EpochEvent, e) for e in events],
    )
