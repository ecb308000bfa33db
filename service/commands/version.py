"""``axiswatch version``: prints the version."""

from importlib.metadata import version as installed


def version() -> None:
    """Print the version."""
    print(f"axiswatch {installed('axiswatch')}")
