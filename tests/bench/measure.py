"""Timing on a machine that others use, too: all variants in turns, medians; what a process costs; plain tables."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from statistics import median
from typing import NamedTuple, Protocol, TypeVar

K = TypeVar("K")
TICKS_PER_S = os.sysconf("SC_CLK_TCK")


class Say(Protocol):
    """Prints a table past pytest's capture."""

    def __call__(self, title: str, header: Sequence[str], rows: Iterable[Sequence[object]]) -> None: ...


def in_turns(variants: Mapping[K, Callable[[], object]], rounds: int) -> dict[K, float]:
    """Median duration [s] of each variant; the first turn, which loads and fills caches, does not count."""
    times: dict[K, list[float]] = {name: [] for name in variants}
    for turn in range(rounds + 1):
        for name, run in variants.items():
            start = time.perf_counter()
            run()
            if turn:
                times[name].append(time.perf_counter() - start)
    return {name: median(durations) for name, durations in times.items()}


def table(title: str, header: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A title and columns that are as wide as they must be."""
    lines = [[*header], *([_text(value) for value in row] for row in rows)]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    body = ["  ".join([line[0].ljust(widths[0]), *map(str.rjust, line[1:], widths[1:])]).rstrip() for line in lines]
    return "\n".join(["", "", title, "-" * max(map(len, title.splitlines())), *body])


def _text(value: object) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)


class Cpu(NamedTuple):
    """Time that a process has used [s], at one moment."""

    at_s: float
    user_s: float
    system_s: float

    def share_since(self, before: Cpu) -> str:
        """Share of one core since then."""
        elapsed_s, user, system = (now - then for now, then in zip(self, before, strict=True))
        return f"{100 * (user + system) / elapsed_s:.1f} % ({100 * system / elapsed_s:.1f} % system)"


def cpu(pid: int) -> Cpu:
    """Of all threads, also those that have ended."""
    # Behind the name, which may hold anything: state is field 3, utime 14, stime 15.
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    return Cpu(time.monotonic(), int(fields[11]) / TICKS_PER_S, int(fields[12]) / TICKS_PER_S)


def memory_mb(pid: int, what: str = "VmRSS") -> float:
    """Resident memory in MB (1e6 bytes); ``VmHWM``: the most there was."""
    for line in Path(f"/proc/{pid}/status").read_text(encoding="utf-8").splitlines():
        if line.startswith(f"{what}:"):
            return int(line.split()[1]) * 1024 / 1e6
    raise ValueError(f"no {what} of process {pid}")
