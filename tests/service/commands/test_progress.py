"""Progress of several axes: bars on a terminal, else a line where one enters a phase; work beside the caller's."""

import sys
from collections.abc import Callable
from io import StringIO
from threading import Event

import pytest

from service.commands.command_line import progress
from service.commands.command_line.progress import Background, announced, axes_bars
from tests.end_to_end.processes import PATIENCE_S

pytestmark = pytest.mark.usefixtures("without_pictures")

STEPS = (
    ("cell.a1", "identify", "fit", 0.2),
    ("cell.a1", "identify", "validation", 0.9),
    ("cell.a1", "calibrate", "faults", 0.43),
)


def shown() -> None:
    with axes_bars(["cell.a1", "cell.a2"]) as bars:
        for step in STEPS:
            bars.show(*step)
        bars.end("cell.a1")


def test_without_a_terminal_there_is_a_line_for_each_phase(capsys: pytest.CaptureFixture[str]) -> None:
    shown()
    out, err = capsys.readouterr()
    assert (out, err.splitlines()) == ("", ["cell.a1: identify ...", "cell.a1: calibrate ..."])


def test_on_a_terminal_there_is_a_bar_for_each_axis(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("COLUMNS", "100")
    with axes_bars(["cell.a1", "cell.a2"]) as bars:
        bars.show(*STEPS[-1])
    err = capsys.readouterr().err
    for words in ("cell.a1: calibrate: faults", "43%", "cell.a2: waits", "0%"):
        assert words in err
    assert "..." not in err


class _Noticed(StringIO):
    """An error stream that says when something is written."""

    def __init__(self) -> None:
        super().__init__()
        self.event = Event()

    def write(self, text: str) -> int:
        self.event.set()
        return super().write(text)


def test_what_takes_a_while_is_announced(monkeypatch: pytest.MonkeyPatch) -> None:
    stream = _Noticed()
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.setattr(progress, "SOON_S", 30.0)
    assert announced("compiling", lambda: 7) == 7
    assert stream.getvalue() == ""
    monkeypatch.setattr(progress, "SOON_S", 0.0)
    assert announced("compiling", lambda: stream.event.wait(30)) is True  # it ends when the line is there
    assert stream.getvalue() == "compiling ...\n"


# --- work beside the caller's -------------------------------------------------------------------------------


def test_what_came_of_it_and_how_far_it_was() -> None:
    seen, reported = Event(), list[float]()

    def work(tell: Callable[[float], None]) -> int:
        tell(0.5)
        assert seen.wait(PATIENCE_S)
        return 7

    def progress(part: float) -> None:
        reported.append(part)
        if part == 0.5:
            seen.set()

    with Background(work) as beside:
        assert beside(progress) == 7
    assert reported[-1] == 0.5


def test_what_it_raises_is_raised() -> None:
    def work(_: object) -> None:
        raise ValueError("nothing was tested")

    with Background(work) as beside, pytest.raises(ValueError, match="nothing was tested"):
        beside(lambda _: None)


def test_it_ends_when_the_caller_fails() -> None:
    begun, ended = Event(), Event()

    def work(tell: Callable[[float], None]) -> None:
        try:
            while True:
                tell(0.1)
                begun.set()
        finally:
            ended.set()

    def call() -> None:
        with Background(work):
            assert begun.wait(PATIENCE_S)
            raise KeyError("the caller's")

    with pytest.raises(KeyError, match="the caller's"):
        call()
    assert ended.is_set()
