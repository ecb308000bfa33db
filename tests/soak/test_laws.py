"""Every law that hypothesis looks for exceptions to, with many more examples; elimination with longer drives."""

import importlib
import inspect
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, is_hypothesis_test, settings

from tests.conftest import ROOT
from tests.core.modeling import test_elimination_laws as elimination
from tests.core.modeling.random_drives import drives

pytestmark = pytest.mark.soak

TIMES = 40
"""As many examples as in `make test`, and each time others."""


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
    for _ in range(TIMES):
        LAWS[name]()


def test_there_are_laws_and_each_run_of_them_differs() -> None:
    repeats = settings.get_current_profile_name() == "ci"
    assert not repeats, "CI=true lets hypothesis repeat the same examples: unset it"
    assert len(LAWS) >= 5


MANY = settings(
    deadline=None, max_examples=1000, suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large]
)


def test_elimination_of_longer_drives() -> None:
    """Of up to nine masses, 1000 examples."""
    law = elimination.test_a_reduced_drive_is_the_unreduced_one_exactly_and_minimal
    same = law.hypothesis.inner_test  # type: ignore[attr-defined]
    MANY(given(drive=drives(most=9), points=elimination.POINTS)(same))()
