"""The kinds of bus that python-can knows."""

import can.interfaces


def interface_names() -> tuple[str, ...]:
    """What may stand as the interface of a bus."""
    return tuple(sorted(can.interfaces.VALID_INTERFACES))
