"""Keys that axes share stand once in [robot.defaults]; a file with them means the same as one without."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterable, Iterator
from copy import deepcopy
from typing import Any

import tomlkit
from hypothesis import given, settings
from hypothesis import strategies as st

from service.config.schema.robot_defaults import completed
from service.config.written.commissioned import Found, commissioned, connected, corrected, monitoring, with_drive
from service.config.written.corrections import Correction

law = settings(deadline=None, max_examples=8)
FOUND = {
    f"cell.axis{n}": Found(f"{n}.toml", f"thresholds{n}.toml" if n > 1 else None, ("kT", "fm") if n < 3 else ("kT",))
    for n in (1, 2, 3)
}


def robot() -> dict[str, Any]:
    """Three axes, alike but for their signals and a few values."""
    axes = []
    for n in (1, 2, 3):
        nominal = {"kT": 1.0, "r": 0.01 * (1 + (n == 3)), "fm": 0.1}
        axis = {
            "name": f"axis{n}",
            "bus": "can0",
            "sample_interval_s": 0.005,
            "torque": {"message": f"T{n}", "signal": "Torque", "factor": -1.0 if n == 2 else 1.0},
            "angle": {"message": f"A{n}", "signal": "Angle"},
            "time": {"counter_message": f"A{n}", "counter_signal": "Counter", "column": "t"},
            "model": {
                "drive": "own.mo",
                "monitor": ["kT", "fm"],
                "nominal": nominal,
                "bounds": {"kT": [0.5, 2.0], "fm": [0.01, 1.0]},
                "limits": {"1/fm": 5.0},
            },
            "alarms": {"latched": ["fm", "delay"], "priorities": {"fm": "high", "kT": "low"}},
            "estimator": {"torque_noise": 0.05},
            "detector": {"alpha_1": 3.0, "alpha_2": 20.0 + (n == 1), "budget_s": 3600.0},
        }
        axes.append(axis)
    bus = {"name": "can0", "channel": "can0", "messages": "a.dbc"}
    return {"bus": [bus], "robot": [{"name": "cell", "axis": axes}]}


def shared(tables: Iterable[dict[str, Any]], draw: st.DrawFn) -> dict[str, Any]:
    """What tables have in common or one of them has, as drawn; it is taken out of those that have it."""
    tables, defaults = list(tables), {}
    for key in [key for key in tables[0] if key != "name"]:
        values = [table[key] for table in tables]
        if all(isinstance(value, dict) for value in values):
            if inner := shared(values, draw):
                defaults[key] = inner
                for table in tables:
                    if not table[key]:
                        del table[key]
        elif draw(st.booleans()):
            defaults[key] = draw(st.sampled_from(values))
            for table in tables:
                if table[key] == defaults[key]:
                    del table[key]
    return defaults


@st.composite
def with_shared_keys(draw: st.DrawFn) -> dict[str, Any]:
    config = robot()
    (cell,) = config["robot"]
    defaults = shared(cell["axis"], draw)
    if draw(st.booleans()):  # these two follow from other keys
        for axis in cell["axis"]:
            axis.pop("bus", None)
            axis.get("time", {}).pop("counter_message", None)
        defaults.pop("bus", None)
        defaults.get("time", {}).pop("counter_message", None)
    return {**config, "robot": [{"name": "cell", "defaults": defaults, "axis": cell["axis"]}]}


def meaning(config: dict[str, Any]) -> dict[str, Any]:
    """The axes of a configuration, complete."""
    axes = completed(config)["robot"][0]["axis"]
    return {axis["name"]: {key: value for key, value in axis.items() if value != {}} for axis in axes}


def text_of(config: dict[str, Any]) -> str:
    return tomlkit.dumps(config)


def dotted(config: dict[str, Any]) -> str:
    """The same with dotted keys, no table of an axis: ``model.nominal.kT = 1.0``."""
    (cell,) = config["robot"]
    tables = [("[robot.defaults]", cell.get("defaults", {})), *(("[[robot.axis]]", axis) for axis in cell["axis"])]
    lines = [text_of({"bus": config["bus"]}), "[[robot]]", 'name = "cell"']
    for heading, table in tables:
        lines += [heading, "# as a user writes it", *(f"{key} = {text}" for key, text in flat(table))]
    return "\n".join(lines) + "\n"


def flat(table: dict[str, Any]) -> Iterator[tuple[str, str]]:
    for key, value in table.items():
        if isinstance(value, dict):
            yield from ((f"{tomlkit.key(key).as_string()}.{inner}", text) for inner, text in flat(value))
        else:
            yield tomlkit.key(key).as_string(), tomlkit.item(value).as_string()


@law
@given(with_shared_keys())
def test_a_file_with_defaults_means_what_it_means_written_out(config: dict[str, Any]) -> None:
    before = deepcopy(config)
    assert meaning(config) == meaning(robot())
    assert config == before


@law
@given(with_shared_keys())
def test_commissioning_changes_both_alike(config: dict[str, Any]) -> None:
    corrections = [Correction(("torque", "factor"), 2.0, ""), Correction(("angle", "wrap_period"), 6.25, "")]
    changes: tuple[Callable[[str], str], ...] = (
        lambda text: commissioned(text, FOUND),
        lambda text: commissioned(text, {name: FOUND[name] for name in ("cell.axis3",)}),
        lambda text: corrected(text, "cell.axis2", corrections),
        lambda text: monitoring(text, "cell.axis2", ("fm",)),
        lambda text: with_drive(text, "cell.axis2", "one-mass", ("kT",), {"kT": 3.0, "fc": 1.0}),
    )
    for change in changes:
        texts = (text_of(config), dotted(config), text_of(robot()))
        short, with_dots, long = (meaning(tomllib.loads(change(text))) for text in texts)
        assert short == long
        assert with_dots == long
        assert "# as a user writes it" in change(dotted(config))


@law
@given(with_shared_keys())
def test_what_a_file_of_thresholds_replaces_is_left_out(config: dict[str, Any]) -> None:
    axes = meaning(tomllib.loads(commissioned(text_of(config), FOUND)))
    assert axes["axis1"]["detector"].keys() == {"alpha_1", "alpha_2", "budget_s"}  # without such a file
    assert not axes["axis2"].get("detector")


@law
@given(with_shared_keys())
def test_what_is_configured_for_parameters_that_are_not_monitored_any_more_is_left_out(
    config: dict[str, Any],
) -> None:
    changes: tuple[Callable[[str], str], ...] = (
        lambda text: commissioned(text, {"cell.axis3": FOUND["cell.axis3"]}),
        lambda text: monitoring(text, "cell.axis3", ("kT",)),
    )
    for change in changes:
        axis = meaning(tomllib.loads(change(text_of(config))))["axis3"]
        assert axis["model"]["bounds"] == {"kT": [0.5, 2.0]}
        assert not axis["model"].get("limits")
        assert axis["alarms"] == {"latched": ["delay"], "priorities": {"kT": "low"}}


@law
@given(with_shared_keys())
def test_a_bus_is_added_to_either(config: dict[str, Any]) -> None:
    tables = "[[robot]]\nname = 'cell'\n" + "".join(
        f"[[robot.axis]]\nname = 'axis{n}'\ntorque = {{column = 'u{n}'}}\n" for n in (1, 2, 3)
    )
    short, long = (meaning(tomllib.loads(connected(tables, text_of(c), "x"))) for c in (config, robot()))
    assert short == long


def test_changed_tables_are_evenly_spaced_and_others_stay_as_they_were() -> None:
    text = """[[robot]]
name = "cell"
[robot.defaults]
model = { drive = "one-mass", monitor = ["kT", "fc"], nominal = { kT = 1 } }
[[robot.axis]]
name = "axis1"
torque = { column = "u" }  # sure
model = { nominal = { kT = 1 }, scales = { kT = 0.1, fc = 1 }, friction_speed_scale = 1 }  # of the data sheet
"""
    changed = with_drive(text, "cell.axis1", "three-mass", ("kT", "1/Ja"), {"kT": 1.0, "r": 0.1})
    changed = commissioned(changed, {"cell.axis1": Found("n.toml", "t.toml", ("kT", "1/Ja"))})
    lines = changed.splitlines()
    assert 'model = {drive = "one-mass", monitor = ["kT", "fc"]}' in lines
    assert 'torque = { column = "u" }  # sure' in lines
    (model,) = [line for line in lines if "n.toml" in line]
    assert model.endswith("}  # of the data sheet")
    assert "  " not in model.removesuffix("  # of the data sheet")
    assert all(part.startswith(" ") for part in model.split(",")[1:])
