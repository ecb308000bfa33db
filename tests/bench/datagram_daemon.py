"""The program, where SocketCAN's reader reads datagrams of a port of this machine: `... datagram_daemon PORT run ...`.

Each has the bytes of a frame as the kernel gives it.  So all of the daemon can be measured where there is no CAN.
"""

import socket
import sys
from typing import Any

from service.can import bus_reader
from service.can.socket_receivers import SocketReceiver
from service.commands.main import main


class _Datagrams:
    def __init__(self, port: int) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", port))

    def fileno(self) -> int:
        return self._socket.fileno()

    def shutdown(self) -> None:
        self._socket.close()


def read_datagrams(port: int) -> None:
    """Let every bus be that port."""

    def opened(*_: Any) -> Any:
        return _Datagrams(port)

    for name, value in (("open_bus", opened), ("receiver_of", SocketReceiver)):
        setattr(bus_reader, name, value)


if __name__ == "__main__":
    read_datagrams(int(sys.argv.pop(1)))
    main()
