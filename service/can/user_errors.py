"""Faults that a user can cause and put right, in words for the user."""


class IngestError(Exception):
    """Something outside the program is not as it should be; the text names it and what would be right."""


class BusError(IngestError):
    """A bus that cannot be opened or written to."""


class RecordError(IngestError):
    """A record that cannot be read, played or written."""
