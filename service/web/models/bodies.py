"""What the bodies of all REST answers share: numbers, times, texts, sentences."""

import math
import re
from collections.abc import Iterable
from typing import Annotated, Literal

from pydantic import AfterValidator, AwareDatetime, BaseModel, BeforeValidator, ConfigDict, Field

from monitor_core import wording
from service.store.alarm_transitions import control_character
from service.texts.instants import iso


def finite(value: float | None) -> float | None:
    """The number, or None where it is not finite."""
    return value if value is not None and math.isfinite(value) else None


def _iso(value: object) -> object:
    return iso(value) if isinstance(value, int) else value


_DATE_AND_TIME = re.compile(r"\d{4}-\d\d-\d\d[Tt ]\d\d:\d\d")


def _date_and_time(given: object) -> object:
    """A text that begins as a time does; pydantic takes a number for seconds or milliseconds since 1970.

    Raises:
        ValueError: it does not.
    """
    if given is not None and not (isinstance(given, str) and _DATE_AND_TIME.match(given)):
        raise ValueError("must be ISO 8601 with time zone: 2026-03-01T12:00:00Z, or +01:00 as %2B01:00")
    return given


def _written(text: str) -> str:
    """A text that moves no cursor of a terminal, where a command prints it.

    Raises:
        ValueError: it is none.
    """
    if (wrong := control_character(text)) is not None:
        raise ValueError(f"must be a text without control characters; it has U+{ord(wrong):04X}")
    return text


GivenTime = Annotated[AwareDatetime, BeforeValidator(_date_and_time)]
"""In a request"""
GivenText = Annotated[str, AfterValidator(_written)]
"""In a request"""
Number = Annotated[float | None, BeforeValidator(finite)]
Time = Annotated[str, BeforeValidator(_iso), Field(json_schema_extra={"format": "date-time"})]
"""Given as text, or in microseconds since 1970"""
TextOrNull = Annotated[str | None, BeforeValidator(lambda text: text or None)]
"""An empty text becomes null"""
Direction = Literal["up", "down"]


class Body(BaseModel):
    """Base of all bodies: immutable, no unknown fields; a body within another is read from an object's attributes."""

    model_config = ConfigDict(extra="forbid", frozen=True, from_attributes=True)


class Sentence(Body):
    """A text for a person, with what another language needs to say it."""

    words: str = Field(description="the text, in English, as it stands in other fields")
    kind: str = Field(description="which sentence it is; joined: its values, one after the other")
    values: "dict[str, str | Sentence]" = Field(description="what is in it")


def sentences(texts: Iterable[str | None]) -> list[dict[str, object]]:
    """Fields of models.Sentence of those texts that are sentences of a kind, each once."""
    return [_sentence(text) for text in dict.fromkeys(texts) if isinstance(text, wording.Sentence)]


def _sentence(text: wording.Sentence) -> dict[str, object]:
    values = {name: _sentence(v) if isinstance(v, wording.Sentence) else v for name, v in text.values.items()}
    return {"words": text, "kind": text.kind, "values": values}


def sentence_bodies(texts: Iterable[str | None]) -> list[Sentence]:
    """Those of them that are sentences of a kind, each once."""
    return [Sentence.model_validate(found) for found in sentences(texts)]


SENTENCES = "the texts above that are sentences of a kind: with it, so that another language can say them"
