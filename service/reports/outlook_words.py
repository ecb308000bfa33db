"""Quality of the fit of an identification, what the drive model lacks, and what can be monitored with it, in words."""

from monitor_core.drive import COULOMB, DELAY, LOAD, OF_ANGLE, ONE, Drive, split_name
from monitor_core.identification import (
    Effect,
    IdentificationResult,
    Measure,
    Obstacle,
    Rejection,
    Verdict,
    VerdictBasis,
    Watched,
)
from monitor_core.wording import percent
from service.reports.formats import TextTable

BASIS = {
    VerdictBasis.RECORDS: "of records that were not fitted",
    VerdictBasis.HALVES: "of each half of the records with values from the other",
    VerdictBasis.NONE: "of the fitted records, which cannot be divided",
}
_MEASURE = {
    Measure.MOTION: ("the simulation", "motion"),
    Measure.TORQUE: ("the drive, moved as measured,", "torque"),
}
_MEANINGS = {DELAY: "delay of the torque", LOAD: "weight of arm and payload, relative to that of the records"}
"""Meanings of monitored quantities that are no parameters of the drive"""
_MISSING = {
    Effect.POSE: (
        "torque depends on the angle, as that of a weight does: take a drive with a weight (of the library one such as"
        ' "one-mass-weight", with the gear ratio as its nominal r; in a Modelica file AxisWatch.Gravity); if the axis'
        " presses there, as a welding gun does, leave that part out by a gate on a signal, or on its angle"
    ),
    Effect.COULOMB: (
        "friction does not vanish with the speed: add Coulomb friction to the drive (AxisWatch.CoulombFriction)"
    ),
    Effect.OFFSET: "a constant torque acts: add an offset to the drive (AxisWatch.TorqueOffset)",
    Effect.FRICTION_CURVE: (
        "friction is another function of the speed (Stribeck) than fm and fc describe: give records at the speeds of"
        " production"
    ),
    Effect.FAST: (
        "slow motions are explained, fast ones are not: see with --masses auto how many masses these records ask for,"
        " and with --delay whether the torque acts late"
    ),
    Effect.SLOW: (
        "most of the motion is slower than {slow:.2g} rad/s, where friction sticks and slips, other than fm and fc"
        " describe, and outweighs the inertia; faster motion is explained: record such motion, as the same program"
        " without its slow parts (a dry run), and set min_speed = {slow:.2g} in [[robot.axis]], so that slow motion is"
        " not monitored"
    ),
    Effect.SAMPLES: (
        "their samples are too far apart, so that accelerations fall between them: record at least forty from one"
        " reversal of the axis to the next; 10 ms suit most robots"
    ),
    Effect.FOREIGN: (
        "what is missing depends neither on the angle nor on the speed of this axis: where the robot picks and places"
        ' parts, give its axes the signal that tells when (signal = [{{ name = "gripper", ... }}], or that of the'
        " payload), and `axiswatch commission` lets the torque offset follow it; if the records have no such signal,"
        " let the controller send the output of its gripper, too, or record a program without parts; where other axes"
        " accelerate it, `commission` does the same if all axes move in the record; or record this axis alone, and let"
        " a gate monitor it only then ([[robot.axis.gate]] on a signal of the controller, such as the number of its"
        " program); or something is in contact: where the robot grinds, presses or joins, give its axes in the same way"
        " the output that tells when its tool is in contact, and `commission` leaves that time out"
    ),
}


def verdict_words(verdict: Verdict) -> str:
    """The figure and its meaning: 'the simulation explains 94 % of the motion' .."""
    what, of_what = _MEASURE[verdict.measure]
    figure = f"{verdict.validation:.0f} %" if verdict.validation > 0 else "nothing"
    own = f"{verdict.own:.0f} %" if verdict.own > 0 else "nothing"
    words = f"{what} explains {figure} of the {of_what} {BASIS[verdict.basis]}"
    if verdict.basis is not VerdictBasis.NONE:
        words = f"{words}, and {own} of the {of_what} to which the values were fitted"
    return f"{words}{_repeated(verdict)}"


def _repeated(verdict: Verdict) -> str:
    """That other data of the same motion do not test the values; empty: the motion does not repeat itself."""
    if verdict.repeats_s is None:
        return ""
    return (
        f"; all records repeat one motion of {verdict.repeats_s:.2g} s, so this does not show that inertia and friction"
        " are right, nor that they hold in another motion: records of others, too, would"
    )


def missing_words(verdict: Verdict) -> str:
    """What the drive model lacks, in a sentence; empty: nothing."""
    if not verdict.missing:
        return ""
    if verdict.missing == (Effect.SAMPLES,):
        return f"The records do not show the motion: {_MISSING[Effect.SAMPLES]}."
    lacks = "; ".join(_MISSING[effect].format(slow=verdict.slow) for effect in verdict.missing)
    return f"The records show what the drive lacks: {lacks}."


