"""Cramer-Rao bound of the parameters of a drive from a record, computed from the sensitivities of its output."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.wording import listed, percent

LIMIT = 0.95
"""Magnitude of a correlation from which two parameters are not distinguished."""
POOR = 1.0
"""With a standard deviation of 100 % a parameter is not determined at all."""
FAIR = 0.1
"""A parameter with a smaller relative standard deviation is determined, whatever its correlations are."""

_HIDDEN = 1e-9
"""A direction is hidden if it changes the output by less than this share of the strongest direction."""
_LARGE = 0.3
"""A parameter takes part in a weak direction if its component is at least this share of the largest."""
_TAKES_PART = 1e-6
"""The same for a hidden direction, in which a smaller component is a rounding error."""

CorrelatedPair = tuple[str, str, float]
"""Two parameters and the correlation of their estimates."""


class AccuracyFinding(NamedTuple):
    """Parameters that a record does not determine, and a sentence; ``hidden``: it has no information on them."""

    names: tuple[str, ...]
    hidden: bool
    sentence: str


class WeakDirection(NamedTuple):
    """A joint change of parameters with little effect on the output.

    ``size``: its effect relative to the effects of its single parts.  ``parts``: the larger parts, in units of their
    effect on the output, with the signs of the changes of the parameters.
    """

    size: float
    parts: tuple[tuple[str, float], ...]

    @property
    def names(self) -> tuple[str, ...]:
        """The parameters that take part."""
        return tuple(name for name, _ in self.parts)


@dataclass(frozen=True)
class Accuracy:
    """Accuracy of estimates of ``names`` from a record, if all other parameters are known.

    ``S`` (N, p): sensitivities of the output to relative changes.  ``noise``: standard deviation of white noise on the
    output.  The Cramer-Rao bound holds for any unbiased estimate, and least squares reach it.

    Raises:
        ValueError: S does not have one column for each name; the noise is not positive.
    """

    names: tuple[str, ...]
    S: Floats
    noise: float = 1.0

    def __post_init__(self) -> None:
        if self.S.ndim != 2 or self.S.shape[1] != len(self.names):
            raise ValueError(f"sensitivities {self.S.shape} for {len(self.names)} parameters")
        if not self.noise > 0:
            raise ValueError(f"noise {self.noise}: must be greater than zero")

    @cached_property
    def lengths(self) -> Floats:
        """Root of the sum of squares of each column (p,)."""
        return np.asarray(np.linalg.norm(self.S, axis=0))

    @cached_property
    def _svd(self) -> tuple[Floats, Floats]:
        """Singular values, largest first, and directions (as rows) of the columns scaled to length one."""
        scaled = self.S / np.where(self.lengths > 0, self.lengths, 1.0)
        # Fewer samples than parameters: rows of zeros change nothing and give all directions.
        missing = max(0, len(self.names) - len(scaled))
        _, sizes, directions = np.linalg.svd(np.pad(scaled, ((0, missing), (0, 0))), full_matrices=False)
        return sizes, directions

    @cached_property
    def hidden(self) -> Floats:
        """Directions (k, p) in which the output does not change, each with as few parameters as possible."""
        sizes, directions = self._svd
        return _sparse(directions[sizes <= _HIDDEN * sizes.max(initial=0.0)])

    def inverse_information(self, noise: float) -> Floats:
        """Covariance (p, p) of the estimates with this noise, along the directions that are not hidden; else zero."""
        sizes, directions = self._svd
        seen = len(sizes) - len(self.hidden)
        weighted = directions[:seen] / sizes[:seen, None]
        scale = noise / np.where(self.lengths > 0, self.lengths, 1.0)
        return np.asarray(weighted.T @ weighted * np.outer(scale, scale))

    @cached_property
    def covariance(self) -> Floats:
        """Covariance of the estimates, relative (p, p); infinite variance in hidden directions, NaN beside it."""
        out = self.inverse_information(self.noise)
        lost = self.hidden.any(axis=0)
        out[lost], out[:, lost] = np.nan, np.nan
        out[lost, lost] = np.inf
        return np.asarray(out)

    @property
    def standard_deviations(self) -> Floats:
        """Relative standard deviations (p,): 0.01 is one per cent of the parameter."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @property
    def correlations(self) -> Floats:
        """Correlations of the estimates (p, p); NaN where a parameter is not determined."""
        sd = self.standard_deviations
        with np.errstate(invalid="ignore"):
            return np.asarray(self.covariance / np.outer(sd, sd))

    def pairs(self) -> tuple[CorrelatedPair, ...]:
        """Pairs of parameters whose estimates have a correlation above LIMIT."""
        R = self.correlations
        return tuple(
            (self.names[i], self.names[j], float(R[i, j]))
            for i, j in combinations(range(len(self.names)), 2)
            if abs(R[i, j]) > LIMIT
        )

    def directions(self) -> tuple[WeakDirection, ...]:
        """Joint changes without effect on the output, then those with little effect, the worst first.

        Two parameters whose estimates have a correlation of LIMIT, and with no others, form one direction.
        """
        sizes, rows = self._svd
        seen = range(len(sizes) - len(self.hidden))
        weak = [k for k in reversed(seen) if sizes[k] < np.sqrt(1 - LIMIT)]
        return (
            *(WeakDirection(0.0, self._parts(row, _TAKES_PART)) for row in self.hidden),
            *(WeakDirection(float(sizes[k]), self._parts(rows[k], _LARGE)) for k in weak),
        )

    def _parts(self, row: Floats, least: float) -> tuple[tuple[str, float], ...]:
        large = np.flatnonzero(np.abs(row) >= least * np.abs(row).max())
        sign = 1.0 if row[large[0]] > 0 else -1.0
        return tuple((self.names[i], float(sign * row[i])) for i in large)

    def words(self) -> tuple[str, ...]:
        """Sentences on the parameters that this record does not determine."""
        return tuple(finding.sentence for finding in self.findings())

    def findings(self) -> tuple[AccuracyFinding, ...]:
        """Findings on the parameters that this record does not determine."""
        deviations = dict(zip(self.names, self.standard_deviations.tolist(), strict=True))
        directions, pairs = self.directions(), self.pairs()
        groups = _groups(deviations, directions)
        apart = [p for p in pairs if not any(_inside(p, g) for g in groups)]
        return (*_alone(deviations, directions), *_in_pairs(deviations, apart), *_in_groups(groups, pairs))


