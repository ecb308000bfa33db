"""Runs the cross-checks of a configuration: names that must differ or exist, values that must agree.

They run when the schema has no errors.  Each check takes a table and yields findings with paths relative to it.  A
check that depends on a value which another check reports raises ``Undecidable``.
"""

from collections.abc import Callable, Iterable, Iterator
from typing import TypeVar

from service.config.problems import CheckFinding
from service.config.rules.axis_rules import AXIS_RULES, defaults_without_name
from service.config.rules.bus_rules import BUS_RULES, CONFIG_RULES
from service.config.rules.condition_rules import CONDITION_RULES, signals_of_axes, values_at_ends
from service.config.rules.coupling_rules import coupling, defaults_without_coupling, weight_of_coupled
from service.config.rules.file_rules import FILE_RULES
from service.config.rules.link_rules import LINK_RULES, certificate_and_key
from service.config.rules.model_rules import MODEL_RULES, complete_model
from service.config.schema import AxisConfig, Config, RobotConfig
from service.config.schema.base_table import Undecidable
from service.config.toml_lines import Keys

T = TypeVar("T")
Rule = Callable[[T], Iterator[CheckFinding]]

ROBOT_RULES: tuple[Rule[RobotConfig], ...] = (
    defaults_without_name,
    defaults_without_coupling,
    signals_of_axes,
    coupling,
)


def crosscheck(config: Config) -> Iterator[CheckFinding]:
    """The findings of all cross-checks."""
    yield from _run(CONFIG_RULES, config, ())
    yield from _run(LINK_RULES, config.links, ("links",))
    for table, path in ((config.web, ("web",)), (config.links.opcua, ("links", "opcua"))):
        yield from _run((certificate_and_key,), table, path)
    for i, bus in enumerate(config.bus):
        yield from _run(BUS_RULES, bus, ("bus", i))
    for i, robot in enumerate(config.robot):
        yield from _run(ROBOT_RULES, robot, ("robot", i))
        for k, axis in enumerate(robot.axis):
            yield from (found.inside(("robot", i, "axis", k)) for found in axis_findings(axis))


def axis_findings(axis: AxisConfig) -> Iterator[CheckFinding]:
    """The findings of all cross-checks of one axis."""
    yield from _run((*AXIS_RULES, *FILE_RULES, weight_of_coupled), axis, ())
    yield from _run(MODEL_RULES, axis, (), last=complete_model)
    yield from _run(CONDITION_RULES, axis, (), last=values_at_ends)


def _run(rules: Iterable[Rule[T]], table: T, path: Keys, last: Rule[T] | None = None) -> Iterator[CheckFinding]:
    """The findings of rules; ``last`` runs only if all of them could be checked and found nothing."""
    clean = True
    for rule in rules:
        try:
            for finding in rule(table):
                clean = False
                yield finding.inside(path)
        except Undecidable:
            clean = False
    if clean and last is not None:
        yield from _run((last,), table, path)
