"""One drive in four formats and as a table of ids: two messages, one with an extended id and in big endian."""

from __future__ import annotations

from typing import Any, NamedTuple


class Bits(NamedTuple):
    """A signal; ``start``: the first bit, of big endian the highest, as a DBC counts it."""

    name: str
    start: int
    length: int
    factor: float
    unit: str
    signed: bool = True
    big: bool = False

    @property
    def counted(self) -> int:
        """The first bit as KCD and SYM count it: in big endian from the highest one of the first byte."""
        return 8 * (self.start // 8) + 7 - self.start % 8 if self.big else self.start


class Frame(NamedTuple):
    name: str
    can_id: int
    extended: bool
    length: int
    signals: tuple[Bits, ...]


FRAMES = (
    Frame("Drive", 0x181, False, 4, (Bits("Torque", 0, 16, 0.0625, "Nm"), Bits("Count", 16, 8, 1, "", False))),
    Frame("Motion", 0x18FF0200, True, 8, (Bits("Angle", 15, 32, 0.0009765625, "rad", big=True),)),
)


def dbc() -> str:
    text = 'VERSION ""\n\nBU_: D\n'
    for f in FRAMES:
        text += f"\nBO_ {f.can_id | f.extended << 31} {f.name}: {f.length} D\n"
        for s in f.signals:
            kind = f"{0 if s.big else 1}{'-' if s.signed else '+'}"
            text += f' SG_ {s.name} : {s.start}|{s.length}@{kind} ({s.factor},0) [0|0] "{s.unit}" D\n'
    return text


def table() -> list[dict[str, Any]]:
    """The messages of the drive, as a configuration has them."""
    return [
        {
            "name": f.name,
            "id": f.can_id,
            "signal": [
                {
                    "name": s.name,
                    "start_bit": s.start,
                    "length": s.length,
                    "kind": "signed" if s.signed else "unsigned",
                    "byte_order": "big" if s.big else "little",
                    "factor": float(s.factor),
                }
                for s in f.signals
            ],
        }
        for f in FRAMES
    ]


def kcd() -> str:
    text = '<NetworkDefinition xmlns="http://kayak.2codeornot2code.org/1.0">\n<Document/>\n<Bus name="can0">\n'
    for f in FRAMES:
        form = ' format="extended"' if f.extended else ""
        text += f'<Message id="{f.can_id:#x}" name="{f.name}" length="{f.length}"{form}>\n'
        for s in f.signals:
            order = ' endianess="big"' if s.big else ""
            kind = "signed" if s.signed else "unsigned"
            text += f'<Signal name="{s.name}" offset="{s.counted}" length="{s.length}"{order}>'
            text += f'<Value type="{kind}" slope="{s.factor}" unit="{s.unit}"/></Signal>\n'
        text += "</Message>\n"
    return f"{text}</Bus>\n</NetworkDefinition>\n"


def sym() -> str:
    text = 'FormatVersion=6.0 // Do not edit this line!\nTitle="drive"\n\n{SENDRECEIVE}\n'
    for f in FRAMES:
        kind = "Type=Extended\n" if f.extended else ""
        digits = 8 if f.extended else 3
        text += f"\n[{f.name}]\nID={f.can_id:0{digits}X}h\n{kind}Len={f.length}\n"
        for s in f.signals:
            unit = f" /u:{s.unit}" if s.unit else ""
            text += f"Var={s.name} {'' if s.signed else 'un'}signed {s.counted},{s.length}"
            text += f"{' -m' if s.big else ''}{unit} /f:{s.factor}\n"
    return text


def arxml() -> str:
    parts, triggers = list[str](), list[str]()
    for f in FRAMES:
        mode = "EXTENDED" if f.extended else "STANDARD"
        triggers.append(
            _tag(
                "CAN-FRAME-TRIGGERING",
                _name(f"T{f.name}"),
                f'<FRAME-REF DEST="CAN-FRAME">/P/{f.name}</FRAME-REF>',
                _tag("CAN-ADDRESSING-MODE", mode),
                _tag("IDENTIFIER", str(f.can_id)),
            )
        )
        mapping = _tag(
            "PDU-TO-FRAME-MAPPING",
            _name("M"),
            _tag("PACKING-BYTE-ORDER", "MOST-SIGNIFICANT-BYTE-LAST"),
            f'<PDU-REF DEST="I-SIGNAL-I-PDU">/P/Pdu{f.name}</PDU-REF>',
            _tag("START-POSITION", "0"),
        )
        length, frame_length = _tag("LENGTH", str(f.length)), _tag("FRAME-LENGTH", str(f.length))
        parts.append(_tag("CAN-FRAME", _name(f.name), frame_length, _tag("PDU-TO-FRAME-MAPPINGS", mapping)))
        signals = _tag("I-SIGNAL-TO-PDU-MAPPINGS", *map(_mapping, f.signals))
        parts.append(_tag("I-SIGNAL-I-PDU", _name(f"Pdu{f.name}"), length, signals))
        parts += [element for s in f.signals for element in _signal(s)]
    channel = _tag("CAN-PHYSICAL-CHANNEL", _name("C"), _tag("FRAME-TRIGGERINGS", *triggers))
    variants = _tag("CAN-CLUSTER-CONDITIONAL", _tag("PHYSICAL-CHANNELS", channel))
    cluster = _tag("CAN-CLUSTER", _name("Cluster"), _tag("CAN-CLUSTER-VARIANTS", variants))
    package = _tag("AR-PACKAGE", _name("P"), _tag("ELEMENTS", cluster, *parts))
    head = '<?xml version="1.0" encoding="UTF-8"?>\n<AUTOSAR xmlns="http://autosar.org/schema/r4.0">'
    return f"{head}{_tag('AR-PACKAGES', package)}</AUTOSAR>\n"


def _mapping(s: Bits) -> str:
    order = "FIRST" if s.big else "LAST"
    return _tag(
        "I-SIGNAL-TO-I-PDU-MAPPING",
        _name(f"M{s.name}"),
        f'<I-SIGNAL-REF DEST="I-SIGNAL">/P/{s.name}</I-SIGNAL-REF>',
        _tag("PACKING-BYTE-ORDER", f"MOST-SIGNIFICANT-BYTE-{order}"),
        _tag("START-POSITION", str(s.start)),
    )


def _signal(s: Bits) -> list[str]:
    """The signal, what it means, its scale, its unit and its kind of number."""

    def properties(*refs: str) -> str:
        return _tag("SW-DATA-DEF-PROPS-VARIANTS", _tag("SW-DATA-DEF-PROPS-CONDITIONAL", *refs))

    base = f'<BASE-TYPE-REF DEST="SW-BASE-TYPE">/P/Base{s.name}</BASE-TYPE-REF>'
    method = f'<COMPU-METHOD-REF DEST="COMPU-METHOD">/P/Scale{s.name}</COMPU-METHOD-REF>'
    unit = f'<UNIT-REF DEST="UNIT">/P/Unit{s.name}</UNIT-REF>'
    scale = _tag(
        "COMPU-SCALE",
        _tag(
            "COMPU-RATIONAL-COEFFS",
            _tag("COMPU-NUMERATOR", _tag("V", "0"), _tag("V", str(s.factor))),
            _tag("COMPU-DENOMINATOR", _tag("V", "1")),
        ),
    )
    return [
        _tag(
            "I-SIGNAL",
            _name(s.name),
            _tag("LENGTH", str(s.length)),
            _tag("NETWORK-REPRESENTATION-PROPS", properties(base)),
            f'<SYSTEM-SIGNAL-REF DEST="SYSTEM-SIGNAL">/P/Sys{s.name}</SYSTEM-SIGNAL-REF>',
        ),
        _tag("SYSTEM-SIGNAL", _name(f"Sys{s.name}"), _tag("PHYSICAL-PROPS", properties(method, unit))),
        _tag(
            "COMPU-METHOD",
            _name(f"Scale{s.name}"),
            _tag("CATEGORY", "LINEAR"),
            unit,
            _tag("COMPU-INTERNAL-TO-PHYS", _tag("COMPU-SCALES", scale)),
        ),
        _tag("UNIT", _name(f"Unit{s.name}"), _tag("DISPLAY-NAME", s.unit)),
        _tag(
            "SW-BASE-TYPE",
            _name(f"Base{s.name}"),
            _tag("BASE-TYPE-SIZE", str(s.length)),
            _tag("BASE-TYPE-ENCODING", "2C" if s.signed else "NONE"),
        ),
    ]


def _tag(name: str, *content: str) -> str:
    return f"<{name}>{''.join(content)}</{name}>"


def _name(name: str) -> str:
    return _tag("SHORT-NAME", name)


TEXTS = {"a.dbc": dbc, "a.kcd": kcd, "a.sym": sym, "a.arxml": arxml}
