"""Files that describe messages as tools write them, and what is said about those that cannot be used."""

import os
import random
from pathlib import Path
from typing import Any

import pytest

from service.can.decoder import Decoder
from service.can.frames import Frame, FrameBlock
from service.can.message_files import read_messages
from service.can.messages import DescriptionError, find_counter, find_signal
from service.ingest.samples.bus_samples import Ingest
from tests.service.drive_descriptions import TEXTS, table
from tests.service.ingest import plant

HEAD = 'VERSION ""\nBU_: X\n'
GOOD = 'BO_ 257 Good: 8 X\n SG_ Value : 0|16@1- (0.1,0) [0|0] "°" X\n SG_ Other : 16|16@1- (1,0) [0|0] "" X\n'
OVERLAP = 'BO_ 258 Overlap: 8 X\n SG_ A : 0|16@1- (1,0) [0|0] "" X\n SG_ B : 8|16@1- (1,0) [0|0] "" X\n'
SHORT = 'BO_ 259 Short: 2 X\n SG_ A : 0|32@1- (1,0) [0|0] "" X\n'


def write(folder: Path, text: str, encoding: str = "utf-8") -> Path:
    file = folder / "a.dbc"
    file.write_text(HEAD + text, encoding=encoding)
    return file


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "cp1252"])
def test_encodings(encoding: str, tmp_path: Path) -> None:
    _, signal = find_signal(read_messages(write(tmp_path, GOOD, encoding)), "Good", "Value")
    assert signal.unit == "°"


def test_faults_matter_only_where_they_are_used(tmp_path: Path) -> None:
    known = read_messages(write(tmp_path, GOOD + OVERLAP + SHORT))
    find_signal(known, "Good", "Value")
    for name, words in (("Overlap", "are overlapping"), ("Short", "A does not fit")):
        with pytest.raises(DescriptionError, match=rf"a\.dbc is wrong about this message: .*{words}"):
            find_signal(known, name, "A")


def test_two_messages_with_one_identifier(tmp_path: Path) -> None:
    known = read_messages(write(tmp_path, GOOD + GOOD.replace("Good", "Twin")))
    with pytest.raises(DescriptionError, match=r"a\.dbc gives its identifier 0x101 to Twin, too"):
        find_signal(known, "Good", "Value")


def test_an_extended_identifier_is_another_one(tmp_path: Path) -> None:
    extended = GOOD.replace("Good", "Long").replace("257", str(257 | 1 << 31))
    known = read_messages(write(tmp_path, GOOD + extended))
    (short, _), (long, _) = (find_signal(known, name, "Value") for name in ("Good", "Long"))
    assert short.frame_id == long.frame_id


# --- each format -------------------------------------------------------------------------------------------


def test_one_drive_in_every_description_gives_the_same_samples(tmp_path: Path, seed: int) -> None:
    """In four formats and as a table of ids, alone or beside a file; an extended id, big endian, and a counter."""
    rng, frames = random.Random(seed), list[Frame]()
    for k in range(50):
        count = bytes([k])
        frames.append(Frame(5000 * k, 0x181, False, rng.randbytes(2) + count + b"\0"))
        frames.append(Frame(5000 * k + 300, 0x18FF0200, True, bytes([7, 0, rng.randrange(9), k, 0, 0, 0, 0])))
    axis = plant.axis("a", ("Drive", "Torque"), ("Motion", "Angle"), "angle")
    axis["time"] = {"counter_message": "Drive", "counter_signal": "Count"}
    found = dict[str, list[plant.Sample]]()
    for name, text in TEXTS.items():
        (tmp_path / name).write_text(text(), encoding="utf-8")
    buses: dict[str, dict[str, Any]] = {name: {"messages": name} for name in TEXTS}
    buses |= {"a table": {"messages": None, "message": table()}, "both": {"message": table()}}
    for name, bus in buses.items():
        ingest = Ingest(plant.make_config(tmp_path, axis, **bus), "bus0")
        found[name] = plant.fed(ingest, frames)["r.a"]
    assert ingest.decoder.known.source == "plant.dbc and [[bus.message]]"
    samples = found["a.dbc"]
    assert len(samples) == 50
    torque = int.from_bytes(frames[0].data[:2], "little", signed=True) * 0.0625
    motion = int.from_bytes(frames[1].data[1:5], "big", signed=True) * 0.0009765625
    assert samples[0][1:3] == (torque, motion)
    assert all(other == samples for other in found.values())


