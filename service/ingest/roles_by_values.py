"""Finds torque and motion of each axis among many columns by their values, if names do not tell.

A speed is the slope of an angle; the torque of an axis follows from its motion as that of a rigid mass with friction.
"""

from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import product
from typing import Literal, NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.identification import Record, exchanged_share, has_wrong_sign, rigid_fit, wrap_of
from service.ingest.roles_by_name import axis_name
from service.ingest.unwrap import continuous

_SLOPE, _SAME = 0.95, 0.99
"""Least correlation of a speed with the slope of its angle, and with another speed of the same axis."""
_IN_STEP = 0.5
"""A torque at an irregular place in the table is preferred only if it is explained better by this share."""
_ABOUT, _ROUGHER = 0.1, 3.0
"""Of torques that are explained about as well (to this share), one that is smoother by this factor is commanded."""
_JERKS, _RATHER = 0.9, 6.0
"""A torque without a name is rougher than its motion by this factor, compared at this quantile of the roughness."""
_ALIKE, _LATER = 0.05, 0.9
"""Columns have equal values if they differ by less than this part of their spread; least delay in rows"""
_STILL, _ZERO, _RESTS, _AT_ZERO = 0.01, 0.05, 0.1, 0.3
"""A column rests if it changes by less than this part of its steps; zero, as a part of its range; least share of the
rows at rest; least share of these at zero if the column may be a speed"""
_MIN_ROWS = 3
"""Fewest rows in which two columns must have values to be compared"""
_MIN_RANGE = 1e-9
MOST = (0.01, 0.99)
"""Quantiles that enclose 98 % of a column"""
_LONG_S, _HARDLY_EVER = 0.05, 0.999
"""Time over which the speed of an angle is measured [s]; quantile of the speed that is reported as the largest"""
_MIN_SIGN_GAIN = 0.2
"""A torque of the wrong sign is preferred only if it is explained better by this share."""
SURE, LIKELY = 0.6, 0.2
"""A pair of torque and motion is sure, or likely, if a rigid mass explains at least this share of the torque."""
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


def changes(v: Floats) -> bool:
    """Whether a column (N,) is not constant."""
    finite = v[np.isfinite(v)]
    return finite.size > 2 and float(np.ptp(finite)) > _MIN_RANGE


class Named(NamedTuple):
    """Information from the name of a column."""

    role: str
    """See ``role_of``"""
    number: str
    """Number or word of its axis; empty: neither"""
    place: int | None = None
    """Place of the column in its table"""


def axes_by_values(values: Mapping[str, Floats], t: Floats | None, named: Mapping[str, Named]) -> list[SignalPair]:
    """Find the torque and motion columns of each axis.

    ``values``: columns (N,) that change; ``t``: their times (N,) [s], None: evenly spaced; ``named``: by column.
    """
    columns = _Columns(values, t, named)
    found = _candidates(values, t, named)
    step = _step(found.speeds, named)
    pairs = sorted(_pairs(columns, found), key=lambda pair: _weight(pair, named, step), reverse=True)
    axes = list(_assigned(pairs, columns, found, step))
    alike = [pair for pair in pairs if named[pair.motion].role or pair.output == _usual_quantity(axes)]
    again = list(_assigned(alike, columns, found, step)) if len(alike) < len(pairs) else axes
    axes = again if len(again) == len(axes) else axes
    axes += _in_place(axes, columns, found)
    sure = {pair.motion for pair in axes if pair.explained >= SURE}
    axes = [pair._replace(better=_better(pair, pairs, sure), exchanged=_exchanged(pair, named)) for pair in axes]
    order = list(values)
    axes.sort(key=lambda pair: order.index(pair.motion))
    if len({pair.name for pair in axes}) < len(axes):
        axes = [pair._replace(name=f"axis{k}") for k, pair in enumerate(axes, 1)]
    return axes


class _Columns(NamedTuple):
    """The columns to which roles are given; see ``axes_by_values``."""

    values: Mapping[str, Floats]
    t: Floats | None
    named: Mapping[str, Named]


class _CandidateColumns(NamedTuple):
    """Columns that may be a torque, or a motion; ``speeds``: unnamed angles, each with the column of its speed.

    ``alike``: the motions, each with others that have nearly its values.
    """

    torques: list[str]
    motions: list[str]
    speeds: Mapping[str, str]
    alike: Mapping[str, Sequence[str]]


