"""All cross-checks of a configuration: names that must differ or exist, values that must agree.

They run once the schema holds.  Each check takes a table and yields findings with paths relative to that table.  Where
it depends on a value that another check reports, it raises ``Undecidable``.
"""

from collections.abc import Callable, Iterable, Iterator
from typing import TypeVar

from service.config.axis_rules import AXIS_RULES
from service.config.base_table import Undecidable
from service.config.bus_rules import BUS_RULES, FILE_RULES, axis_names
from service.config.condition_rules import CONDITION_RULES, signals_of_axes
from service.config.detector_rules import DETECTOR_RULES
from service.config.model_rules import MODEL_RULES
from service.config.nominal_rules import NOMINAL_RULES
from service.config.positions import Keys
from service.config.schema import Config
from service.config.validation_messages import Finding

T = TypeVar("T")
Rule = Callable[[T], Iterator[Finding]]


def crosscheck(config: Config) -> Iterator[Finding]:
    """The findings of all cross-checks."""
    yield from _run(FILE_RULES, config, ())
    for i, bus in enumerate(config.bus):
        yield from _run(BUS_RULES, bus, ("bus", i))
    for i, robot in enumerate(config.robot):
        yield from _run((axis_names, signals_of_axes), robot, ("robot", i))
        for k, axis in enumerate(robot.axis):
            rules = (*AXIS_RULES, *NOMINAL_RULES, *MODEL_RULES, *CONDITION_RULES, *DETECTOR_RULES)
            yield from _run(rules, axis, ("robot", i, "axis", k))


def _run(rules: Iterable[Rule[T]], table: T, path: Keys) -> Iterator[Finding]:
    for rule in rules:
        try:
            for finding in rule(table):
                yield finding.inside(path)
        except Undecidable:
            continue
