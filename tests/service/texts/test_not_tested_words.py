"""What would help against a condition that excluded the last sample."""

from types import SimpleNamespace
from typing import Any

import pytest

from monitor_core.monitoring import NotTested
from monitor_core.wording import joined, sentence
from service.texts.not_tested_words import not_tested_sentences

STATUS: Any = SimpleNamespace(remedy=None, judged_in_s=None, parameters=(), unjudged_s=0.0)
POSES = sentence("new poses", "{share} % of the way", share="66")
FAST = sentence("not calibrated", "{name} = {value}, calibrated from 1 to 2", name="rms speed", value="3")
HEAT = sentence("signal", "{name} = {value}", name="heat", value="31.2")


@pytest.mark.parametrize(
    ("gated_by", "needed"),
    [
        (POSES, "records under these conditions, too"),
        (joined([POSES, FAST]), "records under these conditions, too"),
        (joined([FAST]), "records under these conditions, too"),
        (sentence("beyond", "{found}, beyond {low} to {high}", found="T = 41", low="20", high="35"), "this value, too"),
        (sentence("beyond", "{found}, beyond {low} to {high}", found=HEAT, low="0", high="27.2"), '"widen"'),
        (sentence("slow", "slower than {speed} rad/s", speed="0.1"), "every gate is open"),
    ],
)
def test_the_way_out_is_that_of_the_condition(gated_by: str, needed: str) -> None:
    (words,) = not_tested_sentences({NotTested.CONDITIONS: ["kT", "fm"]}, STATUS, gated_by)
    assert words.startswith(f"kT and fm are not tested: operating conditions exclude the samples ({gated_by}). Needed:")
    assert needed in words


def test_what_was_tested_too_shortly_is_not_said_to_be_untested_now() -> None:
    kT, fm = (SimpleNamespace(name=name, tested=True, tested_s=12.0) for name in ("kT", "fm"))
    status: Any = SimpleNamespace(remedy=None, judged_in_s=None, parameters=(kT, fm), unjudged_s=100.0)
    (words,) = not_tested_sentences({NotTested.WARM_UP: ["kT", "fm"]}, status)
    assert words == (
        "kT and fm were tested for 12 s only, too short to find and name a change: how warm the axis was after a start"
        " or a pause was not known before; its friction told. Needed: a longer record: the estimates begin after ten"
        ' memories (memory_s) of motion; or `start = "cold"` in [robot.axis.thermal], if it is cold at the beginning'
    )
    fm.tested = False
    (words,) = not_tested_sentences({NotTested.WARM_UP: ["kT", "fm"]}, status)
    assert words.startswith("kT and fm are not tested: ")
