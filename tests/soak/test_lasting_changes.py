"""Lasting changes on an axis that the model does not match: how many alarms each is, and how well sizes are stated."""

import numpy as np
import pytest

from tests.core.lasting_changes import CHANGES, Course, courses

pytestmark = pytest.mark.soak

RUNS, LASTING_S, REPAIRED_S = 10, 600.0, 120.0


def test_one_change_is_one_alarm(seed: int) -> None:
    found: dict[tuple[str, float], list[Course]] = {change: [] for change in CHANGES}
    for run in range(RUNS):
        for change, course in zip(CHANGES, courses(seed + run, LASTING_S, REPAIRED_S), strict=True):
            found[change].append(course)
    for (name, factor), several in found.items():
        z = [_error(course) for course in several]
        sizes = [course.sized.size / course.size for course in several if course.sized and course.sized.size]
        print(
            f"{name} x {factor}: alarms {[len(course.alarms) for course in several]}, size over the true one"
            f" {np.median(sizes):.2f}, within 90 % {np.mean(np.abs(z) < 1.645):.2f}"
        )
    several = [course for each in found.values() for course in each]
    assert np.mean([len(course.alarms) == 1 for course in several]) >= 0.95
    assert np.mean([abs(_error(course)) < 1.645 for course in several]) >= 0.85
    for course in several:
        for _, a in course.changes:
            assert (a.size is None) == (a.size_sd is None)
            assert (a.onset_low_us or a.onset_us) <= a.onset_us <= (a.onset_high_us or a.onset_us)


def _error(course: Course) -> float:
    """Of the size, in its stated standard deviations; infinite: there is none."""
    a = course.sized
    return np.inf if a is None or a.size is None or not a.size_sd else (a.size - course.size) / a.size_sd
