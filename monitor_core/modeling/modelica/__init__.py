"""Converts Modelica texts (drawn in OpenModelica, or written by hand) to the flat model of a drive.

text -> pymoca's syntax tree, with places (parsing) -> the tree of all classes (classes), names checked (names)
-> pymoca's instance and flat class -> values of parameters (values), components of the library (library, leaves),
signals (signals) -> flat model (flattening, flat_parameters)

What is wrong in a text is refused where it is found, with a ModelError that names file, line and component.
"""

from collections.abc import Sequence

from monitor_core.modeling.flat import FlatModel, ModelError, Origin
from monitor_core.modeling.modelica.classes import choose, tree_of
from monitor_core.modeling.modelica.flattening import flatten
from monitor_core.modeling.modelica.names import check_names
from monitor_core.modeling.modelica.parsing import Source, parse


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
        root = tree_of([parse(source) for source in sources])
        check_names(root)
        return flatten(root, choose(root, sources, model))
    except RecursionError:
        problem = "is nested too deeply to be read, or a class contains itself"
        raise ModelError(problem, Origin(file=sources[0].name)) from None
