"""Merged parameters: a sum that has to be divided by becomes a parameter, and is a single term from then on.

Two rigidly joined inertias act only as q = J1 + r^2 J2, two springs in series divide by q = k1 + k2.  Where a part of q
occurs elsewhere, too, it is replaced there by its solution: k1 = q - k2.  So q and the parameters that are left are
independent of each other, everything stays a Laurent sum, and a sum that is zero is seen to be zero.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence

from monitor_core.modeling.laurent import Laurent, NotLaurentError

Operator = dict[int, Laurent]
"""Power of s -> coefficient, none of them zero."""

Row = dict[str, Operator]
"""Variable or input -> operator, none of them empty: their sum is zero."""


def merge(total: Laurent, rows: Sequence[Row], drawn: Sequence[str], definitions: dict[str, Laurent]) -> None:
    """Make ``total`` a single term wherever it occurs in the rows, and add the definition of the new parameter.

    Args:
        total: a coefficient in the rows.
        rows: equations, changed in place.
        drawn: the user's parameters, those to be merged first.
        definitions: merged parameters so far, in the order of their evaluation.

    Raises:
        NotLaurentError: none of its parts can be replaced.
    """
    for part in _parts(total, rows, drawn):
        slope = total.derivative(part)
        merged = total / slope
        name = merged.sum_text()
        solution = {part: Laurent.symbol(name) - (merged - Laurent.symbol(part))}
        try:
            changed = [(operator, s, c.substitute(solution)) for operator, s, c in _containing(part, rows)]
        except NotLaurentError:
            continue  # something is divided by this part
        for operator, s, c in changed:
            operator[s] = c
        definitions[name] = merged
        return
    raise NotLaurentError(str(total))


def _parts(total: Laurent, rows: Sequence[Row], drawn: Sequence[str]) -> list[str]:
    """Parameters that the sum can be solved for, those first that occur least elsewhere."""
    linear = [
        name
        for name in (*drawn, *sorted(total.names - set(drawn)))
        if name in total.names and total.derivative(name).is_unit and name not in total.derivative(name).names
    ]
    return sorted(linear, key=lambda name: sum(c != total for _, _, c in _containing(name, rows)))


def _containing(name: str, rows: Iterable[Row]) -> Iterator[tuple[Operator, int, Laurent]]:
    """The coefficients that a parameter occurs in, each with its operator and power of s."""
    for row in rows:
        for operator in row.values():
            for s, c in operator.items():
                if name in c.names:
                    yield operator, s, c


def needed(definitions: Mapping[str, Laurent], entries: Iterable[Laurent]) -> dict[str, Laurent]:
    """The definitions that the entries need, directly or indirectly, in order."""
    wanted = {n for entry in entries for n in entry.names}
    for name in reversed(list(definitions)):
        if name in wanted:
            wanted |= definitions[name].names
    return {name: value for name, value in definitions.items() if name in wanted}
