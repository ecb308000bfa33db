"""Opens buses of any interface that python-can supports, and sends frames."""

import errno
import re
import socket
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, Protocol

import can
import can.interfaces
from can.typechecking import CanFilter

from monitor_core.wording import did_you_mean, sentence
from service.can.frames import ID_BITS, STANDARD_BITS, FrameFilter, FrameKey
from service.can.user_errors import BusError

Bus = can.BusABC
"""An open bus of any interface."""


class BusSettings(Protocol):
    """Settings to open a bus; [[bus]] of the configuration provides them."""

    @property
    def name(self) -> str:
        """Name by which axes refer to the bus."""

    @property
    def interface(self) -> str:
        """Interface by the names of python-can."""

    @property
    def channel(self) -> str:
        """Channel of that interface."""

    @property
    def queue_frames(self) -> int:
        """Most frames that wait for the worker."""

    @property
    def options(self) -> Mapping[str, Any]:
        """Further options for python-can."""


_WITHOUT_ADAPTER = ("virtual", "udp_multicast")
"""Interfaces without a CAN adapter."""
FD_INTERFACES = ("socketcan", *_WITHOUT_ADAPTER)
"""Interfaces that receive CAN FD frames without further options"""
_LAST_NUMBER = re.compile(r"(?<!\d)\d{1,4}$")
_VIRTUAL_DEVICE = re.compile(r"vx?can\d*")
_ARPHRD_CAN = "280"
"""Device type of CAN interfaces in Linux"""
_SEND_TIMEOUT_S = 1.0


def open_bus(config: BusSettings, wanted: Iterable[FrameFilter] | None = None) -> Bus:
    """Open a bus.

    ``wanted``: filters of the frames to receive, applied in the kernel if the interface supports that; None: all
    frames.  SocketCAN also receives CAN FD frames, unless the options say otherwise; other interfaces need bit rates
    for that.

    Raises:
        BusError: the bus cannot be opened; the text says what to do.
    """
    defaults = {"fd": True} if config.interface == "socketcan" else {}
    options: dict[str, Any] = {
        **defaults,
        **config.options,
        "interface": config.interface,
        "channel": config.channel,
    }
    if wanted is not None:
        options["can_filters"] = [_filter(entry) for entry in wanted]
    try:
        # Check first: python-can leaves its socket open if there is no device.
        if config.interface == "socketcan" and all(device != config.channel for _, device in socket.if_nameindex()):
            raise OSError(errno.ENODEV, "no such device")
        opened = can.Bus(ignore_config=True, **options)
    except (can.CanInterfaceNotImplementedError, NotImplementedError) as error:
        words = "cannot use interface {interface} here: {why}"
        raise _bus_error(config, sentence("no interface", words, interface=config.interface, why=error)) from None
    except OSError as error:
        raise _bus_error(config, _refused(config, error)) from None
    except (can.CanError, ValueError, TypeError) as error:
        # The operating system's error says more than that of python-can.
        why = f"{error} ({error.__cause__})" if error.__cause__ else str(error)
        raise _bus_error(config, _cannot_open(config, why)) from None
    if opened.channel_info == can.BusABC.channel_info:  # some interfaces leave it at "unknown"
        opened.channel_info = f"{config.interface} {config.channel}"
    return opened


def can_devices(devices: Path = Path("/sys/class/net")) -> list[str]:
    """Names of the CAN network interfaces of this machine."""
    kinds = sorted(devices.glob("*/type"))
    return [kind.parent.name for kind in kinds if kind.read_text(encoding="ascii").strip() == _ARPHRD_CAN]


def channel_number(channel: str) -> int | None:
    """The number (up to four digits) at the end of a channel; log formats without names identify the channel by it."""
    found = _LAST_NUMBER.search(channel)
    return None if found is None else int(found[0])


