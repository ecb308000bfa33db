"""What an identification cannot do."""


class IdentificationError(Exception):
    """Nothing can be identified so; the text says why, with the number that shows it."""
