"""The error that an identification raises where a user can mend the cause."""


class IdentificationError(Exception):
    """Nothing can be identified in this way; the text says why, with the number that shows it."""
