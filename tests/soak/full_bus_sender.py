"""Sends frames on a SocketCAN device, or to a port of this machine as datagrams, many with one system call.

`python -m tests.soak.full_bus_sender CHANNEL SECONDS FILE`

Each line of the file is the time of a frame, s, and its record in hexadecimal digits.  All are sent, again and again
until so many seconds have passed; then it prints how many there were, how long it took, and how late the latest was, s.
"""

import ctypes
import errno
import os
import socket
import sys
import time
from pathlib import Path

import numpy as np

from service.can.socket_receivers import IoVec, MMsgHdr

MOST = 64
"""Frames that are sent with one call"""
RECORD = 16
"""Bytes of a classic frame"""
NAP_S = 0.002


def opened(channel: str) -> socket.socket:
    """A socket for that device, or, of a number, to that port."""
    if channel.isdecimal():
        datagrams = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        datagrams.connect(("127.0.0.1", int(channel)))
        return datagrams
    raw = socket.socket(socket.PF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
    raw.bind((channel,))
    raw.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FILTER, b"")  # it hears nothing
    return raw


def send_all(channel: str, seconds: float, path: Path) -> None:
    """Send what is in the file, and print the result."""
    rows = [line.split() for line in path.read_text(encoding="ascii").splitlines()]
    due_s = np.array([float(due) for due, _ in rows])
    records = ctypes.create_string_buffer(b"".join(bytes.fromhex(record) for _, record in rows))
    vectors, headers = (IoVec * len(rows))(), (MMsgHdr * len(rows))()
    for k, (vector, header) in enumerate(zip(vectors, headers, strict=True)):
        vector.base, vector.length = ctypes.addressof(records) + RECORD * k, RECORD
        header.header.vectors, header.header.vectors_length = ctypes.pointer(vector), 1
    sendmmsg = ctypes.CDLL(None, use_errno=True).sendmmsg
    start, sent, late_s, going = time.monotonic(), 0, 0.0, True
    with opened(channel) as raw:
        begin_s = start
        while going:
            done = 0
            while done < len(rows):
                passed_s = time.monotonic() - begin_s
                ready = min(int(np.searchsorted(due_s, passed_s, "right")), done + MOST)
                if ready <= done:
                    time.sleep(NAP_S)
                    continue
                late_s = max(late_s, passed_s - due_s[done] if due_s[-1] else 0.0)
                count = sendmmsg(raw.fileno(), ctypes.byref(headers[done]), ready - done, 0)
                if count < 0 and ctypes.get_errno() == errno.ECONNREFUSED:
                    count = ready - done  # nobody listens to this port yet: they are lost, as on a bus
                elif count < 0 and ctypes.get_errno() != errno.ENOBUFS:
                    raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
                done += max(0, count)
            sent += done
            begin_s += float(due_s[-1]) * len(rows) / (len(rows) - 1)
            going = time.monotonic() - start < seconds
    print(sent, time.monotonic() - start, late_s)


if __name__ == "__main__":
    send_all(sys.argv[1], float(sys.argv[2]), Path(sys.argv[3]))
