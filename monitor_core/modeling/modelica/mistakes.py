"""Errors in a user's text that name the component."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

from monitor_core.modeling.flat import ModelError


@contextmanager
def about(component: str) -> Iterator[None]:
    """An error from inside that names no component, or one that this one is in, is about this one."""
    try:
        yield
    except ModelError as error:
        named = error.origin.component
        if named and not component.startswith(f"{named}."):
            raise
        raise ModelError(error.problem, replace(error.origin, component=component)) from None
