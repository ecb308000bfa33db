"""All cross-checks of a configuration: names that must differ or exist, values that must agree.

They run once the schema holds.  Each check takes a table and yields findings with paths relative to that table.  Where
it depends on a value that another check reports, it raises ``Undecidable``.
"""

from collections.abc import Callable, Iterable, Iterator
from typing import TypeVar

from service.config.axis_rules import AXIS_RULES
from service.config.base_table import Undecidable
from service.config.bus_rules import BUS_RULES, CONFIG_RULES
from service.config.condition_rules import CONDITION_RULES, signals_of_axes, values_at_ends
from service.config.file_rules import FILE_RULES
from service.config.model_rules import MODEL_RULES, complete_model
from service.config.positions import Keys
from service.config.problems import Finding
from service.config.schema import Config

T = TypeVar("T")
Rule = Callable[[T], Iterator[Finding]]


def crosscheck(config: Config) -> Iterator[Finding]:
    """The findings of all cross-checks."""
    yield from _run(CONFIG_RULES, config, ())
    for i, bus in enumerate(config.bus):
        yield from _run(BUS_RULES, bus, ("bus", i))
    for i, robot in enumerate(config.robot):
        yield from _run((signals_of_axes,), robot, ("robot", i))
        for k, axis in enumerate(robot.axis):
            path: Keys = ("robot", i, "axis", k)
            yield from _run((*AXIS_RULES, *FILE_RULES), axis, path)
            yield from _run(MODEL_RULES, axis, path, last=complete_model)
            yield from _run(CONDITION_RULES, axis, path, last=values_at_ends)


def _run(rules: Iterable[Rule[T]], table: T, path: Keys, last: Rule[T] | None = None) -> Iterator[Finding]:
    """The findings of rules; ``last`` is asked only where all of them have been checked and find nothing."""
    quiet = True
    for rule in rules:
        try:
            for finding in rule(table):
                quiet = False
                yield finding.inside(path)
        except Undecidable:
            quiet = False
    if quiet and last is not None:
        yield from _run((last,), table, path)
