"""Finds torque and motion of each axis among many columns by their values, if names do not tell.

A speed is the slope of an angle; the torque of an axis follows from its motion as that of a rigid mass with friction.
Every candidate for a torque is paired with every candidate for a motion.  From the best pair on, columns get their
roles.
"""

from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import product
from typing import Literal, NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.identification import Record, exchanged_share, has_wrong_sign, rigid_fit, wrap_of
from service.ingest.roles.candidate_columns import CandidateColumns, Named, NamedColumns, candidate_columns
from service.ingest.roles.column_values import MIN_ROWS, rests_beside_zero, roughness
from service.ingest.roles_by_name import axis_name
from service.ingest.samples.unwrap import continuous

_IN_STEP = 0.5
"""A torque at an irregular place in the table is preferred only if it is explained better by this share."""
_ABOUT, _ROUGHER = 0.1, 3.0
"""Of torques that are explained about as well (to this share), one that is smoother by this factor is commanded."""
_JERKS, _RATHER = 0.9, 6.0
"""A torque without a name is rougher than its motion by this factor, compared at this quantile of the roughness."""
_LONG_S, _HARDLY_EVER = 0.05, 0.999
"""Time over which the speed of an angle is measured [s]; quantile of the speed that is reported as the largest"""
_MIN_SIGN_GAIN = 0.2
"""A torque of the wrong sign is preferred only if it is explained better by this share."""
SURE, LIKELY = 0.6, 0.2
"""A pair of torque and motion is sure, or likely, if a rigid mass explains at least this share of the torque."""
_TOGETHER = 0.1
"""Torque and motion have times of their own if a smaller share of the rows with one of them has both"""
_EXCHANGED = 0.4
"""Share of a torque by which the motion of another axis explains more of it than that of its own, if columns have been
exchanged: axes that move at the same time explain some of each other's torques."""


class SignalPair(NamedTuple):
    """Torque and motion of one axis; ``explained``: share of the torque that a rigid mass with this motion explains."""

    name: str
    """Name of the axis"""
    torque: str
    motion: str
    output: Literal["angle", "speed"]
    explained: float
    turned: bool
    """Whether the torque has the wrong sign"""
    wrap_period: float | None = None
    """Period after which the angle wraps, in its own unit"""
    rivals: tuple[str, ...] = ()
    """Other columns that may equally be the torque or the motion, with their quantity"""
    fastest: float | None = None
    """Speed that the axis hardly ever exceeds, in the unit of the motion (per second for an angle); None: not known"""
    better: tuple[str, float] | None = None
    """Another motion that explains far more of the torque, and the share; None: there is none"""
    record: Record | None = None
    """The two columns; None: they have hardly a row in common"""
    exchanged: float | None = None
    """Share of the torque that a rigid mass explains if torque and motion change places; None: they need not"""
    apart: bool = False
    """Whether the two columns hardly ever have values in the same row"""


def axes_by_values(values: Mapping[str, Floats], t: Floats | None, named: Mapping[str, Named]) -> list[SignalPair]:
    """Find the torque and motion columns of each axis.

    ``values``: columns (N,) that change; ``t``: their times (N,) [s], None: evenly spaced; ``named``: by column.
    """
    found = candidate_columns(NamedColumns(values, t, named))
    pairs = sorted(_pairs(found), key=lambda pair: _weight(pair, found), reverse=True)
    axes = list(_assigned(pairs, found))
    alike = [pair for pair in pairs if named[pair.motion].role or pair.output == _usual_quantity(axes)]
    again = list(_assigned(alike, found)) if len(alike) < len(pairs) else axes
    axes = again if len(again) == len(axes) else axes
    axes += _in_place(axes, found)
    sure = {pair.motion for pair in axes if pair.explained >= SURE}
    axes = [pair._replace(better=_better(pair, pairs, sure), exchanged=_exchanged(pair, named)) for pair in axes]
    order = list(values)
    axes.sort(key=lambda pair: order.index(pair.motion))
    if len({pair.name for pair in axes}) < len(axes):
        axes = [pair._replace(name=f"axis{k}") for k, pair in enumerate(axes, 1)]
    return axes


