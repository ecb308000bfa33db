"""What structural identifiability means, in plain sentences."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from monitor_core.wording import listed

_FEW = 12
"""So many names are listed; more are counted."""


def sentences(
    identifiable: Sequence[str],
    groups: Sequence[tuple[Sequence[str], Sequence[str], int]],
    invisible: Sequence[str],
    suggestion: Sequence[str],
) -> Iterator[str]:
    """``groups``: of each its parameters, the combinations of them that are seen, and how many more are."""
    if identifiable:
        yield f"{listed(identifiable)} can be found."
    for number, (names, seen, more) in enumerate(groups):
        yield _group(names, seen, more, alone=not identifiable and number == 0 and len(groups) == 1)
    for name in invisible:
        yield f"{name} cannot be seen at all: whatever its value, the sensors show the same."
    held = [name for name in suggestion if name not in invisible]
    if held:
        rest = [name for names, _, _ in groups for name in names if name not in held]
        found = listed(rest) if len(rest) <= _FEW else f"the other {len(rest)}"
        yield f"Hold {listed(held)} known and {found} can be found."


def _group(names: Sequence[str], seen: Sequence[str], more: int, alone: bool) -> str:
    kinds = list(seen) + ([_unnamed(more, "more " if seen else "")] if more else [])
    who = listed(names) if len(names) <= _FEW else f"{len(names)} parameters ({listed(names)})"
    if not kinds:
        return f"Nothing of {who} can be seen."
    start = "Only" if alone else f"Of {who} only"
    end = f": {who} cannot be told apart." if alone else "."
    return f"{start} {listed(kinds)} can be seen{end}"


def _unnamed(count: int, more: str) -> str:
    return f"one {more}combination" if count == 1 else f"{count} {more}combinations"
