"""Which parameters are free: all that can be told, or what the user says, if that makes sense."""

import pytest

from monitor_core.identification.parameter_selection import ParameterSelection, select_parameters
from monitor_core.identification.problem import IdentificationError
from monitor_core.modeling.standard_drives import REFERENCE_VALUES
from service.config.drive_sources import model_of_library

VALUES = {**REFERENCE_VALUES, "fc": 0.08, "tau0": 0.01}


def chosen(*free: str, fix: tuple[str, ...] = (), values: dict[str, float] = VALUES) -> ParameterSelection:
    model = model_of_library("three-mass", None, "angle")
    return select_parameters(model.space, model.drive, values, free, fix)


def test_all_but_torque_constant_and_gear_ratio() -> None:
    found = chosen()
    assert set(found.free) == set(VALUES) - {"kT", "r"}
    assert set(found.held) == {"kT", "r"}


def test_fixed_ones_are_held_beside_these() -> None:
    found = chosen(fix=("fc", "Jm"))
    assert set(found.free) == set(VALUES) - {"kT", "r", "fc", "Jm"}
    assert found.held["fc"] == "fixed by --fix"


def test_free_ones_are_the_only_ones_and_may_be_reciprocals() -> None:
    found = chosen("1/Ja", "fm", "kT")
    assert found.free == ("1/Ja", "fm", "kT")
    assert set(found.held) == set(VALUES) - {"Ja", "fm", "kT"}


EVERYTHING = ("kT", "Jm", "Jg", "Ja", "kg", "ka", "dg", "da", "fm")


def test_what_no_record_can_tell_is_refused_with_the_number() -> None:
    zeros = {**VALUES, "fc": 0.0, "tau0": 0.0}
    with pytest.raises(IdentificationError, match=r"9 parameters are free, but .* only 8 numbers.*Hold kT"):
        chosen(*EVERYTHING, values=zeros)
    # A known friction gives the scale.
    assert chosen(*EVERYTHING).free == EVERYTHING


@pytest.mark.parametrize(
    ("free", "fix", "words"),
    [
        (("jm",), (), 'did you mean "Jm"'),
        ((), ("tau",), 'did you mean "tau0"'),
        (("Jm", "fm"), ("Jm",), "Jm: cannot be both"),
        (("1/Ja",), ("Ja",), "Ja: cannot be both"),
        ((), tuple(VALUES), "nothing is free"),
    ],
)
def test_a_wish_that_makes_no_sense_is_refused(
    free: tuple[str, ...], fix: tuple[str, ...], words: str
) -> None:
    with pytest.raises(IdentificationError, match=words):
        chosen(*free, fix=fix)
