"""Which class is the drive."""

from __future__ import annotations

import pytest

from monitor_core.modeling.flat import ModelError
from monitor_core.modeling.modelica import Source, read
from tests.core.modeling.modelica.texts import drive, flat

TWO = "model A Real x = 1; end A;\nmodel B Real x = 1; end B;"
PARTS = "package P model Arm Real x = 1; end Arm; model Robot Arm a; end Robot; partial model Q end Q; end P;"


@pytest.mark.parametrize(
    ("text", "model", "chosen"),
    [
        (TWO, "A", "A"),
        (TWO, "B", "B"),
        (PARTS, None, "Robot"),
        (PARTS, "P.Arm", "Arm"),
        (PARTS, "Arm", "Arm"),
        ("model A Real x = 1; end A; model B extends A; end B;", None, "B"),
        ("model A Real x = 1; end A; model B = A;", None, "B"),
        ("model A model Inner Real x = 1; end Inner; Inner i; end A;", None, "A"),
        (drive(), None, "D"),
    ],
)
def test_by_name_or_the_only_one_that_is_not_used(text: str, model: str | None, chosen: str) -> None:
    assert flat(text, model).name == chosen


@pytest.mark.parametrize(
    ("text", "model", "problem"),
    [
        (TWO, None, "several models could be the drive; say which: A, B"),
        (TWO, "C", "there is no model C; there is A, B"),
        (PARTS, "Robo", "there is no model Robo: did you mean P.Robot?; there is P.Arm, P.Robot, P.Q"),
        (PARTS, "P.Q", "model Q is partial"),
        (PARTS, "Modelica.Icons", "there is no model Modelica.Icons"),
        ("partial model A end A; partial model B end B;", None, "every model is partial"),
        ("partial model A end A;", None, "model A is partial: only a model that extends it can be read"),
        ("package P constant Real x = 1; end P;", None, "there is no model in it"),
        ("", None, "the text is empty"),
        ("\n // nothing\n", None, "there is no model in it"),
    ],
)
def test_errors(text: str, model: str | None, problem: str) -> None:
    with pytest.raises(ModelError) as error:
        flat(text, model)
    assert problem in error.value.problem
    assert error.value.origin.file == "d.mo"


def test_no_text() -> None:
    with pytest.raises(ModelError, match="no Modelica text"):
        read([])


def test_all_files_are_named_where_none_has_a_model() -> None:
    with pytest.raises(ModelError, match=r"a\.mo, b\.mo: the text is empty"):
        read([Source("a.mo", ""), Source("b.mo", " ")])