def _alone(deviations: Mapping[str, float], directions: Sequence[WeakDirection]) -> Iterator[AccuracyFinding]:
    absent = [d.names[0] for d in directions if d.size == 0 and len(d.parts) == 1]
    if absent:
        verb = "have" if len(absent) > 1 else "has"
        yield AccuracyFinding(tuple(absent), True, f"{listed(absent)} {verb} no effect in this record.")
    poor = {name: percent(sd) for name, sd in deviations.items() if POOR < sd < np.inf}
    if len(poor) == 1:
        ((name, sd),) = poor.items()
        yield AccuracyFinding(
            (name,), False, f"{name} cannot be determined from this record (standard deviation {sd})."
        )
    elif poor:
        names = listed([f"{name} ({sd})" for name, sd in poor.items()])
        sentence = f"{names} cannot be determined from this record (standard deviations in brackets)."
        yield AccuracyFinding(tuple(poor), False, sentence)


def _in_pairs(deviations: Mapping[str, float], pairs: Sequence[CorrelatedPair]) -> Iterator[AccuracyFinding]:
    for first, second, r in pairs:
        if max(deviations[first], deviations[second]) > FAIR:
            sentence = (
                f"{first} and {second} cannot both be determined from this record: their estimates correlate by {r:.2f}"
                f" (standard deviations {percent(deviations[first])} and {percent(deviations[second])})."
            )
            yield AccuracyFinding((first, second), False, sentence)


def _groups(deviations: Mapping[str, float], directions: Sequence[WeakDirection]) -> list[WeakDirection]:
    """Hidden directions, and weak ones of three or more, each with a parameter that the others do not explain."""
    out: list[WeakDirection] = []
    named: set[str] = set()
    for direction in directions:
        names, hidden = set(direction.names), direction.size == 0
        poor = {name for name in names if FAIR < deviations[name] < np.inf}
        if (hidden and len(names) > 1) or (len(names) > 2 and poor - named):
            out.append(direction)
            named |= names
    return out


def _inside(pair: CorrelatedPair, group: WeakDirection) -> bool:
    return {pair[0], pair[1]} <= set(group.names)


def _in_groups(groups: Sequence[WeakDirection], pairs: Sequence[CorrelatedPair]) -> Iterator[AccuracyFinding]:
    for direction in groups:
        names = direction.names
        change = " ".join(f"{'+' if v > 0 else '-'}{name}" for name, v in direction.parts)
        if direction.size == 0:
            effect = "does not move the output at all"
        else:
            effect = f"moves the output by only {percent(direction.size)} of what separate changes do"
            inside = [pair for pair in pairs if _inside(pair, direction)]
            # If more of them correlate, the joint change is reported instead.
            if len(inside) == 1:
                first, other, r = inside[0]
                effect += f", and the estimates of {first} and {other} correlate by {r:.2f}"
        sentence = (
            f"{listed(names)} cannot {'both' if len(names) == 2 else 'all'} be determined from this record:"
            f" the joint change {change} {effect}."
        )
        yield AccuracyFinding(names, direction.size == 0, sentence)


def _sparse(rows: Floats) -> Floats:
    """Basis of the row space in reduced echelon form, with the largest elements as pivots; rounding errors become 0."""
    out = rows.copy()
    for k in range(len(out)):
        i, j = divmod(int(np.argmax(np.abs(out[k:]))), out.shape[1])
        out[[k, k + i]] = out[[k + i, k]]
        out[k] /= out[k, j]
        others = np.arange(len(out)) != k
        out[others] -= np.outer(out[others, j], out[k])
        out[others, j] = 0.0
    out[np.abs(out) < _TAKES_PART] = 0.0
    return out
