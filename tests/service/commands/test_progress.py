"""Work beside the caller's: what comes of it, how far it is, and that it ends when the caller fails."""

import threading
from collections.abc import Callable

import pytest

from service.commands.progress import Background


def test_what_came_of_it_and_how_far_it_was() -> None:
    seen, told = threading.Event(), list[float]()

    def work(tell: Callable[[float], None]) -> int:
        tell(0.5)
        assert seen.wait(60)
        return 7

    def progress(part: float) -> None:
        told.append(part)
        if part == 0.5:
            seen.set()

    with Background(work) as beside:
        assert beside.result(progress) == 7
    assert told[-1] == 0.5


def test_what_it_raises_is_raised() -> None:
    def work(_: object) -> None:
        raise ValueError("nothing was tested")

    with Background(work) as beside, pytest.raises(ValueError, match="nothing was tested"):
        beside.result(lambda _: None)


def test_it_ends_when_the_caller_fails() -> None:
    begun, ended = threading.Event(), threading.Event()

    def work(tell: Callable[[float], None]) -> None:
        try:
            while True:
                tell(0.1)
                begun.set()
        finally:
            ended.set()

    def call() -> None:
        with Background(work):
            assert begun.wait(60)
            raise KeyError("the caller's")

    with pytest.raises(KeyError, match="the caller's"):
        call()
    assert ended.is_set()
