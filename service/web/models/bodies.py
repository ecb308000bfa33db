"""Common parts of all bodies: numbers, times, texts, sentences."""

import re
from collections.abc import Iterable
from typing import Annotated

from pydantic import AfterValidator, AwareDatetime, BaseModel, BeforeValidator, ConfigDict, Field

from monitor_core import wording
from monitor_core.arrays import finite
from service.store.alarm_transitions import control_character
from service.texts.instants import iso


def _iso(value: object) -> object:
    return iso(value) if isinstance(value, int) else value


_DATE_AND_TIME = re.compile(r"\d{4}-\d\d-\d\d[Tt ]\d\d:\d\d")


def _date_and_time(given: object) -> object:
    """Check that a value is a text that starts like a time, as pydantic would also accept a number."""
    if given is not None and not (isinstance(given, str) and _DATE_AND_TIME.match(given)):
        raise ValueError(
            "must be ISO 8601 with time zone: 2026-03-01T12:00:00Z or 2026-03-01T13:00:00+01:00"
            " (in an address, write + as %2B)"
        )
    return given


def _written(text: str) -> str:
    """Check that a text has no control characters, which could move the cursor of a terminal that prints it."""
    if (wrong := control_character(text)) is not None:
        raise ValueError(f"must be a text without control characters; it has U+{ord(wrong):04X}")
    return text


GivenTime = Annotated[AwareDatetime, BeforeValidator(_date_and_time)]
"""A time in a request"""
GivenText = Annotated[str, AfterValidator(_written)]
"""A text in a request"""
Number = Annotated[float | None, BeforeValidator(finite)]
Time = Annotated[str, BeforeValidator(_iso), Field(json_schema_extra={"format": "date-time"})]
"""A time in an answer, made from a text or from microseconds since 1970"""
TextOrNull = Annotated[str | None, BeforeValidator(lambda text: text or None)]
"""An empty text becomes null"""


class Body(BaseModel):
    """Base of all bodies: immutable, no unknown fields; inner bodies can be read from attributes of objects."""

    model_config = ConfigDict(extra="forbid", frozen=True, from_attributes=True)


class Sentence(Body):
    """A text for a person, with the data to translate it."""

    words: str = Field(description="the text, in English, as it stands in other fields")
    kind: str = Field(description="kind of the sentence; joined: its values, one after the other")
    values: "dict[str, str | Sentence]" = Field(description="the values in the text, by their names")


def sentences(texts: Iterable[str | None]) -> list[dict[str, object]]:
    """The fields of models.Sentence for those texts that can be translated, each once."""
    return [_sentence(text) for text in dict.fromkeys(texts) if isinstance(text, wording.Sentence)]


def _sentence(text: wording.Sentence) -> dict[str, object]:
    values = {name: _sentence(v) if isinstance(v, wording.Sentence) else v for name, v in text.values.items()}
    return {"words": text, "kind": text.kind, "values": values}


def sentence_bodies(texts: Iterable[str | None]) -> list[Sentence]:
    """The bodies of those texts that can be translated, each once."""
    return [Sentence.model_validate(found) for found in sentences(texts)]


SENTENCES = "those of the texts above that can be translated, with their kinds and values"