def outlook_words(result: IdentificationResult, rejection: str) -> str:
    """The first line: what can be monitored with this result, what cannot and why, and what would help.

    ``rejection`` says why there are no nominal values; empty: there are.
    """
    if rejection and result.rejection is not Rejection.POOR:
        return f"Nothing can be watched with this: {rejection}."
    watched = [w for w in result.watched if w.obstacle is None]
    named = ", ".join(f"{w.name} (changes from {_change(w, result)})" for w in watched)
    poor = " Alarms would come from what the drive lacks." if result.rejection is Rejection.POOR else ""
    within = f"within a memory of {result.memory_s:g} s; smaller ones take longer"
    words = f"Can be watched: {named}, {within}." if watched else "Nothing can be watched with this."
    if poor and not watched:
        return words + poor  # another motion for a parameter would not help: the drive comes first
    return f"{words}{poor} {obstacle_words(result)}".strip()


def obstacle_words(result: IdentificationResult) -> str:
    """What cannot be monitored with this result, why, and what would help; empty: nothing."""
    return " ".join(_obstacle(w, result) for w in result.watched if w.obstacle is not None)


def watched_table(result: IdentificationResult) -> TextTable:
    """A row for each monitored parameter: its meaning, and the smallest change that can be monitored."""
    drive = result.estimate.drive
    rows = []
    for w in result.watched:
        base, inverse = split_name(w.name)
        meaning = _MEANINGS.get(w.name) or drive.parameter(base).meaning
        change = _change(w, result) if w.obstacle is None else "cannot be watched"
        rows.append((w.name, f"reciprocal of: {meaning}" if inverse else meaning, change))
    return TextTable(("parameter", "what it is", "changes from"), rows)


def _change(w: Watched, result: IdentificationResult) -> str:
    given = result.options.sizes.get(w.name)
    if given is None or w.name == DELAY:
        return percent(w.change)
    base, inverse = split_name(w.name)
    unit = result.estimate.drive.parameter(base).unit
    return f"{w.change * given:.2g}" + ("" if inverse else f" {unit}")


def _obstacle(w: Watched, result: IdentificationResult) -> str:
    if w.obstacle is Obstacle.NO_SIZE:
        sensor = (
            " A torque sensor behind the gearbox does not measure its friction: is there a column with the current or"
            " torque of the motor?"
            if COULOMB in _acts_by(result.estimate.drive, split_name(w.name)[0])
            else ""
        )
        return (
            f"Cannot: {w.name}, since these records do not distinguish it from zero: take it out of monitor, or give"
            f" the size of a change in [robot.axis.model.scales].{sensor}"
        )
    if w.obstacle is Obstacle.TOGETHER:
        return (
            f"Cannot: {w.name}, since this motion does not distinguish it from these: take it out of monitor, or record"
            f" {_motion(w.name, result)}."
        )
    return (
        f"Cannot: {w.name}, since this motion hardly shows it within the memory of the monitor: take it out of monitor,"
        f" raise memory_s, or record {_motion(w.name, result)}."
    )


def _motion(name: str, result: IdentificationResult) -> str:
    """The kind of record that would determine a parameter."""
    drive, base = result.estimate.drive, split_name(name)[0]
    if base == LOAD:
        return "motion of the whole arm at several speeds, slow and fast, in both directions"
    acts = _acts_by(drive, base)
    if acts & {ONE, *OF_ANGLE}:
        return "motion over more of the angle range, in both directions"
    if COULOMB in acts or (name != DELAY and drive.parameter(name).nonnegative):
        return "motion at several speeds, slow and fast, in both directions"
    free = {split_name(name)[0] for name in result.estimate.names}
    if base not in free:  # excite cannot look for what is held
        return "faster motion, with more torque"
    return f"the motion that `axiswatch excite --find {name}` plans"


def _acts_by(drive: Drive, base: str) -> set[int]:
    """The inputs of a drive through which a parameter acts; empty: it acts through the states."""
    return {drive.inputs[term.col] for term in drive.terms if term.matrix == "B" and dict(term.powers).get(base, 0) > 0}


def shaped_for(name: str, result: IdentificationResult) -> bool:
    """Whether the spectrum of a motion can be optimised for a parameter: it is estimated, no friction, no weight."""
    base, drive = split_name(name)[0], result.estimate.drive
    free = {split_name(free)[0] for free in result.estimate.names}
    return base in free and not _acts_by(drive, base) & {ONE, COULOMB, *OF_ANGLE}
