"""What the page says in German: each kind of sentence, wherever the program makes it, and each reason of a count."""

import ast
import json
import pickle
import re
from collections.abc import Iterator
from pathlib import Path

from monitor_core.kernel.state import COUNTERS
from monitor_core.sampling import DROP_REASONS
from monitor_core.wording import Sentence, joined, sentence
from service.can.bus_reader import READER_REASONS
from service.can.decoder import FRAME_REASONS
from service.pipeline.snapshot import GIVE_UP_REASONS
from service.store.archive import SCHEMAS
from service.web.app import STATIC
from service.web.models import sentences

TOP = Path(__file__).parents[3]
GERMAN = STATIC.with_name("dashboard") / "src" / "texts" / "de.ts"


def made() -> Iterator[tuple[str, set[str]]]:
    """The kinds of all calls of sentence() with the names of their values."""
    for folder in ("monitor_core", "service"):
        for path in (TOP / folder).rglob("*.py"):
            text = path.read_text(encoding="utf-8")
            for node in ast.walk(ast.parse(text)) if "sentence(" in text else ():
                if isinstance(node, ast.Call) and ast.unparse(node.func) == "sentence":
                    first = node.args[0]
                    for kind in [first.body, first.orelse] if isinstance(first, ast.IfExp) else [first]:
                        yield ast.literal_eval(kind), {k.arg or "" for k in node.keywords}


def in_german() -> dict[str, set[str]]:
    """The kinds of the table in de.ts with the names of the values in it, of the constants it uses as well."""
    text = GERMAN.read_text(encoding="utf-8")
    constants = dict(re.findall(r'^const ([A-Z_]+) = "(.*)";$', text, re.M))
    table = text.partition("const SENTENCES")[2].partition("\n};")[0]
    table = re.sub(r"\$\{([A-Z_]+)\}", lambda m: constants[m[1]], table)
    table = re.sub(r": ([A-Z_]+),$", lambda m: f': "{constants[m[1]]}",', table, flags=re.M)
    entries = re.findall(r'^  ("[^"]+"|\w+): (.*(?:\n    \+ .*)*),$', table, re.M)
    return {kind.strip('"'): set(re.findall(r"\{(\w+)\}", words)) for kind, words in entries}


def test_each_kind_of_sentence_has_its_german_with_values_that_it_has() -> None:
    values = dict[str, set[str]]()
    for kind, names in made():
        assert values.setdefault(kind, names) == names, kind
    german = in_german()
    assert len(values) > 50
    assert german.keys() == values.keys()
    assert {kind: names - values[kind] for kind, names in german.items() if names - values[kind]} == {}


def test_each_reason_of_a_count_has_its_german() -> None:
    table = GERMAN.read_text(encoding="utf-8").partition("\n  reason: {")[2].partition("\n  },")[0]
    reasons = {*READER_REASONS, *FRAME_REASONS, *DROP_REASONS, *GIVE_UP_REASONS, *COUNTERS} - {
        "used",
        "projected",
    }
    assert reasons <= {*re.findall(r"(\w+): \"", table)}


def test_each_file_of_the_state_directory_is_described_in_each_language() -> None:
    for file in (GERMAN, GERMAN.with_name("en.ts")):
        table = file.read_text(encoding="utf-8").partition("\n    holds: {")[2].partition("\n    }")[0]
        assert {*re.findall(r'"([\w.]+)": "', table)} == {*SCHEMAS}


def test_a_sentence_is_its_english_text_and_keeps_its_values() -> None:
    why = sentence("damaged", "it is damaged")
    lost = sentence("lost", "{why} (restarted: {parts})", why=why, parts=joined(["a", "b", "c"], ", and "))
    assert lost == "it is damaged (restarted: a, b and c)"
    (found,) = json.loads(json.dumps(sentences(("plain", lost, lost, None))))
    assert found["kind"] == "lost"
    assert found["values"]["why"] == {"words": "it is damaged", "kind": "damaged", "values": {}}
    assert found["values"]["parts"]["values"] == {"0": "a", "1": "b", "2": "c", "separator": ", and "}
    again = pickle.loads(pickle.dumps(lost))
    assert (again, again.kind, isinstance(again.values["why"], Sentence)) == (lost, "lost", True)


def test_sentences_one_after_the_other() -> None:
    assert joined([]) == ""
    assert joined(["a"]) == "a"
    assert joined(["a", "b"]) == "a; b"
