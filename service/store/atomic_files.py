"""Atomic writing of files that others read."""

import os
import tempfile
from pathlib import Path


def replace_text(path: Path, text: str) -> None:
    """Write the whole text or nothing: a reader sees the old or the new file, never a part.

    Raises:
        OSError: it cannot be written.
    """
    target = path.resolve()  # of a link, what it points to
    mode = target.stat().st_mode & 0o777 if target.exists() else 0o666 & ~_umask()
    handle, name = tempfile.mkstemp(prefix=f".{target.name}.", dir=target.parent)
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        os.chmod(name, mode)
        os.replace(name, target)
    except BaseException:
        os.unlink(name)
        raise


def _umask() -> int:
    """Permissions that new files must not have; they can only be read by setting them."""
    mask = os.umask(0o022)
    os.umask(mask)
    return mask