WRONG = {
    "a.dbc": {
        "!nonsense": "Invalid syntax at line 3",
        "BO_ x": "Invalid syntax at line 3, column 5",
        'VAL_ 77 S 1 "a" ;': "",
        'BA_ "foo" 5;': "",
        "BO_ 99999999999 A: 8 X\n": "",
        "\x00\xff\x17": "Invalid syntax at line 3, column 1",
    },
    "a.kcd": {
        "": "no element found: line 1, column 0",
        "<a>\n<b": "unclosed token: line 2, column 0",
        "<a/>": "Expected root element tag",
        TEXTS["a.kcd"]().replace(' id="0x181"', ""): "an entry is missing or wrong",
        TEXTS["a.kcd"]().replace('offset="0"', ""): "an entry is missing or wrong",
    },
    "a.sym": {
        "": "Only SYM version 6.0 is supported",
        TEXTS["a.sym"]().replace("ID=181h", "ID=zz"): "Invalid syntax at line 7, column 4",
        TEXTS["a.sym"]().replace("6.0", "5.0"): "Only SYM version 6.0 is supported",
    },
    "a.arxml": {
        "": "no element found: line 1, column 0",
        "<AUTOSAR/>": "No XML namespace specified",
        TEXTS["a.arxml"]().replace("/P/PduDrive", "/P/Gone"): "",
    },
}


@pytest.mark.parametrize(("name", "text"), [(name, text) for name, texts in WRONG.items() for text in texts])
def test_a_broken_file(name: str, text: str, tmp_path: Path) -> None:
    """File, line where it is known, and what is wrong."""
    file = tmp_path / name
    file.write_text(HEAD + text if name == "a.dbc" else text, encoding="latin-1")
    with pytest.raises(DescriptionError) as caught:
        read_messages(file)
    kind = file.suffix[1:].upper()
    assert str(caught.value).startswith(f"{file} is no valid {kind}: ")
    assert WRONG[name][text] in str(caught.value)


def test_no_file_and_a_file_that_changes(tmp_path: Path) -> None:
    """A file is read again when it changes."""
    with pytest.raises(DescriptionError, match=r"none\.dbc: No such file"):
        read_messages(tmp_path / "none.dbc")
    (tmp_path / "folder.dbc").mkdir()
    with pytest.raises(DescriptionError, match="Is a directory"):
        read_messages(tmp_path / "folder.dbc")
    file = write(tmp_path, GOOD)
    first = read_messages(file)
    assert read_messages(file) is first
    write(tmp_path, GOOD.replace("Good", "Best"))
    os.utime(file, ns=(1, 1))
    assert [message.name for message in read_messages(file).messages] == ["Best"]


def test_a_counter_is_a_whole_number(tmp_path: Path) -> None:
    assert find_counter(read_messages(write(tmp_path, GOOD)), "Good", "Other")[1].length == 16
    known = read_messages(write(tmp_path, GOOD.replace("16|16", "16|32") + "SIG_VALTYPE_ 257 Other : 1;\n"))
    with pytest.raises(DescriptionError, match="Other is a float"):
        find_counter(known, "Good", "Other")


def test_parameter_groups_of_j1939_in_a_dbc(tmp_path: Path) -> None:
    """As the attribute of a message says: of any priority, and from any source where that is 0xFE."""
    ids = {"Drive": 0x18FF3121, "Any": 0x18FF32FE, "Plain": 0x18FF3321}
    text = "".join(
        f'BO_ {can_id | 1 << 31} {name}: 8 X\n SG_ V : 0|16@1- (1,0) [0|0] "" X\n' for name, can_id in ids.items()
    )
    text += 'BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","reserved","J1939PG";\n'
    text += 'BA_DEF_DEF_ "VFrameFormat" "ExtendedCAN";\n'
    text += "".join(f'BA_ "VFrameFormat" BO_ {ids[name] | 1 << 31} 3;\n' for name in ("Drive", "Any"))
    decoder = Decoder(read_messages(write(tmp_path, text)))
    for name in ids:
        decoder.want(name, "V")
    sent = [0x18FF3121, 0x0CFF3121, 0x18FF3122, 0x0CFF3207, 0x18FF32FE, 0x0CFF3321, 0x18FF3321]
    frames = [Frame(k, can_id, True, bytes([k]) * 8) for k, can_id in enumerate(sent)]
    found = decoder.decode(FrameBlock.from_frames(frames))
    places = {decoder.messages[key].name: decoded.places.tolist() for key, decoded in found.items()}
    assert places == {"Drive": [0, 1], "Any": [3, 4], "Plain": [6]}
