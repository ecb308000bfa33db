"""Cells of a CSV table: numbers, dates, times of day, durations."""

import re
from datetime import UTC, datetime
from functools import lru_cache

OTHER_MARK = {".": ",", ",": "."}
"""The mark that separates thousands, by the decimal mark"""
GROUPED = {
    mark: re.compile(rf"\s*[-+]?[1-9]\d{{0,2}}([{other} '\u2019\xa0\u202f])\d{{3}}(?:\1\d{{3}})*(?:[{mark}]\d*)?\s*")
    for mark, other in OTHER_MARK.items()
}
"""Numbers with thousands separators, by the decimal mark: 1,234 or 1'234.5, and 1.234 or 1 234,5"""
DAY = re.compile(r"(\d\d?)([./])(\d\d?)\2(\d{4}),?\s+")
"""A date with the year last, before a time of day"""
_YEAR_FIRST = re.compile(r"(\d{4})/(\d\d?)/(\d\d?)")
HALF_DAY = re.compile(r"\s*([AP])\.?M\.?$", re.IGNORECASE)
"""AM or PM at the end of a time of day"""
_HALF_HOURS = 12
_ONE_DIGIT_HOUR = re.compile(r"(?<!\d)(?<!:)(?=\d:\d\d)")
_BEFORE_ZONE = re.compile(r"\s+(?=([-+]\d\d:?\d\d|Z)$)")
_DAYS = re.compile(r"(\d+) days? (?=\d)")
_DURATION = re.compile(r"(\d+):(\d\d[.,]\d+)|(\d+(?:[.,]\d+)?(?:e-?\d+)?) ?s(?:ec)?")
"""Minutes and seconds of a spreadsheet, 01:23,456, and seconds of MATLAB, 0.004 sec"""
FLAGS = {"true": "1", "false": "0"}
"""The numbers of logical values"""


def is_number(cell: str) -> bool:
    """Whether a cell is a number with a decimal point."""
    try:
        float(cell)
    except ValueError:
        return False
    return True


def plain(cell: str, decimal_mark: str) -> str:
    """A number for ``float``, with a decimal point and without thousands separators; empty: the cell is no number.

    TRUE is 1, and FALSE is 0.
    """
    if (flag := FLAGS.get(cell.lower())) is not None:
        return flag
    if GROUPED[decimal_mark].fullmatch(cell):
        cell = re.sub(f"[^-+\\d{decimal_mark}]", "", cell)
    return "" if OTHER_MARK[decimal_mark] in cell else cell.replace(decimal_mark, ".")


@lru_cache(1 << 18)  # a record is read several times, and a time may have a row for each signal
def seconds_of(cell: str, day_first: bool = False) -> float | None:
    """Seconds since 1970, or since midnight for a time of day, or of a duration; None: the cell has none of them.

    ``day_first``: 01/02/2026 is 1 February.
    """
    if (duration := _DURATION.fullmatch(cell.strip())) is not None:
        minutes, seconds, alone = duration.groups()
        return 60.0 * float(minutes or 0) + float((seconds or alone).replace(",", "."))
    if (days := _DAYS.match(cell)) is not None:
        rest = seconds_of(cell[days.end() :])
        return None if rest is None else 86_400.0 * int(days[1]) + rest
    text, half, hours = cell.strip(), HALF_DAY.search(cell.strip()), 0
    text = HALF_DAY.sub("", text)
    text = DAY.sub(lambda day: _iso_day(day, day_first), _YEAR_FIRST.sub(r"\1-\2-\3", text, count=1))
    text = _ONE_DIGIT_HOUR.sub("0", _BEFORE_ZONE.sub("", text), count=1)
    try:
        date = datetime.fromisoformat(text if "-" in text[:10] else f"1970-01-01 {text}")
    except ValueError:
        return None
    if half is not None:
        if date.hour > _HALF_HOURS:
            return None
        hours = date.hour % _HALF_HOURS - date.hour + (_HALF_HOURS if half[1] in "pP" else 0)
    return (date if date.tzinfo else date.replace(tzinfo=UTC)).timestamp() + 3600 * hours


def _iso_day(day: re.Match[str], day_first: bool) -> str:
    first, second = (day[1], day[3]) if day[2] == "." or day_first else (day[3], day[1])
    return f"{day[4]}-{second:0>2}-{first:0>2} "


def is_date(cell: str) -> bool:
    """Whether a cell is a date, a time of day or a duration."""
    return (":" in cell or cell.endswith(("s", "sec"))) and seconds_of(cell) is not None


def is_number_or_date(cell: str) -> bool:
    """Whether a cell is a number with any decimal mark, a date, a time of day or a duration."""
    return is_number(cell.replace(",", ".")) or is_date(cell)
