"""Arrays as bytes and back: the npz format of numpy, without pickles, so that reading cannot execute code."""

import io
import zipfile
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

Arrays = dict[str, NDArray[np.generic]]


class UnreadableError(ValueError):
    """The bytes are not arrays that ``pack`` wrote."""


def pack(arrays: Mapping[str, NDArray[np.generic]]) -> bytes:
    """The arrays as the bytes of an .npz file; equal arrays give equal bytes.

    Raises:
        ValueError: an array holds Python objects.
    """
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_STORED) as archive:
        for name in sorted(arrays):
            with archive.open(zipfile.ZipInfo(f"{name}.npy"), "w") as member:
                np.lib.format.write_array(member, np.asarray(arrays[name]), allow_pickle=False)
    return buffer.getvalue()


def unpack(data: bytes) -> Arrays:
    """The arrays that ``pack`` packed.

    Raises:
        UnreadableError: the bytes are damaged, or hold pickles.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            return {name.removesuffix(".npy"): _read(archive, name) for name in archive.namelist()}
    except (ValueError, EOFError, OSError, NotImplementedError, RuntimeError, zipfile.BadZipFile) as error:
        raise UnreadableError(str(error)) from error


def _read(archive: zipfile.ZipFile, name: str) -> NDArray[np.generic]:
    with archive.open(name) as member:
        array: NDArray[np.generic] = np.lib.format.read_array(member, allow_pickle=False)
        return array
