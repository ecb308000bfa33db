"""Commissions the axes of a robot in parallel, each in a process that reports its progress."""

from __future__ import annotations

import os
import signal
import threading
import time
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from multiprocessing import connection, get_context, parent_process
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import NamedTuple

from service.commands.command_line.freed_memory import return_freed_memory
from service.commands.commissioning.axis.axis_commissioning import commission_axis
from service.commands.commissioning.axis.axis_job import AxisJob
from service.commands.commissioning.axis.free_memory import free_memory
from service.commands.commissioning.signals.signal_proposals import Review
from service.reports.commissioning_report import Outcome

_POLL_S = 0.2
"""Shortest time between two reports of a process [s]"""


class AxisStep(NamedTuple):
    """Progress of the commissioning of an axis."""

    axis_id: str
    phase: str
    """identify or calibrate"""
    work: str
    share: float
    """Completed share of the work, 0 to 1"""


def outcomes(
    jobs: Sequence[AxisJob],
    reviews: Mapping[str, Review],
    show: Callable[[AxisStep], None],
) -> Iterator[Outcome]:
    """The outcome of each axis as soon as it is known; ``show`` is called with the steps in between.

    As many axes are worked on at once as there are processors, and as there is memory for.  An axis that needs more
    memory than there is gets a refusal.
    """
    free, fitting, largest = free_memory(), list[AxisJob](), 0
    for job in jobs:
        samples = reviews[job.axis_id].samples
        if free is not None and needed_memory(samples) - _LOADED_BYTES > free:
            yield Outcome(job.axis_id, refusal=_too_long(samples, free))
        else:
            fitting.append(job)
            largest = max(largest, needed_memory(samples))
    workers = min(len(fitting), os.cpu_count() or 1, len(fitting) if free is None else free // max(largest, 1))
    if workers <= 1:  # in this process
        for job in fitting:
            yield _outcome(job, reviews[job.axis_id], show)
        return
    yield from _in_parallel(fitting, reviews, show, workers)


def _in_parallel(
    jobs: Sequence[AxisJob], reviews: Mapping[str, Review], show: Callable[[AxisStep], None], workers: int
) -> Iterator[Outcome]:
    """The outcomes of axes, so many at once, each in a process of its own: if it is killed, the others go on."""
    context = get_context("spawn")  # not forked: this process has threads
    waiting, running = list(jobs), dict[Connection, tuple[str, BaseProcess]]()
    try:
        while waiting or running:
            while waiting and len(running) < workers:
                job = waiting.pop(0)
                receiver, sender = context.Pipe(duplex=False)
                process = context.Process(target=_in_own_process, args=(job, reviews[job.axis_id], sender))
                process.start()
                sender.close()  # so that its end shows when that process ends
                running[receiver] = job.axis_id, process
            ready = connection.wait(list(running))
            for end in [end for end in running if end in ready]:
                axis_id, worker = running[end]
                try:
                    found = end.recv()
                except EOFError:
                    worker.join()
                    found = Outcome(axis_id, refusal=_ended(axis_id, worker.exitcode))
                if isinstance(found, AxisStep):
                    show(found)
                    continue
                del running[end]
                worker.join()
                yield found
    finally:
        # If this process alone was interrupted, the others would run on for minutes.
        for _, worker in running.values():
            worker.terminate()


# --- The memory that an axis takes ------------------------------------------------------------------------------------


_PROGRAM_BYTES, _SAMPLE_BYTES = 500_000_000, 400
"""Memory of a process with few samples, and for each sample of the axis: measured every .2 s, with some room"""
_LOADED_BYTES = 250_000_000
"""Part of it that this process has already, in which an axis is worked on alone"""


def needed_memory(samples: int) -> int:
    """Memory [bytes] that the commissioning of an axis takes at most, by its number of samples."""
    return _PROGRAM_BYTES + _SAMPLE_BYTES * samples


def _too_long(samples: int, free: int) -> str:
    """Why an axis with so many samples is refused, and what would do."""
    fit = 100 * max(free + _LOADED_BYTES - _PROGRAM_BYTES, 0) // _SAMPLE_BYTES // max(samples, 1)
    needed = needed_memory(samples) - _LOADED_BYTES
    return (
        f"not commissioned: its {samples} samples take about {needed / 1e9:.1f} GB of memory, of which"
        f" {free / 1e9:.1f} GB are free, enough for {fit} % of them: end other programs, leave records out, or divide"
        " long files (a file is read as a whole, also for a range in it)"
    )


def _ended(axis_id: str, code: int | None) -> str:
    """Why a process ended without an outcome."""
    by = signal.Signals(-code).name if code is not None and code < 0 else f"exit code {code}"
    why = ", as the system does when memory runs out" if by == "SIGKILL" else ""
    return (
        f"not commissioned: its process was ended by {by}{why}: call the command again for this axis alone, --axis"
        f" {axis_id}, or with fewer records"
    )


def _steps(axis_id: str, show: Callable[[AxisStep], None]) -> Callable[[str, str, float], None]:
    """Pass on the first step of each kind, and then no more than can be read."""
    before, shown_s = ("", ""), 0.0

    def step(phase: str, work: str, share: float) -> None:
        nonlocal before, shown_s
        now_s = time.monotonic()
        if (phase, work) != before or now_s - shown_s >= _POLL_S:
            before, shown_s = (phase, work), now_s
            show(AxisStep(axis_id, phase, work, share))

    return step


# --- In the process of an axis ----------------------------------------------------------------------------------------


def _in_own_process(job: AxisJob, review: Review, sender: Connection) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a terminal sends it to all: the parent ends this process
    end_with_parent()
    return_freed_memory()
    sender.send(_outcome(job, review, sender.send))


def end_with_parent() -> None:
    """End this process when its parent ends: a killed parent cannot end its children."""
    parent = parent_process()
    if parent is not None:
        threading.Thread(target=_end_after, args=(parent,), name="parent", daemon=True).start()


def _end_after(parent: BaseProcess) -> None:
    parent.join()
    os._exit(1)


def _outcome(job: AxisJob, review: Review, show: Callable[[AxisStep], None]) -> Outcome:
    """The outcome of an axis; a file that cannot be written, or an internal error, ends only this axis."""
    try:
        return commission_axis(job, review, _steps(job.axis_id, show))
    except OSError as error:  # such as a full disk
        reason = f"{error.filename or job.folder}: {error.strerror}"
        return Outcome(job.axis_id, refusal=f"not commissioned: {reason}")
    except Exception as error:
        traceback.print_exc()
        reason = f"a fault of the program ({type(error).__name__}: {error}), please report it"
        return Outcome(job.axis_id, refusal=f"not commissioned: {reason}", fault=True)
