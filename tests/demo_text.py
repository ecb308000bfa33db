"""The robot of the demo with all keys in its axes, for tests that change some of them."""

from pathlib import Path

_ONE = (Path(__file__).parent / "demo_axis.toml").read_text(encoding="utf-8")


def demo_text(axes: int = 1) -> str:
    """The configuration of the first axes of the demo."""
    head, axis = _ONE.split("[[robot.axis]]\n")
    numbered = (axis.replace("axis1", f"axis{n}").replace("Axis1", f"Axis{n}") for n in range(1, 1 + axes))
    return head + "\n".join(f"[[robot.axis]]\n{text}" for text in numbered)
