"""Two hundred times kill -9 while alarms are recorded and delivered: none is left out, their order is kept."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from tests.conftest import ROOT
from tests.service.links.journals import Inbox, Post

pytestmark = pytest.mark.soak
KILLS = int(os.environ.get("AXISWATCH_KILLS", "200"))

RUN = """
import asyncio, sys
from pathlib import Path
from tests.service.links.journals import Inbox, Post, record
class Printed(Inbox):
    async def send(self, messages):
        print(*(m.id.rpartition("-")[2] for m in messages), flush=True)
post = Post(Path(sys.argv[1]), Printed())
print("ready", flush=True)
while True:
    record(post.journal, axis=f"demo.{post.journal.last_transition()}")
    post.step()
"""


def test_nothing_is_left_out(tmp_path: Path, seed: int) -> None:
    rng, seen = np.random.default_rng(seed), list[int]()
    Post(tmp_path, Inbox()).close()  # the link is not new then
    for _ in range(KILLS):
        command = [sys.executable, "-c", RUN, str(tmp_path)]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ROOT) as process:
            assert process.stdout is not None
            assert process.stdout.readline() == "ready\n"
            time.sleep(rng.uniform(0, 0.1))
            os.kill(process.pid, signal.SIGKILL)
            lines = process.stdout.read().split("\n")
        seen += [int(line) for line in lines if line]
    post = Post(tmp_path, Inbox())
    post.settle()
    seen += [int(m.id.rpartition("-")[2]) for m in post.inbox.got]
    last = post.journal.last_transition()
    post.close()
    assert last > KILLS
    assert set(seen) == set(range(1, last + 1))
    assert list(dict.fromkeys(seen)) == sorted(set(seen))
    assert len(seen) - last <= KILLS  # at each kill the one that was under way may come again
