"""Corrections as a reader sees them."""

from service.config.written.corrections import Correction, changes_in


def test_the_keys_of_a_signal_are_one_change() -> None:
    """With all values, and each further reason once; a change of a single key is that of the key."""
    links, gear = "the links couple the axis to the motion of a1", "the gear ratio"
    corrections = [
        Correction(("model", "drive"), "one-mass", "the torque shows a weight"),
        Correction(("gate", "closed", "below"), 0.5, "a force acts"),
        Correction(("signal", "a1-speed", "axis"), "a1", links),
        Correction(("signal", "a2", "axis"), "a2", "the load follows a2"),
        Correction(("signal", "a1-speed", "speed"), True, links),
        Correction(("gate", "closed", "settle_s"), 0.1, "then it has gone"),
        Correction(("signal", "a1-speed", "factor"), 0.01, gear),
        Correction(("signal", "a3", "axis"), "a3", "the load follows a3"),
        Correction(("signal", "a3", "factor"), 0.02, gear),
        Correction(("model", "nominal", "r"), 0.01, gear),
    ]
    assert [(change.written, change.reason) for change in changes_in(corrections)] == [
        ('model.drive = "one-mass"', "the torque shows a weight"),
        ("gate.closed = { below = 0.5, settle_s = 0.1 }", "a force acts; settle_s: then it has gone"),
        ('signal.a1-speed = { axis = "a1", speed = true, factor = 0.01 }', f"{links}; factor: {gear}"),
        ('signal.a2.axis = "a2"', "the load follows a2"),
        ('signal.a3 = { axis = "a3", factor = 0.02 }', "the load follows a3"),
        ("model.nominal.r = 0.01", gear),
    ]
    assert not changes_in(())
