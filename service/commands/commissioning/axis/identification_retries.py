"""What commissioning tries next if an axis was not identified, or cannot be monitored as it is."""

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import NamedTuple

from monitor_core.drive import Term, split_name
from monitor_core.identification import Effect, FitQuality, Rejection, TurningWeight, leaves_much_less
from monitor_core.wording import listed
from service.commands.commissioning.axis.load_search import LinkLoad, LoadSearch
from service.config import AxisConfig, NamedAxis
from service.config.written.commissioned import corrected, monitoring, with_drive
from service.config.written.corrections import Correction, changes_in
from service.reports.identification_report import IdentificationReport

_SEVERAL_MASSES = ("two-mass", "three-mass", "five-mass")
_LIBRARY = ("one-mass", *_SEVERAL_MASSES)
OFFSET = "tau0"
"""Name of the torque offset in these drives"""
_WEIGHT = "-weight"


class _Drive(NamedTuple):
    name: str
    monitor: tuple[str, ...]
    values: Mapping[str, float]
    """Values of parameters that no record determines, used if the configuration has none"""


ONE_MASS = _Drive("one-mass", ("kT", "fc", "fm"), {"kT": 1.0})
_TWO_MASS = _Drive("two-mass", ("kT", "1/Ja", "fm"), {"kT": 1.0, "r": 1.0})
_THREE_MASS = _Drive("three-mass", ("kT", "1/Ja", "fm"), {"kT": 1.0, "r": 1.0})
_FAST_S = 0.006
"""Longest interval at which records can show the springs of gearbox and arm."""
_MEMORIES = (1.0, 2.0, 5.0)
"""Multiples of the usual memory to try if the configuration sets none; the shortest one that shows small changes is
used."""


class Retry(NamedTuple):
    """Changes for another identification."""

    text: str
    """Changes of the configuration"""
    changes: tuple[Correction, ...]
    schedule: tuple[str, ...] = ()
    """Schedules by signals, as in `identify --schedule`"""
    shown: str = ""
    """Reason for these schedules: what the torque shows"""
    left_out: str = ""
    """Term that the schedules no longer have, as the fit does not converge with it"""

    @property
    def words(self) -> str:
        """The changes together with the schedules."""
        return ", ".join((*(change.written for change in changes_in(self.changes)), *self.schedule))


def watched_in(report: IdentificationReport) -> tuple[str, ...]:
    """The parameters that can be monitored."""
    return tuple(w.name for w in report.result.watched if w.obstacle is None)


def retry(
    report: IdentificationReport,
    text: str,
    axis: NamedAxis,
    tried: Collection[str],
    search: LoadSearch,
    turn: Callable[[], TurningWeight | None],
) -> Retry | None:
    """Changes to try if the axis was not identified or cannot be monitored as it is; None: none needed or known.

    The load of links is also considered if one mass without it is only a fair fit, or if it explains much more.  Parts
    with a force that no motion explains are left out, if that explains much more than loads do.

    ``text``: the configuration of that identification; ``tried``: drives that were tried; ``turn``: finds how far a
    weight turns with the motion of the axis.
    """
    watched = watched_in(report)
    unfit = bool(report.rejection) or not watched
    used = axis.config.model.drive
    one_mass, fair = used == ONE_MASS.name, report.result.verdict.quality is FitQuality.FAIR
    replaceable = unfit and used.removesuffix(_WEIGHT) in _LIBRARY
    load = search.links if (replaceable or one_mass) and not tried else None
    gate = search.pressing if (unfit or fair) and not tried else None
    if gate and (load is None or leaves_much_less(gate.force.explained, load.weights.explained)):
        gated = corrected(text, axis.id, gate.changes)
        return _with_links(gated, axis, gate.links, gate.changes) if gate.links else Retry(gated, gate.changes)
    if load and (unfit or fair or load.weights.explains_much_more):
        return _with_links(text, axis, load)
    if unfit:
        return _with_other_drive(report, text, axis, tried, turn)
    return followers_monitored(report, text, axis)


def without_fit(text: str, axis: NamedAxis, search: LoadSearch) -> Retry | None:
    """The load of links, where without it nothing can be fitted; None: the torque shows none, or the drive is drawn.

    ``text``: the configuration of that identification.
    """
    known = axis.config.model.drive.removesuffix(_WEIGHT) in _LIBRARY
    return _with_links(text, axis, search.links) if known and search.links else None


def without_unsettled(report: IdentificationReport, text: str) -> Retry | None:
    """Repeat it without one term of the torque offset, if only such terms keep the fit from converging.

    Terms that are nearly alike in the poses of the records, as an acceleration and its product with a cosine, explain
    the torque together, and none of them settles.  The one that would still move most is left out.

    ``text``: the configuration of that identification.  None: something else would move.
    """
    result = report.result
    terms = {term.slope: term.term for term in result.options.scheduled if term.parameter == OFFSET}
    moving = result.estimate.moving
    if result.rejection is not Rejection.NOT_CONVERGED or len(terms) < 2 or not moving or not terms.keys() >= {*moving}:
        return None
    left_out = terms.pop(moving[0])
    return Retry(text, (), (f"{OFFSET}: {', '.join(terms.values())}",), left_out=left_out)


def followers_monitored(report: IdentificationReport, text: str, axis: NamedAxis) -> Retry | None:
    """Repeat it with those parameters that can be monitored, if one that cannot follows a signal or the heat.

    Only monitored parameters can follow.
    """
    watched = watched_in(report)
    bases = {split_name(name)[0] for name in watched}
    scheduled, torques = report.result.options.scheduled, report.result.estimate.drive.constant_torques()
    # A coefficient of a weight is an input unless it is monitored.
    followed = [term for term in scheduled if term.parameter not in torques]
    if not watched or all(split_name(term.parameter)[0] in bases for term in followed):
        return None
    fewer = monitoring(text, axis.id, watched)
    return None if fewer == text else Retry(fewer, ())