def _pairs(found: CandidateColumns) -> Iterator[SignalPair]:
    """All candidates for a torque with all for a motion; a torque without a name must be rougher than the motion."""
    values, _, named = found.columns
    rough = {name: roughness(v, _JERKS) for name, v in values.items()}
    angles = {y: bool(found.speeds) or rests_beside_zero(values[y]) for y in found.motions}
    for u, y in product(found.torques, found.motions):
        if u != y and (named[u].role or rough[u] > _RATHER * rough[y]):
            yield from (_pair(found.columns, u, y, output) for output in _outputs(named[y].role, angles[y]))


def _assigned(pairs: Sequence[SignalPair], found: CandidateColumns) -> Iterator[SignalPair]:
    """The best pairs, from the best one on, so that each column has one role, with their rivals."""
    named, taken = found.columns.named, set[str]()
    motions_of = Counter(named[name].number for name in found.motions)
    for pair in pairs:
        torque, motion = named[pair.torque], named[pair.motion]
        if {pair.torque, pair.motion} & taken or (not torque.role and pair.explained < LIKELY):
            continue
        if torque.role and torque.number == motion.number and motions_of[torque.number] == 1:
            best = _larger(pair, pairs, found.columns)
        else:
            best = _measured(pair, pairs, found)
        taken |= {best.torque, best.motion, *best.rivals}
        torques = (f"torque {name}" for name in best.rivals)
        motions = (f"{best.output} {name}" for name in found.motions[best.motion])
        yield best._replace(rivals=(*torques, *motions))


def _in_place(axes: Sequence[SignalPair], found: CandidateColumns) -> list[SignalPair]:
    """Further axes whose columns have no names, but are as far apart in the table as those of all other axes.

    On an arm, the load of other links may hide that a motion belongs to its torque.
    """
    columns = found.columns
    steps = {columns.distance(pair.torque, pair.motion) for pair in axes}
    step = steps.pop() if len(axes) > 1 and len(steps) == 1 else None
    if not step or any(columns.named[pair.torque].role for pair in axes):
        return []
    taken = {name for pair in axes for name in (pair.torque, pair.motion)}
    return [
        _pair(columns, torque, motion, axes[0].output)
        for motion in found.motions
        for torque in found.torques
        if columns.distance(torque, motion) == step and not {torque, motion} & taken
    ]


def _usual_quantity(axes: Sequence[SignalPair]) -> Literal["angle", "speed"]:
    """The quantity that most motions are.

    A table has one quantity of all axes.  Of an axis that carries a weight, an angle taken for a speed may explain the
    torque better: what follows the pose then passes for friction.
    """
    return "speed" if 2 * sum(pair.output == "speed" for pair in axes) > len(axes) else "angle"


def _better(pair: SignalPair, pairs: Sequence[SignalPair], sure: Collection[str]) -> tuple[str, float] | None:
    """The motion of another axis that surely explains this torque, where its own does not, and the explained share.

    ``sure``: motions that surely explain the torque of their own axis: they are where they belong, although in a
    program, in which all axes move together, they may explain other torques, too.
    """
    beside = {pair.motion, *sure}
    others = [(p.motion, p.explained) for p in pairs if p.torque == pair.torque and p.motion not in beside]
    best = max(others, key=lambda other: other[1], default=("", 0.0))
    return best if best[1] >= max(SURE, pair.explained + _EXCHANGED) else None


def _exchanged(pair: SignalPair, named: Mapping[str, Named]) -> float | None:
    """See ``SignalPair.exchanged``; columns without a name have been tried in both places anyway."""
    if pair.record is None or not (named[pair.torque].role and named[pair.motion].role):
        return None
    return exchanged_share(pair.record)


def _outputs(role: str, angle: bool) -> Sequence[Literal["angle", "speed"]]:
    """The quantities that a motion may be: both, if neither its name nor (``angle``) the values tell."""
    return ("speed",) if role == "speed" else ("angle",) if role or angle else ("angle", "speed")


