"""The SocketCAN tests have the devices that they are promised."""

from __future__ import annotations

import socket
import struct

import pytest

FRAME = struct.Struct("=IB3x8s")  # struct can_frame: id, length, data


@pytest.mark.vcan
@pytest.mark.parametrize("device", ["vcan0", "vcan1"])
def test_a_frame_crosses_the_device(device: str) -> None:
    with (
        socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as sender,
        socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as receiver,
    ):
        receiver.settimeout(2.0)
        sender.bind((device,))
        receiver.bind((device,))
        sender.send(FRAME.pack(0x123, 3, b"abc"))
        can_id, length, data = FRAME.unpack(receiver.recv(FRAME.size))
    assert (can_id, data[:length]) == (0x123, b"abc")
