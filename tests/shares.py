"""Which variants of a test each run of ``make test`` has, and which are left to ``make soak``."""

from collections.abc import Iterable
from typing import Any, TypeVar

import pytest

T = TypeVar("T")


def soaked(values: Iterable[T], *tested: T) -> list[Any]:
    """Values to parametrize a test by: with those ``tested`` it runs in `make test`, with the others in `make soak`.

    Raises:
        AssertionError: one that is to be tested is not among them.
    """
    found = list(values)
    assert all(value in found for value in tested), tested
    return [v if v in tested else pytest.param(*_arguments(v), marks=pytest.mark.soak) for v in found]


def _arguments(value: object) -> tuple[object, ...]:
    return value if isinstance(value, tuple) else (value,)
