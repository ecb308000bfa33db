"""The parameters, or combinations of them, that the sensors of a drive can determine in principle."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np

from monitor_core.arrays import Ints
from monitor_core.modeling.flat import FlatParameter
from monitor_core.modeling.identifiability.combinations import by_unit, combinations_of
from monitor_core.modeling.identifiability.jacobian import GradientSample, samples_of
from monitor_core.modeling.identifiability.lattice import components
from monitor_core.modeling.modular import Seed, rank
from monitor_core.modeling.statespace import StateSpace
from monitor_core.wording import listed

_HELD = ("1", "kg m^2", "N m/rad", "N m s/rad", "N m")
"""Units in the order in which parameters are held: first what a data sheet gives best."""


@dataclass(frozen=True, slots=True)
class Identifiability:
    """The most that any record, however exciting, can determine of the unknown parameters.

    ``identifiable``: seen by themselves (up to a finite number of values). ``groups``: parameters that cannot be
    distinguished; ``seen[i]`` are the combinations of those of group i that can be seen, ``unnamed[i]`` counts
    those that have no simple form. ``invisible``: no sensor shows them at all. ``suggestion``: a smallest set to
    hold known so that all others can be found; none of the ``invisible`` can, so they belong to it.
    """

    identifiable: tuple[str, ...]
    groups: tuple[tuple[str, ...], ...]
    seen: tuple[tuple[str, ...], ...]
    unnamed: tuple[int, ...]
    invisible: tuple[str, ...]
    suggestion: tuple[str, ...]

    @property
    def combinations(self) -> tuple[str, ...]:
        """All identifiable combinations of the groups."""
        return tuple(chain.from_iterable(self.seen))

    @property
    def count(self) -> int:
        """Number of values that can be determined."""
        return len(self.identifiable) + len(self.combinations) + sum(self.unnamed)

    def words(self) -> tuple[str, ...]:
        """The result in sentences."""
        return tuple(_sentences(self))


def structural(
    ss: StateSpace, free: Sequence[str] | None = None, seed: Seed = 0, inputs: Sequence[int] | None = None
) -> Identifiability:
    """Identifiability of the ``free`` parameters (default: all drawn ones), if the others are known.

    ``inputs``: columns of B, each a known signal of its own (torque, direction of motion, 1, gravity); default all.
    """
    drawn = {p.name: p for p in ss.drawn}
    names = tuple(drawn if free is None else dict.fromkeys(free))
    columns = range(len(ss.inputs)) if inputs is None else inputs
    if not names:
        return Identifiability((), (), (), (), (), ())
    rng = np.random.default_rng(seed)
    samples = samples_of(ss, names, rng, columns)
    combinations = combinations_of(ss, names, samples, rng, columns)
    return _sorted_out([drawn[name] for name in names], samples[0][0], combinations)


def _sorted_out(
    free: Sequence[FlatParameter], sample: GradientSample, combinations: Sequence[tuple[str, frozenset[str]]]
) -> Identifiability:
    """Sort the parameters into identifiable, groups and invisible, and assign the combinations to the groups."""
    names, hidden = [p.name for p in free], sample.hidden
    alone = [j for j in range(len(names)) if not hidden[:, j].any()]
    invisible = [j for j in range(len(names)) if not sample.seen[:, j].any()]
    groups = [g for g in components(hidden) if len(g) > 1]
    seen = tuple(tuple(text for text, inside in combinations if inside & {names[j] for j in g}) for g in groups)
    ranks = [len(g) - rank(hidden[:, g], sample.prime) for g in groups]
    return Identifiability(
        identifiable=tuple(names[j] for j in alone),
        groups=tuple(tuple(names[j] for j in g) for g in groups),
        seen=seen,
        unnamed=tuple(r - len(found) for r, found in zip(ranks, seen, strict=True)),
        invisible=tuple(names[j] for j in invisible),
        suggestion=(
            *(names[j] for j in _held(free, hidden, groups, sample.prime)),
            *(names[j] for j in invisible),
        ),
    )


def _held(free: Sequence[FlatParameter], hidden: Ints, groups: Sequence[tuple[int, ...]], prime: int) -> list[int]:
    """Parameters that, held, leave no hidden direction in the groups; the best known ones first."""
    chosen: list[int] = []
    for j in sorted(chain.from_iterable(groups), key=lambda j: (by_unit(free[j].unit, _HELD), j)):
        if rank(hidden[:, [*chosen, j]], prime) > len(chosen):
            chosen.append(j)
    return chosen


# --- The result in sentences ------------------------------------------------------------------------------------------


_FEW = 12
"""Largest number of names that are listed; of more, only the number is given."""


def _sentences(result: Identifiability) -> Iterator[str]:
    if result.identifiable:
        yield f"{listed(result.identifiable)} can be found."
    alone = not result.identifiable and len(result.groups) == 1
    for names, seen, more in zip(result.groups, result.seen, result.unnamed, strict=True):
        yield _group(names, seen, more, alone)
    for name in result.invisible:
        yield f"{name} cannot be seen at all: whatever its value, the sensors show the same."
    held = [name for name in result.suggestion if name not in result.invisible]
    if held:
        rest = [name for names in result.groups for name in names if name not in held]
        found = listed(rest) if len(rest) <= _FEW else f"the other {len(rest)}"
        yield f"Hold {listed(held)} known and {found} can be found."


def _group(names: Sequence[str], seen: Sequence[str], more: int, alone: bool) -> str:
    kinds, further = list(seen), "more " if seen else ""
    if more:
        kinds.append(f"one {further}combination" if more == 1 else f"{more} {further}combinations")
    who = listed(names) if len(names) <= _FEW else f"{len(names)} parameters ({listed(names)})"
    if not kinds:
        return f"Nothing of {who} can be seen."
    start = "Only" if alone else f"Of {who} only"
    end = f": {who} cannot be distinguished." if alone else "."
    return f"{start} {listed(kinds)} can be seen{end}"
