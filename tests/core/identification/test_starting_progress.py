"""How far a search has come is told from its beginning to its end."""

from __future__ import annotations

import pytest

from monitor_core.identification.starting import fit_from, fit_from_scratch, start
from monitor_core.identification.starting.search import Steps
from tests.core.identification.test_starting import TWO

Told = list[tuple[int, int]]


@pytest.mark.parametrize("way", ["scratch", "given", "candidates"])
def test_grows_from_step_to_step_to_the_end(way: str, seed: int) -> None:
    record, told = TWO.record(seed), Told()
    problem = TWO.problem(TWO.wrong(seed))
    if way == "scratch":
        fit_from_scratch(problem, [record], progress=lambda *step: told.append(step))
    elif way == "given":
        fit_from(problem, [record], progress=lambda *step: told.append(step))
    else:
        start(problem, [record], {}, progress=lambda *step: told.append(step))
    done, of = zip(*told, strict=True)
    assert len(set(of)) == 1
    assert done[-1] == of[0]
    assert len(done) > 2
    assert list(done) == sorted(set(done))


def test_steps_tell_nothing_twice_and_nothing_beyond() -> None:
    told = Told()
    steps = Steps(lambda *step: told.append(step), 10)
    second = steps.part(4, 3)
    for done in (1, 1, 3, 2):
        steps.reached(done)
    for done in (0, 2, 9):
        second(done)
    steps.reached(11)
    assert told == [(1, 10), (3, 10), (4, 10), (6, 10), (7, 10)]
