"""Writes the history as JSON or as a table, column by column, so that no step delays other threads."""

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from pydantic_core import to_json

from monitor_core.arrays import Floats, Ints
from service.store.history_query import HistoryAnswer, ParameterRows
from service.store.history_rows import QUANTITIES, HistoryRows
from service.store.history_store import HistorySeries
from service.texts.instants import iso

TABLE_COLUMNS: Mapping[str, type] = {
    "time": str,
    "parameter": str,
    "unit": str,
    "n": int,
    **{f"{name}_{part}": float for name in QUANTITIES for part in ("mean", "min", "max")},
}
_UNITS = {
    "cusum_up": "{} samples",
    "cusum_down": "{} samples",
    "threshold": "{} samples",
    "observability": "1",
}

_MOST = 300
_POWERS = np.array([float(f"1e{k}") for k in range(_MOST + 1)])
"""Powers of ten, correctly rounded, so that a rounded quotient has no extra digits"""


def history_json(axis_id: str, answer: HistoryAnswer, monitored: Mapping[str, tuple[str, float]]) -> bytes:
    """The body of models.History.

    Args:
        axis_id: robot.axis.
        answer: the rows to write.
        monitored: unit and nominal value of the monitored parameters, which are listed first, with or without rows.
    """
    head = {
        "axis": axis_id,
        "resolution": answer.resolution,
        "step_s": answer.step_s,
        "next": None if answer.next_s is None else iso(answer.next_s * 1_000_000),
    }
    parts = [
        json.dumps(head)[:-1],
        ', "time": [',
        ",".join(f'"{t}"' for t in _times(answer.t)),
        '], "parameters": [',
    ]
    for k, course in enumerate(_ordered(axis_id, answer, monitored)):
        parts += [", " if k else "", *_parameter(course, monitored)]
    return "".join([*parts, "]}"]).encode()


def history_table(answer: HistoryAnswer) -> Mapping[str, Sequence[Any]]:
    """The rows of an answer that have points, sorted by time, as the columns of ``TABLE_COLUMNS``."""
    times = _times(answer.t)
    found = [(m, k) for m in range(len(answer.t)) for k, c in enumerate(answer.courses) if c.rows.n[m] > 0]
    where = [m for m, _ in found]
    owners = [answer.courses[k].series for _, k in found]
    columns: dict[str, Sequence[Any]] = {
        "time": [times[m] for m in where],
        "parameter": [series.parameter for series in owners],
        "unit": [series.unit for series in owners],
        "n": [int(answer.courses[k].rows.n[m]) for m, k in found],
    }
    for part, column in (("mean", "mean"), ("min", "low"), ("max", "high")):
        numbers = np.array([getattr(answer.courses[k].rows, column)[m] for m, k in found])
        numbers = numbers.reshape(-1, len(QUANTITIES))
        columns |= {f"{name}_{part}": numbers[:, q].tolist() for q, name in enumerate(QUANTITIES)}
    return columns


def _ordered(
    axis_id: str, answer: HistoryAnswer, monitored: Mapping[str, tuple[str, float]]
) -> Iterator[ParameterRows]:
    known = {(c.series.parameter, c.series.unit): c for c in answer.courses}
    for name, (unit, _) in monitored.items():
        nothing = ParameterRows(HistorySeries(axis_id, name, unit), _nothing(answer.t))
        yield known.pop((name, unit), nothing)
    yield from known.values()


def _nothing(t: Ints) -> HistoryRows:
    """Rows without points at these times."""
    empty = np.full((len(t), len(QUANTITIES)), np.nan)
    return HistoryRows(t, np.zeros(len(t), np.int64), empty, empty, empty)


def _parameter(course: ParameterRows, monitored: Mapping[str, tuple[str, float]]) -> Iterator[str]:
    _, name, unit = course.series
    now_unit, nominal = monitored.get(name, ("", np.nan))
    head = {
        "name": name,
        "unit": unit,
        "nominal": nominal if unit == now_unit and np.isfinite(nominal) else None,
    }
    yield f'{json.dumps(head)[:-1]}, "n": {json.dumps(course.rows.n.tolist())}'
    columns = course.rows.mean, course.rows.low, course.rows.high
    alike = all(np.array_equal(columns[0], other, equal_nan=True) for other in columns[1:])  # single points
    for q, quantity in enumerate(QUANTITIES):
        own = _UNITS.get(quantity, "{}").format(unit)
        yield f', "{quantity}": {{"unit": {json.dumps(own)}'
        texts = [numbers(column[:, q]) for column in (columns[:1] if alike else columns)]
        for part, text in zip(("mean", "min", "max"), texts * 3 if alike else texts, strict=True):
            yield f', "{part}": [{text}]'
        yield "}"
    yield "}"


def numbers(column: Floats, digits: int = 7) -> str:
    """A column as the inside of a JSON list, rounded to the stored digits; null if not finite."""
    finite = np.where(np.isfinite(column), column, 0.0)
    # Round the numbers first: pydantic writes numbers with few digits ten times as fast as Python's "%.7g".
    exponent = np.log10(abs(finite), where=finite != 0, out=np.zeros(len(finite)))
    places = (digits - 1 - np.floor(exponent)).astype(int)
    scale, large = _POWERS[np.clip(places, 0, _MOST)], _POWERS[np.clip(-places, 0, _MOST)]
    rounded = np.rint(finite * scale / large) / scale * large
    text = to_json(np.where(np.isfinite(column), rounded, np.nan).tolist(), inf_nan_mode="null").decode()
    return f"{text[1:-1]},".replace(".0,", ",")[:-1]


def _times(t: Ints) -> list[str]:
    texts: list[str] = np.datetime_as_string(t.astype("datetime64[s]"), unit="us").tolist()
    return [f"{text}Z" for text in texts]
