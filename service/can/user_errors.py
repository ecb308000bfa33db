"""Errors that a user can cause and correct, with messages for the user."""


class IngestError(Exception):
    """Something outside the program is wrong; the text names it and says what would be right."""


class BusError(IngestError):
    """A bus that cannot be opened or written to."""


class RecordError(IngestError):
    """A record that cannot be read, played or written."""
