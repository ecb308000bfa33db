"""Commissions the axes of a robot in parallel, each in a process that reports its progress."""

from __future__ import annotations

import os
import threading
import time
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import SimpleQueue, active_children, get_context, parent_process
from multiprocessing.process import BaseProcess
from typing import NamedTuple

from service.commands.commissioning.axis.axis_commissioning import commission_axis
from service.commands.commissioning.axis.axis_job import AxisJob
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
    """The outcome of each axis as soon as it is known; ``show`` is called with the steps in between."""
    workers = min(len(jobs), os.cpu_count() or 1)
    if workers == 1:
        for job in jobs:
            yield _outcome(job, reviews[job.axis_id], show)
        return
    context = get_context("spawn")  # not forked: this process has threads
    steps: SimpleQueue[AxisStep] = context.SimpleQueue()
    with ProcessPoolExecutor(workers, context, initializer=_connect, initargs=(steps,)) as pool:
        axes = {pool.submit(_in_own_process, job, reviews[job.axis_id]): job.axis_id for job in jobs}
        waiting = set(axes)
        try:
            while waiting:
                done, waiting = wait(waiting, _POLL_S, FIRST_COMPLETED)
                while not steps.empty():
                    show(steps.get())
                yield from (_result(task, axes[task]) for task in done)
        except BaseException:
            # If only this process was interrupted, the axis processes would run on for minutes, and it would wait for
            # them.
            pool.shutdown(wait=False, cancel_futures=True)
            for child in active_children():
                child.terminate()
            raise


def _result(task: Future[Outcome], axis_id: str) -> Outcome:
    try:
        return task.result()
    except BrokenProcessPool:
        # The other processes end, too; finished work is kept for the next call.
        reason = "a process of it was ended, perhaps because memory ran out: call the command again"
        return Outcome(axis_id, refusal=f"not commissioned: {reason}")


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


_queues: list[SimpleQueue[AxisStep]] = []
"""Queue to the process that shows the steps"""


def _connect(steps: SimpleQueue[AxisStep]) -> None:
    end_with_parent()
    _queues.append(steps)


def end_with_parent() -> None:
    """End this process when its parent ends: a killed parent cannot end its children."""
    parent = parent_process()
    if parent is not None:
        threading.Thread(target=_end_after, args=(parent,), name="parent", daemon=True).start()


def _end_after(parent: BaseProcess) -> None:
    parent.join()
    os._exit(1)


def _in_own_process(job: AxisJob, review: Review) -> Outcome:
    return _outcome(job, review, _queues[0].put)


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
