"""Files that others read while they are written."""

import os
import tempfile
from pathlib import Path


def replace_text(path: Path, text: str) -> None:
    """Write the whole text or nothing: whoever reads the file sees the old or the new one, never a part.

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
    """What new files may not have; it can only be read by setting it."""
    mask = os.umask(0o022)
    os.umask(mask)
    return mask
