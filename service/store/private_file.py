"""Replacing a file that only its owner may read: a reader sees the old or the new one, never a part."""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO


@contextmanager
def replacing(target: Path) -> Iterator[IO[bytes]]:
    """A new file of mode 0600 that takes the place of ``target`` when the block ends; if it raises, nothing changes.

    Until then its name begins with a dot, so that no backup of the folder contains it.

    Raises:
        OSError: it cannot be written.
    """
    number, part = tempfile.mkstemp(prefix=f".{target.name}.", dir=target.parent)
    try:
        with os.fdopen(number, "wb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        os.replace(part, target)
    except BaseException:
        os.unlink(part)
        raise
