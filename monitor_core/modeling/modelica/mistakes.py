"""Errors in a user's text that name the component."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

from monitor_core.modeling.flat import ModelError


@contextmanager
def about(component: str) -> Iterator[None]:
    """An error from inside that does not say which component it is about, is about this one."""
    try:
        yield
    except ModelError as error:
        if error.origin.component or not component:
            raise
        raise ModelError(error.problem, replace(error.origin, component=component)) from None