def _pairs(columns: _Columns, found: _CandidateColumns) -> Iterator[SignalPair]:
    """All candidates for a torque with all for a motion; a torque without a name must be rougher than the motion."""
    values, _, named = columns
    rough = {name: _roughness(v, _JERKS) for name, v in values.items()}
    angles = {y: bool(found.speeds) or _rests_beside_zero(values[y]) for y in found.motions}
    for u, y in product(found.torques, found.motions):
        if u != y and (named[u].role or rough[u] > _RATHER * rough[y]):
            yield from (_pair(columns, u, y, output) for output in _outputs(named[y].role, angles[y]))


def _assigned(
    pairs: Sequence[SignalPair], columns: _Columns, found: _CandidateColumns, step: int | None
) -> Iterator[SignalPair]:
    """The best pairs, from the best one on, so that each column has one role, with their rivals."""
    named, taken = columns.named, set[str]()
    motions_of = Counter(named[name].number for name in found.motions)
    for pair in pairs:
        torque, motion = named[pair.torque], named[pair.motion]
        if {pair.torque, pair.motion} & taken or (not torque.role and pair.explained < LIKELY):
            continue
        if torque.role and torque.number == motion.number and motions_of[torque.number] == 1:
            best = _larger(pair, pairs, columns)
        else:
            best = _measured(pair, pairs, columns, step)
        taken |= {best.torque, best.motion, *best.rivals}
        torques = (f"torque {name}" for name in best.rivals)
        motions = (f"{best.output} {name}" for name in found.alike.get(best.motion, ()))
        yield best._replace(rivals=(*torques, *motions))


def _in_place(axes: Sequence[SignalPair], columns: _Columns, found: _CandidateColumns) -> list[SignalPair]:
    """Further axes whose columns have no names, but are as far apart in the table as those of all other axes.

    On an arm, the load of other links may hide that a motion belongs to its torque.
    """
    named = columns.named
    steps = {_distance(named, pair.torque, pair.motion) for pair in axes}
    step = steps.pop() if len(axes) > 1 and len(steps) == 1 else None
    if not step or any(named[pair.torque].role for pair in axes):
        return []
    taken = {name for pair in axes for name in (pair.torque, pair.motion)}
    return [
        _pair(columns, torque, motion, axes[0].output)
        for motion in found.motions
        for torque in found.torques
        if _distance(named, torque, motion) == step and not {torque, motion} & taken
    ]


def _distance(named: Mapping[str, Named], torque: str, motion: str) -> int | None:
    """How many columns after its motion a torque is; None: unknown."""
    places = named[torque].place, named[motion].place
    return None if places[0] is None or places[1] is None else places[0] - places[1]


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


def _candidates(values: Mapping[str, Floats], t: Floats | None, named: Mapping[str, Named]) -> _CandidateColumns:
    """The columns with a name of a torque or motion; without such names, those whose values allow it."""
    by_role: dict[str, list[str]] = {}
    for name in values:
        by_role.setdefault(named[name].role, []).append(name)
    # If an axis sends torque and current, use the torque: it needs no torque constant.
    known = {named[name].number for name in by_role.get("torque", [])}
    torques = [
        *by_role.get("torque", []),
        *(n for n in by_role.get("current", []) if named[n].number not in known),
    ]
    commanded = _commanded(values, by_role.get("", []))
    unnamed = [n for n in by_role.get("", []) if n not in commanded]
    angles = _alike(values, by_role.get("angle", []), named)
    # If an axis sends angle and speed, use the angle: it gives the better estimates.
    numbers = {named[name].number for name in angles}
    speeds = _alike(values, [n for n in by_role.get("speed", []) if named[n].number not in numbers], named)
    if torques and (alike := angles | speeds):
        return _CandidateColumns(torques, list(alike), {}, alike)
    slope_of = _speeds(values, unnamed, t)
    # The speed of an angle with a name is no torque, however well a motion explains it.
    unnamed = [n for n in unnamed if not any(_likeness(_slope(values[a], t), values[n]) > _SAME for a in angles)]
    alike = angles | speeds or _alike(values, list(slope_of) or unnamed, named)
    motions = list(alike)
    # A column may repeat a speed, e.g. as a command; a friction torque is less similar to it.
    slopes = {
        n
        for n in unnamed
        if n in slope_of.values() or any(_likeness(values[s], values[n]) > _SAME for s in slope_of.values())
    }
    torques = torques or [n for n in unnamed if n not in slopes and (n not in motions or not slopes)]
    return _CandidateColumns(torques, motions, slope_of, alike)


