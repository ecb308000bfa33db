"""``axiswatch init``: the time column of a table, its unit, and the interval of the samples."""

from __future__ import annotations

from collections.abc import Iterable
from datetime import timedelta
from pathlib import Path

import numpy as np
import pytest

from tests.service.command_line import refused, shown
from tests.service.commands.proposals import proposed


def retime(record: Path, head: str, cells: Iterable[str]) -> None:
    """Write other times into the first column, ``head``."""
    names, *lines = record.read_text("utf-8").splitlines()
    rows = [",".join([cell, line.partition(",")[2]]) for cell, line in zip(cells, lines, strict=False)]
    record.write_text("\n".join([head + names[names.index(",") :], *rows]) + "\n", encoding="utf-8")


@pytest.mark.parametrize(
    ("head", "cell"),
    [("Time", "02.03.2026 08:00:{0.seconds:02}"), ("Time", "{0.seconds}"), ("Time [ms]", "{1}0"), ("t", "{2:.2f}")],
)
def test_rounded_times_tell_the_interval(record: Path, head: str, cell: str) -> None:
    """As spreadsheets show dates, and loggers print few digits: there are as many rows in each second."""
    times = [timedelta(milliseconds=5 * k) for k in range(4000)]
    retime(record, head, (cell.format(t, t // timedelta(milliseconds=10), t.total_seconds()) for t in times))
    assert "rows are taken as evenly spaced, 0.005 s apart" in shown("init", record)
    first, _ = proposed()
    assert (first.time.column, first.sample_interval_s) == (None, 0.005)


@pytest.mark.parametrize(
    ("head", "cell", "interval_s", "words"),
    [
        ("Time", "{0:.3f}", 0.005, ""),
        ("Time [ms]", "{1:.0f}", 0.005, ""),
        ("TimeUs", "{2:.0f}", 0.005, ""),
        ("Time", "{1:.0f}", 0.005, " if it is in ms, as its steps suggest"),
        ("Time", "{2:.0f}", 0.005, " if it is in µs, as its steps suggest"),
        ("Time", "{3:.11f}", 0.005, " if it is in days, as its steps suggest"),
        ("Time", "{4:.8f}", 0.005 / 60, " if it is in s, as its steps suggest"),
    ],
)
def test_a_unit_of_the_time_that_no_name_shows_is_asked_for(
    record: Path, head: str, cell: str, interval_s: float, words: str
) -> None:
    times = [0.005 * k for k in range(4000)]
    retime(record, head, (cell.format(t, 1e3 * t, 1e6 * t, 46083.25 + t / 86_400, t / 60) for t in times))
    assert f"time: {head}, {interval_s:.4g} s apart{words}\n" in shown("init", record)
    assert proposed()[0].sample_interval_s == pytest.approx(interval_s, rel=1e-3)


def test_dates_are_in_seconds_however_far_apart(record: Path, seed: int) -> None:
    """Of a logger with a row a second, the rows look as if they counted milliseconds."""
    late = np.random.default_rng(seed).integers(0, 30, 4000)
    retime(
        record,
        "Timestamp",
        (f"2026-03-02 {t // 3600:02}:{t // 60 % 60:02}:{t % 60:02}.{late[t]:03}" for t in range(4000)),
    )
    assert "time: Timestamp, 1 s apart\n" in shown("init", record)
    first = proposed()[0]
    assert (first.time.column, first.time.factor) == ("Timestamp", 1)
    assert first.sample_interval_s == pytest.approx(1.0, rel=0.02)


_FILETIME = 134_404_344_000_000_000


_TICKS = 639_085_896_000_000_000


@pytest.mark.parametrize(
    ("head", "cells", "factor", "words"),
    [
        ("Timestamp", (_FILETIME + 50_000 * k for k in range(4000)), 1e-7, "100 ns since 1601, as times of Windows"),
        ("t [100 ns]", (_FILETIME + 50_000 * k for k in range(4000)), 1e-7, "100 ns since 1601, as times of Windows"),
        ("Ticks", (_TICKS + 50_000 * k for k in range(4000)), 1e-7, "100 ns since the year 1, as times of .NET do"),
        ("time_100ns", (50_000 * k for k in range(4000)), 1e-7, ""),
        ("Time_ms", (46_355_583_333.3 + k * 0.005 / 0.0864 for k in range(4000)), 0.0864, "millionths of a day since"),
        ("Time_ms", (46_355_583_335 + 5 * k for k in range(4000)), 1e-3, ""),  # a machine that runs for 537 days
        ("Time", (1_795_960_800_000_000_000 + 5_000_000 * k for k in range(4000)), 1e-9, "it is in ns, as its steps"),
    ],
)
def test_times_that_count_other_steps_than_their_name_says(
    record: Path, head: str, cells: Iterable[float], factor: float, words: str
) -> None:
    """Their size shows it: a ten times longer interval would be a hundred times the inertia."""
    retime(record, head, (f"{cell:.4f}" if isinstance(cell, float) else str(cell) for cell in cells))
    text = shown("init", record)
    found = proposed()[0]
    assert found.time.factor == pytest.approx(factor)
    assert found.sample_interval_s == pytest.approx(0.005, rel=2e-3)
    assert (
        (f" s apart if it counts {words}" in text or f" s apart if {words}" in text)
        if words
        else " apart if" not in text
    )


def test_seconds_and_their_fraction_in_two_columns(record: Path) -> None:
    """As ROS writes them: the rows are evenly spaced, and it is shown how to write the times of lost ones."""
    names, *lines = record.read_text("utf-8").splitlines()
    stamps = (f"{1_795_960_800 + k // 200},{k % 200 * 5_000_000}" for k in range(4000))
    rows = [",".join([stamp, line.partition(",")[2]]) for stamp, line in zip(stamps, lines, strict=False)]
    head = "stamp.sec,stamp.nanosec" + names[names.index(",") :]
    record.write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    text = shown("init", record)
    assert "rows are taken as evenly spaced, 0.005 s apart" in text
    assert (
        'it is the fraction of "stamp.sec"; where rows are missing, write both as one column, stamp.sec + 1e-9' in text
    )
    assert [(axis.time.column, axis.sample_interval_s) for axis in proposed()] == [(None, 0.005)] * 2


@pytest.mark.parametrize(("head", "cell"), [("Time", "{0:.3f}"), ("stamp.nanosec", "{1}")])
def test_a_time_that_starts_again_is_not_the_time(record: Path, head: str, cell: str) -> None:
    """A recorder began a second time, or seconds are in another column."""
    retime(record, head, (cell.format(0.005 * (k % 3500), k % 200 * 5_000_000) for k in range(4000)))
    text = shown("init", record)
    assert "time: no column; rows are taken as evenly spaced, 0.005 s apart" in text
    assert f'; "{head}" starts again: where rows are missing there, cut the file\n' in text
    assert [axis.time.column for axis in proposed()] == [None, None]


@pytest.mark.parametrize(("rate", "columns"), [(1.0, 2), (0.8, 1)])
def test_signals_with_times_of_their_own(record: Path, rate: float, columns: int) -> None:
    """The scope of TwinCAT writes a time column for each signal: at another rate it belongs to other rows."""
    lines = record.read_text("utf-8").splitlines()
    cells = [line.split(",") for line in lines[1:]]
    rows = [",".join([t, u, t, y, f"{rate * float(t)}", *rest]) for t, u, y, *rest in cells]
    record.write_text("\n".join(["Name,A1_Trq,Name,A1_Pos,Name,A2_Trq,A2_Pos", *rows]) + "\n", encoding="utf-8")
    text = shown("init", record)
    assert len(proposed()) == columns
    apart = "not used: at other times than the others: A2_Trq, A2_Pos; export all at one rate"
    assert (apart in text) == (columns == 1)


@pytest.mark.parametrize(
    ("times", "words"),
    [("{:.0f}", "time: Time"), ("03/02/2026 08:00:{:.0f}", "write a date as 2026-03-02 08:00:00.005")],
)
def test_times_that_are_no_seconds(record: Path, times: str, words: str) -> None:
    """In nanoseconds since 1970; in a way that is not read, which must not go unsaid."""
    lines = record.read_text(encoding="utf-8").splitlines()
    cells = [line.split(",", 1) for line in lines[1:]]
    text = [f"{times.format(1.77e18 + 5e6 * k)},{rest}" for k, (_, rest) in enumerate(cells)]
    record.write_text("\n".join([lines[0], *text]) + "\n", encoding="utf-8")
    assert words in shown("init", record)
    first, _ = proposed()
    assert first.time.column is None or (first.time.factor, first.sample_interval_s) == (1e-9, 0.005)


def test_torque_and_motion_in_rows_of_their_own(record: Path) -> None:
    """As two subscriptions of OPC UA are joined: the proposal, and a record of what was proposed before."""
    shown("init", record)
    head, *rows = record.read_text(encoding="utf-8").splitlines()
    cells = (row.split(",") for row in rows)
    apart = [row for t, u, y, *_ in cells for row in (f"{float(t)},{u},,,", f"{float(t) + 0.002},,{y},,")]
    record.write_text("\n".join([head, *apart]) + "\n", encoding="utf-8")
    text = refused("init", record, "--force")
    assert "A1_Trq and A1_Pos are hardly ever in the same row" in text
    assert "export all columns with a common interval" in text
    text = refused("identify", record, "--config", "axis.toml", "--axis", "axis1")
    assert "0 samples of axis robot1.axis1 in it; dropped: " in text
    assert "as no two rows have both torque and angle: export them with a common interval" in text


def test_rows_in_which_a_few_values_lack_are_no_rows_of_their_own(record: Path) -> None:
    """As values that are written only when they change: one of five rows has both."""
    head, *rows = record.read_text(encoding="utf-8").splitlines()
    cells = [row.split(",") for row in rows]
    gaps = [[t, u, y if k % 5 == 0 else "", *rest] for k, (t, u, y, *rest) in enumerate(cells)]
    record.write_text("\n".join([head, *map(",".join, gaps)]) + "\n", encoding="utf-8")
    text = shown("init", record)
    assert "axis1: torque A1_Trq, angle A1_Pos" in text
    assert "common interval" not in text
