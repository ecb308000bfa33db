"""Timing on a machine that others use, too: all variants in turns, medians; and plain tables."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from statistics import median
from time import perf_counter
from typing import Protocol, TypeVar

K = TypeVar("K")


class Say(Protocol):
    """Prints a table past pytest's capture."""

    def __call__(self, title: str, header: Sequence[str], rows: Iterable[Sequence[object]]) -> None: ...


def in_turns(variants: Mapping[K, Callable[[], object]], rounds: int) -> dict[K, float]:
    """Median duration [s] of each variant; the first turn, which loads and fills caches, does not count."""
    times: dict[K, list[float]] = {name: [] for name in variants}
    for turn in range(rounds + 1):
        for name, run in variants.items():
            start = perf_counter()
            run()
            if turn:
                times[name].append(perf_counter() - start)
    return {name: median(durations) for name, durations in times.items()}


def table(title: str, header: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A title and columns that are as wide as they must be."""
    lines = [[*header], *([_text(value) for value in row] for row in rows)]
    widths = [max(len(line[c]) for line in lines) for c in range(len(header))]
    body = [
        "  ".join(
            v.ljust(w) if c == 0 else v.rjust(w) for c, (v, w) in enumerate(zip(line, widths, strict=True))
        )
        for line in lines
    ]
    rule = "-" * max(map(len, title.splitlines()))
    return "\n".join(["", "", title, rule, *(line.rstrip() for line in body)])


def _text(value: object) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)