def _alike(values: Mapping[str, Floats], motions: Sequence[str], named: Mapping[str, Named]) -> dict[str, list[str]]:
    """Motions, each with the others of its axis that have nearly its values; it has most noise of these.

    Names do not tell all commands, and commands are smooth: a fifth difference hardly has anything of a motion.
    """
    found: dict[str, list[str]] = {}
    for name in sorted(motions, key=lambda name: -_roughness(values[name], order=5)):
        same = (o for o in found if not named[name].role or named[o].number == named[name].number)
        noisier = next((other for other in same if _likeness(values[other], values[name]) > _SAME), None)
        found.setdefault(noisier or name, [])
        if noisier is not None:
            found[noisier].append(name)
    return {name: found[name] for name in motions if name in found}


def _outputs(role: str, angle: bool) -> Sequence[Literal["angle", "speed"]]:
    """The quantities that a motion may be: both, if neither its name nor (``angle``) the values tell."""
    return ("speed",) if role == "speed" else ("angle",) if role or angle else ("angle", "speed")


def _rests_beside_zero(v: Floats) -> bool:
    """Whether a column (N,) rests mostly at other values than zero, as an angle: an axis rests at the speed 0."""
    finite = v[np.isfinite(v)]
    steps, (low, high) = abs(np.diff(finite)), np.quantile(finite, MOST)
    still = steps <= _STILL * np.quantile(steps, MOST[1])
    zero = abs(finite[1:][still]) < _ZERO * (high - low)
    return bool(np.mean(still) > _RESTS and np.mean(zero) < _AT_ZERO)


def _weight(pair: SignalPair, named: Mapping[str, Named], step: int | None) -> tuple[bool, float]:
    """Sort key: pairs with the same axis number come first, then those whose torque is explained best."""
    alike = named[pair.torque].number == named[pair.motion].number
    beside = _IN_STEP * _in_step(pair, named, step)
    digits = 1 if named[pair.torque].role or named[pair.motion].role else 2
    return alike, round(pair.explained + beside - _MIN_SIGN_GAIN * pair.turned, digits)


def _step(speeds: Mapping[str, str], named: Mapping[str, Named]) -> int | None:
    """Number of columns that one quantity of all axes takes, from each angle to its speed; None: not constant."""
    places = [(named[angle].place, named[speed].place) for angle, speed in speeds.items()]
    steps = {b - a for a, b in places if a is not None and b is not None}
    step = steps.pop() if len(steps) == 1 else 0
    return step if step > 1 else None


def _in_step(pair: SignalPair, named: Mapping[str, Named], step: int | None) -> bool:
    """Whether the torque is a whole number of steps away from its motion in the table."""
    torque, motion = named[pair.torque].place, named[pair.motion].place
    return bool(step and torque is not None and motion is not None and (torque - motion) % step == 0)


def _measured(pair: SignalPair, pairs: Sequence[SignalPair], columns: _Columns, step: int | None) -> SignalPair:
    """Of the torques in step with a motion that fit about as well, the roughest: commanded torques are smoother."""
    values, _, named = columns
    if not _in_step(pair, named, step):
        return pair
    alike = [
        other
        for other in pairs
        if other.motion == pair.motion
        and _in_step(other, named, step)
        and other.explained > pair.explained - _ABOUT
        and other.turned == pair.turned
    ]
    best = max(alike, key=lambda other: _roughness(values[other.torque]))
    rough = _roughness(values[best.torque])
    rivals = [other.torque for other in alike if _roughness(values[other.torque]) * _ROUGHER > rough]
    return best._replace(rivals=tuple(name for name in rivals if name != best.torque))


def _larger(pair: SignalPair, pairs: Sequence[SignalPair], columns: _Columns) -> SignalPair:
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


