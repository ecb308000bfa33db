"""Finds drives by name: in a Modelica file, or in the library.

Each drive is read and reduced to its state space once in a process, however many axes use it.  Mistakes in a drawing
are reported with file and line.  Every function raises ModelError if the drive cannot be made.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import service
from monitor_core.drive import Drive, Output
from monitor_core.modeling import (
    DRAWINGS,
    EXAMPLE_VALUES,
    FlatComponent,
    FlatModel,
    ModelError,
    Origin,
    StateSpace,
    drive_of,
    eliminate,
)
from monitor_core.wording import did_you_mean
from service.config.problems import NOT_UTF8, line_of
from service.config.schema.base_table import GEAR_RATIO, SUFFIX

if TYPE_CHECKING:
    from service.config.schema import AxisConfig

LIBRARY = tuple(DRAWINGS)
"""Names of the library drives, which come with the program."""


class Modelled(NamedTuple):
    """A drive with its state space, nominal values (for a library drive: example values) and drawn components."""

    space: StateSpace
    drive: Drive
    values: Mapping[str, float]
    components: tuple[FlatComponent, ...]


def model_of_axis(axis: AxisConfig, output: Output | None = None) -> Modelled:
    """The drive of a configured axis; ``output``: default is the measured output."""
    m, measured = axis.model, output or axis.output
    if m.drive in LIBRARY and m.drive_model is None:
        return _once(m.drive, measured, DRAWINGS[m.drive].flat)
    return model_called(m.drive, m.drive_model, measured)


def has_no_gear(axis: AxisConfig) -> bool:
    """Whether the drive is one of the library without a gear ratio as a parameter."""
    return axis.model.drive in LIBRARY and GEAR_RATIO not in EXAMPLE_VALUES[axis.model.drive]


def model_called(name: str, model: str | None = None, output: Output | None = None) -> Modelled:
    """The drive of a Modelica file, if the name ends with .mo, or of the library.

    ``model``: name of the model, if the file has several; ``output``: measured output, if not the drawn one.
    """
    if name.endswith(SUFFIX):
        path = Path(name)
        return _model_of_text(str(path), _text(path), model, output)
    if name not in LIBRARY:
        hint = did_you_mean(name, LIBRARY)
        raise ModelError(f'no such drive: {hint}; the name of a Modelica file ends with "{SUFFIX}"')
    return _once(name, output, DRAWINGS[name].flat)._replace(values=EXAMPLE_VALUES[name])


def _model_of_text(name: str, text: str, model: str | None, output: Output | None) -> Modelled:
    def read() -> FlatModel:
        from monitor_core.modeling.modelica import Source
        from monitor_core.modeling.modelica import read as read_modelica

        return read_modelica([Source(name, text)], model)

    return _once((name, text, model), output, read)


def _text(path: Path) -> str:
    try:
        return path.read_bytes().decode("utf-8-sig")
    except OSError as error:
        raise ModelError(f"cannot read the drawing: {error.strerror}", Origin(file=str(path))) from None
    except UnicodeDecodeError as error:
        raise ModelError(NOT_UTF8, Origin("", str(path), line_of(error))) from None


_known: dict[tuple[object, Output | None], Modelled | ModelError] = {}


def _once(key: object, output: Output | None, read: Callable[[], FlatModel]) -> Modelled:
    """The drive with this key, or its error; computed at the first call, then cached."""
    if (key, output) not in _known:
        try:
            _known[key, output] = _model(read(), output)
        except ModelError as error:
            _known[key, output] = error
    found = _known[key, output]
    if isinstance(found, ModelError):
        raise ModelError(found.problem, found.origin)
    return found


def _model(flat: FlatModel, output: Output | None) -> Modelled:
    space = eliminate(flat, output)
    values = {p.name: p.value for p in space.drawn if p.value is not None}
    return Modelled(space, drive_of(space), values, flat.components)


# --- Files of config/ that come with the program: example configurations, drives --------------------------------------


_PLACES = ("shipped", "../config")
"""Folders of these files in an installed wheel and in the source tree."""


def shipped(name: str) -> Path:
    """Path of a file that comes with the program.

    Raises:
        FileNotFoundError: the file is missing, as the program is not completely installed.
    """
    for place in _PLACES:
        path = (Path(service.__file__).parent / place / name).resolve()
        if path.is_file():
            return path
    raise FileNotFoundError(f"{name} is missing: the program is not completely installed")
