"""Parameters that are not tested: why, and what would help.  For these the absence of an alarm means nothing."""

from dataclasses import dataclass
from enum import StrEnum

from monitor_core.monitoring.recommended_settings import MIN_MEMORY_SAMPLES, shortest_memory
from monitor_core.settings import NAMING_MEMORIES, Settings
from monitor_core.wording import rounded_down

SEEDING_MEMORIES = 10
"""Memories of motion until P(0) is found"""
TEST_MEMORIES = 10
"""Further memories with tests, in which a change is found and named"""
MIN_TESTED_MEMORIES = NAMING_MEMORIES
"""Memories from a crossing to the name; a parameter whose tests ran for less than this counts as not tested."""


class NotTested(StrEnum):
    """Reason why a change of a parameter would not be found."""

    NO_SAMPLE = "no sample"  # none has been received, or the samples have stopped
    SETTLING = "settling"  # the predictor has just (re)started
    CONDITIONS = "operating conditions"  # a gate is closed, or a signal is unknown or out of its range
    WARM_UP = "warm-up state"  # the temperature of the axis is not known yet
    UNIDENTIFIABLE = "unidentifiable"  # the record of the nominal values does not determine them
    SEEDING = "seeding"  # P(0) is being found
    NOT_OBSERVED = "not observed"  # the motion contains no information on the parameter
    UNCERTAIN = "uncertain"  # with so little information, the estimate is as uncertain as the parameter is large
    BLOCKED = "blocked"  # P(0) is not found, because other parameters are uncertain
    NO_THRESHOLD = "no threshold"  # the alarm source has no threshold for the parameter


@dataclass(frozen=True, slots=True)
class SeedingRemedy:
    """Ways to make an axis testable for which P(0) has not been found; times in seconds.

    ``seeding_s``: time of motion that finds P(0); ``left_s``: the part of it still needed.  ``record_s``: time of
    motion that suffices to find P(0) and to test.  ``memory_s``: a memory with which the motion received so far would
    have sufficed; None: there is none.  ``joint_state``: that memory is too short for the predictor unless joint_state
    = true.
    """

    memory_now_s: float
    seeding_s: float
    left_s: float
    record_s: float
    memory_s: float | None
    joint_state: bool


def remedy(slowest_s: float, settings: Settings, seed_left: int, moved_samples: int) -> SeedingRemedy:
    """Find the remedy for an axis for which P(0) has not been found.

    Args:
        slowest_s: slowest time constant of its predictor [s].
        settings: settings of the axis.
        seed_left: number of updates still needed to find P(0).
        moved_samples: number of samples with motion so far.
    """
    h, memories = settings.interval_s, SEEDING_MEMORIES + TEST_MEMORIES
    memory_s, joint = fitting_memory(slowest_s, settings, moved_samples * h / memories)
    return SeedingRemedy(
        memory_now_s=settings.memory * h,
        seeding_s=settings.seed_updates * h,
        left_s=seed_left * h,
        record_s=settings.settle_s + memories * settings.memory * h,
        memory_s=memory_s,
        joint_state=joint,
    )


def fitting_memory(slowest_s: float, settings: Settings, most_s: float) -> tuple[float | None, bool]:
    """A memory [s] of at most ``most_s`` that works with this slowest time constant of the predictor, or None.

    The second value: whether that memory needs joint_state = true.
    """
    memory_s = rounded_down(most_s)
    least_s = max(shortest_memory(slowest_s, joint_state=True), MIN_MEMORY_SAMPLES * settings.interval_s)
    needs_joint = memory_s < shortest_memory(slowest_s, joint_state=False)
    return (memory_s if memory_s >= least_s else None), needs_joint
