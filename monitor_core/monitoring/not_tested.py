"""Parameters that are not tested: why, and what would help.  That there is no alarm says nothing of them."""

from dataclasses import dataclass
from enum import StrEnum

from monitor_core.monitoring.recommended_settings import MIN_MEMORY_SAMPLES, shortest_memory
from monitor_core.settings import NAMING_MEMORIES, Settings
from monitor_core.wording import rounded_down

SEEDING_MEMORIES = 10
"""P(0) is found in so many memories of motion."""
TEST_MEMORIES = 10
"""Memories of tests after that, in which a change is found and named."""
MIN_TESTED_MEMORIES = NAMING_MEMORIES
"""A parameter whose tests ran for less than this, from a crossing to the name, counts as not tested."""


class NotTested(StrEnum):
    """Why no change of a parameter would be found."""

    NO_SAMPLE = "no sample"
    SETTLING = "settling"  # the predictor has just (re)started
    CONDITIONS = "operating conditions"  # a gate is closed, or a signal is unknown or out of its range
    WARM_UP = "warm-up state"  # how warm the axis is, is not known yet
    UNIDENTIFIABLE = "unidentifiable"  # the record of the nominal values does not determine them
    SEEDING = "seeding"  # P(0) is being found
    NOT_OBSERVED = "not observed"  # the motion contains no information on it
    UNCERTAIN = "uncertain"  # so little that the estimate is known no better than the size of the parameter
    BLOCKED = "blocked"  # P(0) is sought again and again, because others are uncertain
    NO_THRESHOLD = "no threshold"  # the detector that alarms has none for it


@dataclass(frozen=True, slots=True)
class Remedy:
    """What would get an axis tested for which P(0) has not been found; times in seconds.

    ``seeding_s``: motion that finds P(0); ``left_s``: what of it is left.  ``record_s``: motion that suffices to find
    P(0) and to test.  ``memory_s``: memory with which the motion received so far would have sufficed; None: none does.
    ``joint_state``: that memory is too short for the predictor unless joint_state = true.
    """

    memory_now_s: float
    seeding_s: float
    left_s: float
    record_s: float
    memory_s: float | None
    joint_state: bool


def remedy(slowest_s: float, settings: Settings, seed_left: int, moved_samples: int) -> Remedy:
    """What would help an axis that has moved for so many samples, with ``seed_left`` left until P(0) is found.

    ``slowest_s``: the slowest time constant of its predictor.
    """
    h, memories = settings.interval_s, SEEDING_MEMORIES + TEST_MEMORIES
    memory_s, joint = fitting_memory(slowest_s, settings, moved_samples * h / memories)
    return Remedy(
        memory_now_s=settings.memory * h,
        seeding_s=settings.seed_updates * h,
        left_s=seed_left * h,
        record_s=settings.settle_s + memories * settings.memory * h,
        memory_s=memory_s,
        joint_state=joint,
    )


def fitting_memory(slowest_s: float, settings: Settings, most_s: float) -> tuple[float | None, bool]:
    """A memory up to ``most_s`` that a predictor with this time constant allows; whether it needs joint_state = true.

    None: there is none.
    """
    memory_s = rounded_down(most_s)
    least_s = max(shortest_memory(slowest_s, joint_state=True), MIN_MEMORY_SAMPLES * settings.interval_s)
    needs_joint = memory_s < shortest_memory(slowest_s, joint_state=False)
    return (memory_s if memory_s >= least_s else None), needs_joint
