"""A calibration on the terminal."""

from __future__ import annotations

from collections.abc import Iterable

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from service.reports.calibration_report import (
    DETECTORS,
    HYPOTHESIS_TITLES,
    THRESHOLD_TITLES,
    Calibration,
    confusion_rows,
    confusion_titles,
    fault_rows,
    fault_titles,
    hypothesis_rows,
    promises,
    smallest_rows,
    smallest_titles,
    threshold_rows,
)

_WHOLE = 2
"""Columns that are not broken: of what a row is."""


def print_text(calibration: Calibration, console: Console) -> None:
    """The promise; faults and names, by the detector that alarms; thresholds."""
    console.print(Text(calibration.axis.id, style="bold"))
    for words in promises(calibration):
        console.print(Text(words), soft_wrap=True)
    first = calibration.detectors[0]
    if first.caught:
        title = f"Smallest change found within {calibration.result.within_s:.3g} s, in 9 of 10"
        console.print(_table(title, smallest_titles(calibration), smallest_rows(calibration)))
        by = f"by the {DETECTORS[first.detector]}"
        title = f"Faults that begin at {calibration.result.onsets} places of the record, {by}"
        console.print(_table(title, fault_titles(calibration, first), fault_rows(calibration, first)))
        console.print(_table(f"Names, all sizes, {by}", confusion_titles(first), confusion_rows(first)))
    console.print(_table("Thresholds of the CUSUM tests", THRESHOLD_TITLES, threshold_rows(calibration)))
    if calibration.result.bank is not None:
        console.print(
            _table("Thresholds of the multi-model detector", HYPOTHESIS_TITLES, hypothesis_rows(calibration))
        )
    for words in calibration.warnings:
        console.print(Text.assemble(("Note: ", "bold yellow"), words), soft_wrap=True)


def _table(title: str, heads: Iterable[str], rows: Iterable[tuple[str, ...]]) -> Table:
    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, pad_edge=False)
    for number, head in enumerate(heads):
        table.add_column(head, no_wrap=number < _WHOLE)
    for row in rows:
        table.add_row(*map(escape, row))
    return table
