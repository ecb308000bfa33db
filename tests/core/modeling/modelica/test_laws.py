"""Random drives: written as text or drawn, they are the same."""

from __future__ import annotations

import random

from hypothesis import given, settings
from hypothesis import strategies as st

from monitor_core.modeling.flat import FlatModel
from tests.core.modeling.modelica.texts import flat, values, written
from tests.core.modeling.modelica.transfer import PRIME, responses
from tests.core.modeling.random_drives import RandomDrive, drives
from tests.core.modeling.spaces import drawn

LAWS = settings(deadline=None, max_examples=2)  # forty times as many in `make soak`
seeds = st.integers(0, 2**32 - 1)


def behaviour(model: FlatModel, seed: int) -> object:
    """At a random point s, for random values of the parameters, the same for the same name ("c3_J" is "c3.J")."""
    s = random.Random(seed).randrange(1, PRIME)

    def value_of(name: str) -> int:
        return random.Random(f"{seed} {name.replace('.', '_')}").randrange(1, PRIME)

    return responses(model, value_of, s)


@LAWS
@given(drive=drives(), seed=seeds)
def test_a_text_is_the_drawing(drive: RandomDrive, seed: int) -> None:
    text, drawing = flat(written(drive)), drawn(drive.parts, "Whole").flat()
    assert behaviour(text, seed) == behaviour(drawing, seed)
    assert {n.replace("_", ".", 1): v for n, v in values(text).items()} == {
        name: float(v) for name, v in drive.exact.items()
    }
    units = {p.name.replace("_", ".", 1): (p.unit, p.positive) for p in text.parameters}
    expected = {p.name: (p.unit, p.positive) for p in drawing.parameters}
    assert {n: u for n, u in units.items() if not n.endswith("kT")} == {
        n: u for n, u in expected.items() if not n.endswith("kT")
    }
