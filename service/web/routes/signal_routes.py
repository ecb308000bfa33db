"""REST of the signals of an axis in the last seconds: torque, measured and predicted motion, in columns."""

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from fastapi import APIRouter, Response
from numpy.typing import NDArray
from pydantic import Field

from monitor_core.arrays import finite
from monitor_core.drive import OUTPUT_UNITS
from service.pipeline.axes.live_signals import LiveBlock
from service.texts.instants import iso, microseconds
from service.web import models
from service.web.app_state import AppState
from service.web.history_json import numbers
from service.web.problem_details import NOT_FOUND
from service.web.routes.alarm_routes import Moment

_DIGITS = 10
"""Digits of measured and predicted motion; many, as the error is small compared with an angle of many turns."""


class Signals(models.Body):
    """The last seconds of an axis: a number for each sample in each column."""

    axis: str
    begin: models.Time | None = Field(description="time of the first sample in this answer; null: it has none")
    end: models.Time | None = Field(description="time of the last one: as `since`, it asks for those that follow")
    unit: str = Field(description="of the motion and its prediction: rad or rad/s")
    outlier_limit: models.Number = Field(
        description="a larger prediction error, either way, counts as an outlier, in unit; while estimates are "
        "uncertain the limit is wider; null: there is none"
    )
    time_s: list[float] = Field(description="since begin [s]")
    torque: list[models.Number] = Field(description="motor torque [N m]")
    measured: list[models.Number] = Field(description="motion, in unit")
    predicted: list[models.Number] = Field(
        description="motion as predicted from the samples before, in unit; null: there is no prediction"
    )
    error: list[models.Number] = Field(description="measured - predicted, in unit")
    learned: list[bool] = Field(
        description="false: nothing was learned from the sample, as it is an outlier, the axis settles or stands "
        "still, or its operating conditions exclude it"
    )


def router(state: AppState) -> APIRouter:
    """The route below /api/v1/axes/{axis}."""
    api = APIRouter(prefix="/axes/{axis}", responses=NOT_FOUND)

    @api.get("/signals", summary="Last seconds of an axis", response_model=Signals)
    def signals(axis: str, since: Moment = None) -> Response:
        """Torque, motion, prediction and its error at every sample of the last ten seconds, in columns.

        The daemon keeps them from the first request on, until nobody has asked for five seconds.
        """
        found = state.axis(axis)
        blocks = _after(state.live.look(found.id), microseconds(since))
        limit = None
        if found.watched is not None and (settings := found.watched.settings).outlier_limit > 0:
            limit = settings.outlier_limit * found.status.innovation_variance**0.5
            limit = max(limit, settings.least_outlier)
        head = {"axis": found.id, "unit": OUTPUT_UNITS[found.output], "outlier_limit": finite(limit)}
        return Response("".join(_body(head, blocks)), media_type="application/json")

    return api


def _after(blocks: Sequence[LiveBlock], since_us: int | None) -> LiveBlock:
    """The samples after a time; all samples if their clock was set back to before it."""

    def column(name: str) -> NDArray[Any]:
        parts = [getattr(block, name) for block in blocks]
        return np.concatenate(parts) if parts else np.zeros(0)

    t_us = column("t_us").astype(np.int64, copy=False)
    first = 0
    if since_us is not None and t_us.size and since_us <= t_us[-1]:
        first = int(np.searchsorted(t_us, since_us, side="right"))
    return LiveBlock(t_us[first:], *(column(name)[first:] for name in LiveBlock._fields[1:]))


def _body(head: Mapping[str, object], s: LiveBlock) -> Iterator[str]:
    times = (iso(int(s.t_us[0])), iso(int(s.t_us[-1]))) if len(s.t_us) else (None, None)
    yield json.dumps({**head, "begin": times[0], "end": times[1]})[:-1]
    seconds = np.asarray((s.t_us - s.t_us[:1]) * 1e-6, np.float64)
    columns = {"time_s": seconds, "torque": s.u, "measured": s.y, "predicted": s.yhat}
    for name, column in columns.items():
        yield f', "{name}": [{numbers(column, _DIGITS)}]'
    yield f', "error": [{numbers(s.y - s.yhat)}]'
    yield f', "learned": {json.dumps(np.isfinite(s.eps).tolist())}}}'
