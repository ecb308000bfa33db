"""A calibration on the terminal."""

from __future__ import annotations

from collections.abc import Iterable

from rich.console import Console
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from service.calibration.found import Calibration
from service.reports.calibration_words import (
    BANK_TITLES,
    FAULT_TITLES,
    HYPOTHESIS_TITLES,
    THRESHOLD_TITLES,
    bank_promise,
    bank_rows,
    confusion_rows,
    confusion_titles,
    fault_rows,
    hypothesis_rows,
    threshold_rows,
)


def print_text(of: Calibration, console: Console) -> None:
    """The promise, thresholds, faults, names."""
    console.print(Text(f"{of.axis.id}: {of.promise}"), soft_wrap=True)
    title = f"Thresholds; smallest fault found within {of.within_s:.3g} s, in 9 of 10"
    console.print(_table(title, THRESHOLD_TITLES, threshold_rows(of)))
    if of.caught:
        console.print(
            _table(f"Faults that begin at {of.onsets} places of the record", FAULT_TITLES, fault_rows(of))
        )
        console.print(_table("Name of the first alarm, all sizes", confusion_titles(of), confusion_rows(of)))
    console.print(Text(bank_promise(of)), soft_wrap=True)
    if of.bank is not None:
        console.print(_table("Thresholds of the bank of hypotheses", HYPOTHESIS_TITLES, hypothesis_rows(of)))
        if of.bank.caught:
            console.print(_table("The same faults, by the bank", BANK_TITLES, bank_rows(of)))
    for words in of.warnings:
        console.print(Text.assemble(("Note: ", "bold yellow"), words), soft_wrap=True)


def _table(title: str, heads: Iterable[str], rows: Iterable[tuple[str, ...]]) -> Table:
    table = Table(*heads, title=title, title_justify="left")
    for row in rows:
        table.add_row(*map(escape, row))
    return table
