"""Texts broken at random places: each is read, or told what is wrong with it; nothing else happens."""

from __future__ import annotations

import re

from hypothesis import example, given, settings
from hypothesis import strategies as st

from monitor_core.modeling.flat import FlatModel, ModelError
from monitor_core.modeling.modelica import Source, read
from tests.core.modeling.modelica.texts import NESTED, TWO_MASS

TOKENS = [re.findall(r'"(?:\\"|[^"])*"|[\w.]+|\s+|.', text) for text in (TWO_MASS, NESTED)]
ODD = [
    "", ";", "(", ")", "=", "end", "1", "-1", "0", "flange_a", "J", "model", "Real", "extends", "der", "true", "1e400",
    "Arm", "Drive", "parameter", "constant", "equation", "connect", "[1]", "{1}", "if", "u", "torque", ".",
]  # fmt: skip


@st.composite
def broken(draw: st.DrawFn) -> str:
    """One to three tokens replaced by others."""
    tokens = list(draw(st.sampled_from(TOKENS)))
    words = [k for k, token in enumerate(tokens) if token.strip()]
    others = st.one_of(st.sampled_from(ODD), st.sampled_from(words).map(lambda k: tokens[k]))
    for k in draw(st.lists(st.sampled_from(words), min_size=1, max_size=3)):
        tokens[k] = draw(others)
    return "".join(tokens)


@settings(deadline=None, max_examples=30)
@given(text=broken())
@example(text=TWO_MASS.replace("displayUnit =", "displayUnit"))
@example(text=NESTED.replace("type Mass = Real", "type Mass = c"))
@example(text=NESTED.replace("R.Inertia mass(J = J)", "J mass(J = J)"))
def test_read_or_told(text: str) -> None:
    try:
        model = read([Source("d.mo", text)])
    except ModelError as error:
        complete = bool(error.problem) and error.origin.file == "d.mo"
    else:
        complete = is_complete(model)
    assert complete


def is_complete(model: FlatModel) -> bool:
    """Every name in the equations is declared."""
    known = {v.name for v in model.variables} | {i.name for i in model.inputs}
    parameters = {p.name for p in model.parameters}
    return all(
        {name for name, _ in equation.terms} <= known
        and {name for c in equation.terms.values() for name in c.names} <= parameters
        for equation in model.equations
    )


def test_unbroken() -> None:
    for tokens in TOKENS:
        assert read([Source("d.mo", "".join(tokens))]).sensors
