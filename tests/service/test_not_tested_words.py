"""What would help against a condition that excluded the last sample."""

from types import SimpleNamespace
from typing import Any

import pytest

from monitor_core.monitoring import NotTested
from monitor_core.wording import joined, sentence
from service.texts.not_tested_words import not_tested_sentences

STATUS: Any = SimpleNamespace(remedy=None, judged_in_s=None)
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