def with_spring(text: str, axis: NamedAxis, refusal: str) -> Retry | None:
    """Two masses for one, where samples are fast enough to show a spring; None: they are not, or it bears links.

    ``axis``: with its nominal values, which do not fit its records, as ``refusal`` says.
    """
    config, nominal = axis.config, axis.config.model.nominal_file
    links = nominal is not None and any(table.parameter == OFFSET for table in nominal.schedule)
    if config.model.drive != ONE_MASS.name or config.coupling or links or config.sample_interval_s > _FAST_S:
        return None
    change = Correction(("model", "drive"), _TWO_MASS.name, f"as {ONE_MASS.name} it was {refusal}")
    return Retry(with_drive(text, axis.id, *_TWO_MASS), (change,))


def _with_other_drive(
    report: IdentificationReport,
    text: str,
    axis: NamedAxis,
    tried: Collection[str],
    turn: Callable[[], TurningWeight | None],
) -> Retry | None:
    """The drive that may explain what this one does not; see ``retry``."""
    config, missing = axis.config, report.result.verdict.missing
    if missing == (Effect.SLOW,):
        return None  # another drive has no other friction
    three = config.model.drive == ONE_MASS.name and config.sample_interval_s <= _FAST_S
    springs_first = three and missing[:1] == (Effect.FAST,)
    arm = config.output == "angle" and not config.coupling  # else the angle in the drive is not that of the arm
    bears_weight = Effect.POSE in missing and arm and not springs_first
    drive = _other_drive(config, bears_weight, tried)
    if drive is None:
        return None
    why = report.rejection or "no parameter could be monitored"
    reason = f"as {config.model.drive} it was not identified: {why}"
    changes = [Correction(("model", "drive"), drive.name, reason)]
    if bears_weight and "r" not in config.model.nominal and (ratio := _gear_ratio(turn())) is not None:
        reason = f"the weight repeats as with a gear of about 1/{1 / ratio:.3g}; its data sheet has the exact ratio"
        changes.append(Correction(("model", "nominal", "r"), ratio, reason))
        drive = drive._replace(values={**drive.values, "r": ratio})
    return Retry(with_drive(text, axis.id, *drive), tuple(changes))


def _gear_ratio(found: TurningWeight | None) -> float | None:
    """Side of the gear of the angle, from the turn of the weight; None: angle of the arm, or unknown."""
    return None if found is None or found.least < 1 < found.most else float(f"{found.ratio:.3g}")


def _with_links(text: str, axis: NamedAxis, load: LinkLoad, gate: Sequence[Correction] = ()) -> Retry:
    """One mass with a torque offset that follows the pose of the arm; ``gate``: changes that this text has already."""
    text = with_drive(text, axis.id, *ONE_MASS)
    changes = [*gate, *load.changes]
    if axis.config.model.drive != ONE_MASS.name:
        changes.insert(0, Correction(("model", "drive"), ONE_MASS.name, "the torque shows a weight"))
    motions = {change.key[1] for change in load.changes if change.key[-1] in ("speed", "acceleration")}
    terms = [Term.read(term) for term in load.weights.terms]
    loads = {signal.name for signal in axis.config.signal if signal.axis is None}
    weighs = any(term.turns and motions.isdisjoint(term.signals) for term in terms)
    moves = any(not motions.isdisjoint(term.signals) and loads.isdisjoint(term.signals) for term in terms)
    parts = ["the weight of links at these angles"] if weighs else []
    parts += ["what it takes to move the links"] if moves else []
    parts += ["a load that comes and goes"] if any(not loads.isdisjoint(term.signals) for term in terms) else []
    return Retry(
        corrected(text, axis.id, load.changes),
        tuple(changes),
        (f"{OFFSET}: {', '.join(load.weights.terms)}",),
        listed(parts),
    )


def _other_drive(axis: AxisConfig, bears_weight: bool, tried: Collection[str]) -> _Drive | None:
    """The same with a weight, if the torque shows one; or one mass for several, or three for one at fast samples."""
    before = axis.model.drive.removesuffix(_WEIGHT)
    weight = _WEIGHT if axis.model.drive.endswith(_WEIGHT) else ""
    if bears_weight and not weight and before in _LIBRARY:
        weight = _WEIGHT
        drive = ONE_MASS if before == ONE_MASS.name else _THREE_MASS._replace(name=before)
    elif before in _SEVERAL_MASSES:
        drive = ONE_MASS
    elif before == ONE_MASS.name and axis.sample_interval_s <= _FAST_S:
        drive = _THREE_MASS
    else:
        return None
    if weight:  # where it is, the angle of the arm tells
        drive = drive._replace(name=f"{drive.name}{weight}", values={"r": 1.0, **drive.values})
    return None if drive.name in tried else drive


def memories_of(axis: AxisConfig) -> tuple[float, ...]:
    """The memories [s] to choose from; empty: use the configured one."""
    if axis.estimator.memory_s:
        return ()
    return tuple(float(f"{axis.memory_s * times:.6g}") for times in _MEMORIES)


def memory_change(report: IdentificationReport, axis: AxisConfig) -> tuple[Correction, ...]:
    """The chosen memory, if it is not the configured one."""
    memory_s, memories_s = report.result.memory_s, memories_of(axis)
    if not memories_s or memory_s == memories_s[0]:
        return ()
    reason = "with a shorter one only large changes would be detected in this motion"
    return (Correction(("estimator", "memory_s"), memory_s, reason),)
