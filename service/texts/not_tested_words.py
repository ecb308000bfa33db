"""Explains why parameters are not tested, and what would help."""

from collections.abc import Iterator, Mapping, Sequence

from monitor_core.drive import HEAT
from monitor_core.monitoring import MIN_TESTED_MEMORIES, AxisStatus, NotTested
from monitor_core.wording import Sentence, duration, listed


def not_tested_sentences(
    untested: Mapping[NotTested, Sequence[str]], status: AxisStatus, gated_by: str = ""
) -> Iterator[str]:
    """A sentence for each reason: "fm and fc are not tested: .. Needed: ..".

    Args:
        untested: names of the parameters by reason.
        status: of their axis.
        gated_by: the operating condition that excluded the last sample.
    """
    uncertain = listed(untested.get(NotTested.UNCERTAIN, ("another parameter",)))
    for reason, names in untested.items():
        why, needed = (text.format(uncertain=uncertain) for text in _not_tested(reason, status, gated_by))
        yield f"{listed(names)} {_how_long(names, status)}: {why}. Needed: {needed}"


def _how_long(names: Sequence[str], status: AxisStatus) -> str:
    """Whether these parameters are tested at present, but were not for long enough."""
    found = [p for p in status.parameters if p.name in names]
    if found and all(p.tested for p in found):
        short = duration(max(p.tested_s for p in found))
        return f"{'was' if len(names) == 1 else 'were'} tested for {short} only, too short to find and name a change"
    return f"{'is' if len(names) == 1 else 'are'} not tested"


def _not_tested(reason: NotTested, status: AxisStatus, gated_by: str) -> tuple[str, str]:
    """Why parameters are not tested, and what would help."""
    if reason is NotTested.SEEDING and status.remedy is not None:
        r = status.remedy
        why = f"too little motion to begin with, {r.left_s:.3g} of {r.seeding_s:.3g} s are missing"
        needed = f"{r.record_s:.3g} s of motion"
        if r.memory_s is not None and r.memory_s < r.memory_now_s:
            joint = " and joint_state = true" if r.joint_state else ""
            needed += f"; or memory_s = {r.memory_s:g}{joint}, for which the motion so far suffices"
        return why, needed
    if reason is NotTested.WARM_UP and status.judged_in_s is not None:
        # In addition to the time until then, the time after which a parameter counts as tested.
        left_s = status.judged_in_s + MIN_TESTED_MEMORIES * status.memory_s
        if status.waits:
            return _NOT_RECORDED, _WAIT.format(left=duration(left_s))
        return _WHY[reason], _WARMER.format(left=duration(left_s))
    if reason is NotTested.WARM_UP and status.unjudged_s > 0:
        return _WARM_BY_NOW, _NEEDED[reason]
    if reason is NotTested.NOT_OBSERVED and status.confounded:
        return f"{_WHY[reason]} ({'; '.join(status.confounded)})", _NEEDED[reason]
    if reason is NotTested.CONDITIONS and gated_by:
        return f"{_WHY[reason]} ({gated_by})", _within_conditions(gated_by)
    return _WHY[reason], _NEEDED[reason]


def _within_conditions(gated_by: str) -> str:
    """What would help against the condition that excluded the last sample."""
    found = {part.kind: part for part in _parts(gated_by)}
    if not found.keys().isdisjoint(("new poses", "not calibrated")):
        return _THESE
    if "beyond" not in found:
        return _NEEDED[NotTested.CONDITIONS]
    signal = found["beyond"].values["found"]
    is_heat = isinstance(signal, Sentence) and signal.values.get("name") == HEAT
    return _FARTHER + (_WIDEN if is_heat else "")


def _parts(words: str) -> Iterator[Sentence]:
    """The sentence, or those that are joined in it."""
    if isinstance(words, Sentence) and words.kind == "joined":
        for part in words.values.values():
            yield from _parts(part)
    elif isinstance(words, Sentence):
        yield words


_FARTHER = "nominal values and thresholds from records that reach this value, too"
_THESE = (
    "nominal values and thresholds from records under these conditions, too: `axiswatch commission` with all of them"
)
_WIDEN = '; or `outside_calibration = "widen"` in [robot.axis.detector], with which the CUSUM tests go on'
_MORE_MOTION = "motion that accelerates and has several speeds within memory_s, or a longer memory_s"
_COLD = '`start = "cold"` in [robot.axis.thermal], if it is cold at the beginning'
_WARMER = f"{{left}} more of samples at most, as friction may tell it sooner; or {_COLD}"
_WARM_BY_NOW = "how warm the axis was after a start or a pause was not known before; its friction told"
_NOT_RECORDED = "how warm the axis is after a start or a pause is not known, and its records show no warm-up"
_WAIT = "{left} more of samples; or nominal values and thresholds from records from cold to warm"
_FEWER = "to take {uncertain} out of `monitor`"
_WHY: dict[NotTested, str] = {
    NotTested.NO_SAMPLE: "no sample is received",
    NotTested.SETTLING: "the predictor is settling after a start, a gap or lost samples",
    NotTested.CONDITIONS: "operating conditions exclude the samples",
    NotTested.WARM_UP: "how warm the axis is after a start or a pause is not known yet; its friction tells",
    NotTested.UNIDENTIFIABLE: "the record of the nominal values does not determine them",
    NotTested.SEEDING: "enough motion to begin with was there only shortly before the end",
    NotTested.NOT_OBSERVED: "the motion contains almost no information",
    NotTested.UNCERTAIN: "within memory_s the motion contains so little information that a change by the whole size"
    " would not be found",
    NotTested.BLOCKED: "the tests cannot begin, because {uncertain} cannot be determined within memory_s",
    NotTested.NO_THRESHOLD: "the multi-model detector has no threshold",
}
_NEEDED: dict[NotTested, str] = {
    NotTested.NO_SAMPLE: "torque and motion of this axis; `axiswatch listen` shows what is received",
    NotTested.SETTLING: "samples without gaps for longer than settling_time_s",
    NotTested.CONDITIONS: "samples at which every gate is open and every signal is known and within its range",
    NotTested.WARM_UP: f"a longer record: the estimates begin after ten memories (memory_s) of motion; or {_COLD}",
    NotTested.UNIDENTIFIABLE: "nominal values from a record of several speeds and accelerations, or from `axiswatch"
    " identify --fix` with one of them, which is then held at its value in the configuration",
    NotTested.SEEDING: "a longer record",
    NotTested.NOT_OBSERVED: _MORE_MOTION,
    NotTested.UNCERTAIN: f"{_MORE_MOTION}, or {_FEWER}",
    NotTested.BLOCKED: f"{_FEWER}, or {_MORE_MOTION}",
    NotTested.NO_THRESHOLD: "another calibration, `axiswatch calibrate`",
}