def _commanded(values: Mapping[str, Floats], names: Sequence[str]) -> set[str]:
    """Columns whose values another column has later: commands, which the measurement follows with a delay."""
    centres = {name: float(np.nanmean(values[name])) for name in names}
    spreads = {name: float(np.nanstd(values[name])) for name in names}
    return {
        a
        for a in names
        for b in names
        if a != b
        and abs(centres[b] - centres[a]) < _ALIKE * spreads[a]
        and abs(spreads[b] - spreads[a]) < _ALIKE * spreads[a]
        and _delay(values[a], values[b]) > _LATER
    }


def _delay(first: Floats, second: Floats) -> float:
    """Delay in rows with which the second column (N,) has the values of the first; 0: the values differ."""
    slope = np.gradient(first)
    rows = np.column_stack([first, slope, np.ones_like(first)])
    good = np.isfinite(rows).all(axis=1) & np.isfinite(second)
    rows, target = rows[good], second[good]
    if len(target) < _MIN_ROWS or not changes(rows[:, 1]):
        return 0.0
    fit = np.linalg.lstsq(rows, target, rcond=None)[0]
    factor, lead, _ = fit.tolist()
    residual = target - rows @ fit
    same = abs(factor - 1) < _ALIKE and float(np.std(residual)) < _ALIKE * float(np.std(target))
    return -lead / factor if same else 0.0


def _roughness(v: Floats, share: float = 0.5, order: int = 2) -> float:
    """Quantile ``share`` of the difference ``order`` of a column (N,), as a part of the range of 98 % of its values."""
    finite = v[np.isfinite(v)]
    low, high = np.quantile(finite, MOST)
    if high == low or len(finite) <= order:
        return 0.0
    return float(np.quantile(abs(np.diff(finite, order)), share) / (high - low))


def _speeds(values: Mapping[str, Floats], names: Sequence[str], t: Floats | None) -> dict[str, str]:
    """Columns (angles) of which another column is the slope, each with that column (its speed)."""
    found = dict[str, str]()
    for angle in names:
        slope = _slope(values[angle], t)
        alike = {name: _likeness(slope, values[name]) for name in names if name != angle}
        best = max(alike, key=alike.__getitem__, default=None)
        if best is not None and alike[best] > _SLOPE:
            found[angle] = best
    return found


def _slope(angle: Floats, t: Floats | None) -> Floats:
    return np.asarray(np.gradient(angle, 1.0 if t is None else t))


def _likeness(a: Floats, b: Floats) -> float:
    """Correlation of two columns; zero if one is constant."""
    both = np.isfinite(a) & np.isfinite(b)
    if not both.any():
        return 0.0
    # Clip each column to the range of 98 % of its values, so that a few faulty rows have little effect.
    u, v = (np.clip(x[both], *np.quantile(x[both], MOST)) for x in (a, b))
    return float(np.corrcoef(u, v)[0, 1]) if changes(u) and changes(v) else 0.0


def _pair(columns: _Columns, torque: str, motion: str, output: Literal["angle", "speed"]) -> SignalPair:
    """Two columns as torque and motion of an axis; rows whose time is not after those above are left out."""
    values, t, named = columns
    u, y = values[torque], values[motion]
    good = np.isfinite(u) & np.isfinite(y)
    times = np.asarray(np.arange(u.size) * 1e-3 if t is None else t - t[0], np.float64)
    good &= np.isfinite(times)
    good[1:] &= times[1:] > np.maximum.accumulate(np.where(np.isfinite(times), times, -np.inf))[:-1]
    explained, turned, fastest = 0.0, False, None
    period, record = None, None
    if np.count_nonzero(good) > 1:
        period = wrap_of(y[good]) if output == "angle" and np.count_nonzero(good) > _MIN_ROWS else None
        record = Record(times[good], u[good], continuous(times[good], y[good], period), output, torque)
        fit = rigid_fit(record)
        explained = max(fit.explained, 0.0) if fit is not None else 0.0
        # Most pairs of unnamed columns are unrelated; for these the test of the sign is skipped.
        turned = (named[torque].role != "" or explained > LIKELY - _ABOUT) and has_wrong_sign(record)
        fastest = None if t is None else _fastest(record)
    number = named[torque].number or named[motion].number
    return SignalPair(
        axis_name(number), torque, motion, output, explained, turned, period, fastest=fastest, record=record
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
