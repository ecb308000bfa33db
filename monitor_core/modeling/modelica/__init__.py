"""Modelica texts (drawn in OpenModelica, or written by hand) to the flat model of a drive.

text -> parse tree (parsing, with pymoca's grammar) -> classes (declarations, syntax) -> names (names, lookup)
-> tree of instances (instantiation, changes) -> values of parameters (values), connections (connecting), components of
the library (leaves) -> flat model (flattening)

Why pymoca is only the parser here.  Its flattener (tried: pymoca 0.12, with a small rotational library) gives the right
equations of a plain drive.  But it accepts silently what means another drive: a component whose condition is false
stays, an array of components becomes one component, algorithms and text behind the last class vanish.  Its tree holds
neither conditions nor line numbers.  So these texts could be refused, with name and line, only by a second walk over
the parse tree; and its own errors name no line (an unknown flange is a KeyError).
"""

from __future__ import annotations

from collections.abc import Sequence

from monitor_core.modeling.flat import FlatModel, ModelError, Origin
from monitor_core.modeling.modelica.choice import choose
from monitor_core.modeling.modelica.component_conditions import truth
from monitor_core.modeling.modelica.declarations import parse
from monitor_core.modeling.modelica.flattening import Flattening
from monitor_core.modeling.modelica.instantiation import Instantiation
from monitor_core.modeling.modelica.names import Names, root_of
from monitor_core.modeling.modelica.syntax import Source
from monitor_core.modeling.modelica.values import Values

__all__ = ["Source", "read"]


def read(sources: Sequence[Source], model: str | None = None) -> FlatModel:
    """The flat model of a drive written in Modelica.

    Args:
        sources: the texts; classes of one may use those of another.
        model: the name of the drive's class ("Robot.Axis1"); None: the only model that no other class uses.

    Raises:
        ModelError: a syntax error, something unknown or not supported, with file, line and component.
    """
    if not sources:
        raise ModelError("no Modelica text is given")
    try:
        return _read(sources, model)
    except RecursionError:
        raise ModelError("is nested too deeply to be read", Origin(file=sources[0].name)) from None


def _read(sources: Sequence[Source], model: str | None) -> FlatModel:
    texts = [parse(source) for source in sources]
    names = Names(root_of(texts))
    values = Values(names)
    instance = Instantiation(names, lambda condition: truth(condition, values)).model(
        choose(texts, names, model)
    )
    return Flattening(instance, values).flat()
