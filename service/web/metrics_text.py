"""Writes series of numbers in the text format of Prometheus, and in OpenMetrics.

There are about seventy series for each axis, so their lines are kept, and only metrics whose numbers have changed are
written anew.
"""

import threading
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from pydantic_core import to_json

from service.web.metric_families import FAMILIES

Labels = tuple[str, ...]
"""Values of the labels of a series"""


class MetricSeries(NamedTuple):
    """A metric: name without the prefix; label values and number of each series."""

    name: str
    labels: Sequence[Labels]
    numbers: Sequence[float]


class _Lines:
    """The lines of a metric, cached: its series rarely change, and often its numbers do not change either."""

    def __init__(self, name: str, labels: Sequence[str]) -> None:
        self._name, self._labels = name, labels
        self._values: Sequence[Labels] = []
        self._numbers: Sequence[float] = []
        self._form = self._text = ""

    def text(self, values: Sequence[Labels], numbers: Sequence[float]) -> str:
        """A line for each series."""
        if values != self._values:
            self._form = "".join([f"{self._start(v)} %s\n" for v in values])
        elif numbers == self._numbers:
            return self._text
        self._values, self._numbers = values, numbers
        self._text = self._form % tuple(_written(numbers)) if numbers else ""
        return self._text

    def _start(self, values: Sequence[str]) -> str:
        pairs = sorted(zip(self._labels, map(_escaped, values), strict=True))
        inner = ",".join(f'{label}="{value}"' for label, value in pairs)
        return f"{self._name}{{{inner}}}" if pairs else self._name


class MetricsWriter:
    """Writes gauges and counters in the text format or in OpenMetrics, which name counters differently."""

    def __init__(self, openmetrics: bool) -> None:
        self._openmetrics = openmetrics
        self._lines: dict[str, _Lines] = {}
        self._lock = threading.Lock()

    def text(self, metrics: Iterable[MetricSeries]) -> bytes:
        """The lines of metrics, from any thread."""
        parts = list[str]()
        with self._lock:
            for name, values, numbers in metrics:
                kind, words, labels = FAMILIES[name]
                total = "_total" if kind == "counter" else ""
                family = f"axiswatch_{name}{'' if self._openmetrics else total}"
                lines = self._lines.setdefault(name, _Lines(f"axiswatch_{name}{total}", labels))
                parts += (f"# HELP {family} {words}\n# TYPE {family} {kind}\n", lines.text(values, numbers))
        return "".join(parts).encode()


def _written(numbers: Iterable[float]) -> Sequence[str]:
    """Numbers with all digits, converted by JSON, which is much faster than Python; then infinities are replaced."""
    text = to_json([*map(float, numbers)], inf_nan_mode="constants").decode()
    return text[1:-1].replace("-Infinity", "-Inf").replace("Infinity", "+Inf").split(",")


def _escaped(value: str) -> str:
    """A label value, escaped for the metrics format and for a % template."""
    return value.replace("\\", r"\\").replace("\n", r"\n").replace('"', r"\"").replace("%", "%%")