def _weight(pair: SignalPair, found: CandidateColumns) -> tuple[bool, float]:
    """Sort key: pairs with the same axis number come first, then those whose torque is explained best."""
    torque, motion = found.columns.named[pair.torque], found.columns.named[pair.motion]
    beside = _IN_STEP * found.is_in_step(pair.torque, pair.motion)
    digits = 1 if torque.role or motion.role else 2
    return torque.number == motion.number, round(pair.explained + beside - _MIN_SIGN_GAIN * pair.turned, digits)


def _measured(pair: SignalPair, pairs: Sequence[SignalPair], found: CandidateColumns) -> SignalPair:
    """Of the torques in step with a motion that fit about as well, the roughest: commanded torques are smoother."""
    values = found.columns.values
    if not found.is_in_step(pair.torque, pair.motion):
        return pair
    alike = [
        other
        for other in pairs
        if other.motion == pair.motion
        and found.is_in_step(other.torque, other.motion)
        and other.explained > pair.explained - _ABOUT
        and other.turned == pair.turned
    ]
    best = max(alike, key=lambda other: roughness(values[other.torque]))
    rough = roughness(values[best.torque])
    rivals = [other.torque for other in alike if roughness(values[other.torque]) * _ROUGHER > rough]
    return best._replace(rivals=tuple(name for name in rivals if name != best.torque))


def _larger(pair: SignalPair, pairs: Sequence[SignalPair], columns: NamedColumns) -> SignalPair:
    """Of the torques of an axis that fit about as well, a far larger one: others are parts of it, as of a contact."""
    values, _, named = columns
    same = [
        other
        for other in pairs
        if (other.motion, other.output) == (pair.motion, pair.output)
        and named[other.torque][:2] == named[pair.torque][:2]
        and other.explained > pair.explained - _ABOUT
    ]
    sizes = {other.torque: float(np.nanstd(values[other.torque])) for other in same}
    largest = max(same, key=lambda other: sizes[other.torque])
    best = largest if sizes[largest.torque] > (1 + _ABOUT) * sizes[pair.torque] else pair
    return best._replace(rivals=tuple(name for name in sizes if name != best.torque))


def _pair(columns: NamedColumns, torque: str, motion: str, output: Literal["angle", "speed"]) -> SignalPair:
    """Two columns as torque and motion of an axis; rows whose time is not after those above are left out."""
    values, t, named = columns
    u, y = values[torque], values[motion]
    both = np.isfinite(u) & np.isfinite(y)
    times = np.asarray(np.arange(u.size) * 1e-3 if t is None else t - t[0], np.float64)
    good = both & np.isfinite(times)
    good[1:] &= times[1:] > np.maximum.accumulate(np.where(np.isfinite(times), times, -np.inf))[:-1]
    explained, turned, fastest = 0.0, False, None
    period, record = None, None
    if np.count_nonzero(good) > 1:
        period = wrap_of(y[good]) if output == "angle" and np.count_nonzero(good) > MIN_ROWS else None
        record = Record(times[good], u[good], continuous(times[good], y[good], period), output, torque)
        fit = rigid_fit(record)
        explained = max(fit.explained, 0.0) if fit is not None else 0.0
        # Most pairs of unnamed columns are unrelated; for these the test of the sign is skipped.
        turned = (named[torque].role != "" or explained > LIKELY - _ABOUT) and has_wrong_sign(record)
        fastest = None if t is None else _fastest(record)
    number = named[torque].number or named[motion].number
    apart = bool(np.sum(both) < _TOGETHER * np.sum(np.isfinite(u) | np.isfinite(y)))
    return SignalPair(
        axis_name(number),
        torque,
        motion,
        output,
        explained,
        turned,
        period,
        fastest=fastest,
        record=record,
        apart=apart,
    )


def _fastest(record: Record) -> float | None:
    speeds = record.y
    if record.quantity == "angle":
        # Difference over enough rows that the resolution of the angle has little effect.
        rows = max(1, round(_LONG_S / float(np.median(np.diff(record.t)))))
        if len(record.t) <= rows:
            return None
        speeds = (record.y[rows:] - record.y[:-rows]) / (record.t[rows:] - record.t[:-rows])
    return float(np.quantile(abs(speeds), _HARDLY_EVER))
