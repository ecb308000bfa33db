"""Drives by the names that a user gives: a Modelica file, or a drive of the library.

Each drive is read, reduced to its state space and converted once in a process, however many axes have it.  Mistakes in
a drawing are reported with its file and line; each function raises ModelError where there is no drive.
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
from service.config.base_table import SUFFIX

if TYPE_CHECKING:
    from service.config.schema import AxisConfig

LIBRARY = tuple(DRAWINGS)
"""Names of the drives that come with the program."""


class Modelled(NamedTuple):
    """A drive with its state space, nominal values, those of a library drive as an example, and drawn components."""

    space: StateSpace
    drive: Drive
    values: Mapping[str, float]
    components: tuple[FlatComponent, ...]


def model_of_axis(axis: AxisConfig, output: Output | None = None) -> Modelled:
    """The drive of a configured axis, for what is measured there or for the ``output`` given."""
    m, measured = axis.model, output or axis.output
    if m.drive in LIBRARY and m.drive_model is None:
        return _once(m.drive, measured, DRAWINGS[m.drive].flat)
    return model_called(m.drive, m.drive_model, measured)


def model_called(name: str, model: str | None = None, output: Output | None = None) -> Modelled:
    """The drive of a Modelica file, if the name ends with .mo, or one that comes with the program.

    ``model``: which one of the file, if there are several; ``output``: what the sensor measures, if not what was drawn.
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
    origin = Origin(file=str(path))
    try:
        data = path.read_bytes()
        return data.decode("utf-8-sig")
    except OSError as error:
        raise ModelError(f"cannot read the drawing: {error.strerror}", origin) from None
    except ValueError as error:
        if not isinstance(error, UnicodeDecodeError):
            raise ModelError(
                "cannot read the drawing: the name of the file holds a zero byte", origin
            ) from None
        line = data[: error.start].count(b"\n") + 1
        raise ModelError(
            "the file must be UTF-8 text; this line holds other bytes", Origin("", str(path), line)
        ) from None


_known: dict[tuple[object, Output | None], Modelled | ModelError] = {}


def _once(key: object, output: Output | None, read: Callable[[], FlatModel]) -> Modelled:
    """The drive of that key, or its error, computed at the first call."""
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


# --- The files of config/ as they come with the program: example configurations, drives -------------------------------


_PLACES = ("shipped", "../config")
"""In an installed wheel; in the source tree."""


def shipped(name: str) -> Path:
    """The file of that name.

    Raises:
        FileNotFoundError: the program is not completely installed.
    """
    for place in _PLACES:
        path = (Path(service.__file__).parent / place / name).resolve()
        if path.is_file():
            return path
    raise FileNotFoundError(f"{name} is missing: the program is not completely installed")
