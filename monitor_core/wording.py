"""What messages share: sentences with their kind and values, suggestions for unknown names, lists, durations, Z90."""

import difflib
import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence

Z90 = 1.645
"""Standard deviations on either side of a value to the ends of its 90 % interval, with which values are shown"""

_NEARLY = 0.05
_MOST = 20
_MANY = 10.0
_SECONDS = {"s": 1.0, "min": 60.0, "h": 3600.0, "d": 86400.0, "w": 604800.0, "y": 31557600.0}
_TIME = re.compile(r"(?P<number>[\d.]+)\s*(?P<unit>[a-z]*)")
_SPELLED = {"hour": "h", "day": "d", "week": "w", "year": "y", "minute": "min", "second": "s", "m": "min"}
_LONGEST_S = 1000 * _SECONDS["y"]


class Sentence(str):
    """A text for a person that can be translated: ``kind`` identifies the sentence, ``values`` are its parts.

    It is an English string; a value may be a sentence itself.
    """

    kind: str
    values: Mapping[str, str]


def sentence(kind: str, template: str, **values: object) -> Sentence:
    """A sentence: the template with its values.  The template need not use all values; a translation may use others."""
    words = Sentence(template.format(**values))
    words.kind, words.values = kind, {n: v if isinstance(v, Sentence) else str(v) for n, v in values.items()}
    return words


def joined(parts: Sequence[str], separator: str = "; ") -> Sentence:
    """Sentences joined by "; "; with any other separator, names joined as in ``listed``."""
    words = Sentence(separator.join(parts) if separator == "; " else listed(parts))
    words.kind = "joined"
    words.values = {**{str(i): part for i, part in enumerate(parts)}, "separator": separator}
    return words


def replaced(text: str, old: str, new: str) -> str:
    """The text with ``old`` replaced by ``new``; a sentence keeps its kind, and its values are replaced too."""
    result = text.replace(old, new)
    if not isinstance(text, Sentence):
        return result
    words = Sentence(result)
    words.kind, words.values = text.kind, {n: replaced(v, old, new) for n, v in text.values.items()}
    return words


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Suggestion for an unknown name, and the known names: 'did you mean "port"? there is host, port'."""
    names = list(known)
    if not names:
        return "there is none"
    close = closest(word, names)
    suggestion = "" if close is None else f'did you mean "{close}"? '
    return f"{suggestion}there is {first_of(names, _MOST)}"


def closest(word: str, known: Iterable[str]) -> str | None:
    """The known name that an unknown one is most like, in any case; None: it is like none of them."""
    folded = {name.casefold(): name for name in reversed(list(known))}
    close = difflib.get_close_matches(word.casefold(), folded, n=1)
    return folded[close[0]] if close else None


def listed(names: Sequence[str], word: str = "and") -> str:
    """``kT, Jm and fm``."""
    if len(names) < 2:
        return "".join(names)
    return f"{', '.join(names[:-1])} {word} {names[-1]}"


def first_of(names: Sequence[str], most: int) -> str:
    """``kT, Jm and 3 more``: the first ``most`` names, and how many others there are."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return f"{', '.join(names[:most])}{more}"


def how_often(count: int) -> str:
    """``once``, ``3 times``."""
    return "once" if count == 1 else f"{count} times"


def percent(value: float | None, signed: bool = False) -> str:
    """Percentage with two digits, as ``0.12 %``; ``> 1000 %`` for larger values; empty for None."""
    if value is None:
        return ""
    if abs(value) > _MANY:
        return f"> {100 * _MANY:g} %"
    digits = float(f"{100 * value:.2g}")
    return f"{digits:+g} %" if signed else f"{digits:g} %"


def rounded_down(value: float) -> float:
    """The value rounded down to two digits: a number that the user is asked to stay below."""
    return _rounded(value, math.floor)


def rounded_up(value: float) -> float:
    """The value rounded up to two digits: a number that the user is asked to reach."""
    return _rounded(value, math.ceil)


def _rounded(value: float, towards: Callable[[float], int]) -> float:
    if value == 0 or not math.isfinite(value):
        return value
    digit = math.floor(math.log10(abs(value))) - 1
    return float(f"{towards(round(value / 10.0**digit, 9))}e{digit}")


def duration(seconds: float) -> str:
    """A duration in words: 90 s, 10 min, 3 hours, 2 years."""
    for word, size in (("a year", 31557600.0), ("a day", 86400.0), ("an hour", 3600.0)):
        if abs(seconds / size - 1) < _NEARLY:
            return word
    for unit, size in (("years", 31557600.0), ("days", 86400.0), ("hours", 3600.0), ("min", 60.0)):
        if seconds >= 1.5 * size:
            number = seconds / size
            return f"{number:.2g} {unit}" if number < 100 else f"{float(f'{number:.2g}'):,.0f} {unit}"
    return f"{seconds:.3g} s"


def seconds_in(text: str) -> float:
    """Seconds in a time such as 10min, 1h, 30d, 1y, "2 hours", or a plain number of seconds.

    Raises:
        ValueError: the text is not a time, or it is below one second or above a thousand years.
    """
    match = _TIME.fullmatch(text.strip().lower())
    unit = (match["unit"] if match else "") or "s"
    unit = next((short for word, short in _SPELLED.items() if unit in (word, f"{word}s")), unit)
    try:
        seconds = float(match["number"]) * _SECONDS[unit] if match else 0.0
    except (ValueError, KeyError):
        seconds = 0.0
    if not 1 <= seconds <= _LONGEST_S:
        raise ValueError(f"{text}: write a time, such as 10min, 1h, 30d or 1y")
    return seconds
