"""Every law that hypothesis looks for exceptions to, with 2000 examples or more."""

from __future__ import annotations

import importlib
import inspect
import math
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from hypothesis import is_hypothesis_test, settings

pytestmark = pytest.mark.soak

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = 2000
LEAST_EACH = 80
"""Examples of a law in one run (the fewest of all)."""


def laws() -> Iterator[tuple[str, Callable[[], None]]]:
    """All tests of hypothesis that need no fixture."""
    for file in sorted((ROOT / "tests").rglob("test_*.py")):
        if "@given" not in file.read_text(encoding="utf-8") or file == Path(__file__):
            continue
        module = importlib.import_module(".".join(file.relative_to(ROOT).with_suffix("").parts))
        for name, test in inspect.getmembers(module, is_hypothesis_test):
            if not inspect.signature(test).parameters:
                yield f"{file.stem}-{name.removeprefix('test_')}", test


LAWS = dict(laws())


@pytest.mark.parametrize("name", LAWS)
def test_law(name: str) -> None:
    for _ in range(math.ceil(EXAMPLES / LEAST_EACH)):
        LAWS[name]()


def test_there_are_laws_and_each_run_of_them_differs() -> None:
    repeats = settings.get_current_profile_name() == "ci"
    assert not repeats, "CI=true lets hypothesis repeat the same examples: unset it"
    assert len(LAWS) >= 5