def blf_channels(buses: Sequence[BusSettings]) -> dict[str, int] | None:
    """Channel numbers, from 0 on, for log formats without bus names; None: two buses would have the same number."""
    if len(buses) == 1:
        return {buses[0].name: 0}
    found = {bus.name: number for bus in buses if (number := channel_number(bus.channel)) is not None}
    return found if len(set(found.values())) == len(buses) else None


def reaches_hardware(config: BusSettings, devices: Path = Path("/sys/class/net")) -> bool:
    """Whether frames sent on a bus may reach a drive: true unless the bus is known to be virtual.

    ``devices``: the folder in which Linux describes its network interfaces.
    """
    if config.interface != "socketcan":
        return config.interface not in _WITHOUT_ADAPTER
    # The name decides, too, as serial adapters have no device in that folder either.
    named_virtual = _VIRTUAL_DEVICE.fullmatch(config.channel) is not None
    return not named_virtual or (devices / config.channel / "device").exists()


@contextmanager
def open_buses(configs: Iterable[BusSettings]) -> Iterator[dict[str, Bus]]:
    """Open buses for sending, by name; they are closed at the end of the ``with`` block.

    Raises:
        BusError: a bus cannot be opened.
    """
    with ExitStack() as stack:
        buses = {}
        for config in configs:
            buses[config.name] = opened = open_bus(config, ())
            stack.callback(opened.shutdown)
        yield buses


def send(bus: Bus, key: FrameKey, data: bytes, at_s: float = 0.0) -> None:
    """Send a frame; it is a CAN FD frame if it is longer than 8 bytes.

    ``at_s``: time stamp since 1970, kept by virtual buses inside the process; other buses ignore it.

    Raises:
        BusError: the bus refuses the frame.
    """
    message = can.Message(
        arbitration_id=key.can_id,
        is_extended_id=key.extended,
        data=data,
        is_fd=len(data) > 8,
        bitrate_switch=len(data) > 8,
        timestamp=at_s,
    )
    end = time.monotonic() + _SEND_TIMEOUT_S
    while True:
        try:
            bus.send(message, timeout=_SEND_TIMEOUT_S)
            return
        except (can.CanError, OSError) as error:
            if getattr(error, "error_code", None) != errno.ENOBUFS or time.monotonic() > end:
                why = str(error) or f"no frame was accepted for {_SEND_TIMEOUT_S:g} s"
                raise BusError(f"cannot send on {bus.channel_info}: {why}") from None
        time.sleep(0.001)  # the transmit queue is full; poll does not report that


def _filter(wanted: FrameFilter) -> CanFilter:
    key = wanted.key
    mask = wanted.mask & (ID_BITS if key.extended else STANDARD_BITS)
    return {"can_id": key.can_id & mask, "can_mask": mask, "extended": key.extended}


def _bus_error(config: BusSettings, why: str) -> BusError:
    return BusError(sentence("of bus", "bus {bus}: {why}", bus=config.name, why=why), why)


def _refused(config: BusSettings, error: OSError) -> str:
    code = error.errno if config.interface == "socketcan" else None
    if code == errno.ENODEV:
        there = can_devices()
        return sentence(
            "no device",
            "there is no network interface {channel}: {hint}connect the adapter, or for a virtual one run"
            " `ip link add dev {channel} type vcan && ip link set {channel} up`",
            channel=config.channel,
            hint=did_you_mean(config.channel, there) + "; " if there else "",
        )
    if code == errno.EAFNOSUPPORT:
        return _cannot_open(config, sentence("no CAN", "this kernel has no CAN (modprobe can-raw)"))
    return _cannot_open(config, error.strerror or str(error))


def _cannot_open(config: BusSettings, why: str) -> str:
    where = f"{config.interface} {config.channel}"
    return sentence("cannot open", "cannot open {where}: {why}", where=where, why=why)


def interface_names() -> tuple[str, ...]:
    """The interfaces that python-can knows."""
    return tuple(sorted(can.interfaces.VALID_INTERFACES))
