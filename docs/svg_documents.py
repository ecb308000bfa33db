"""A picture of the reports as a file of its own."""

from service.reports.formats import TEMPLATES


def document(element: str) -> str:
    """An SVG element of a page with its colours, light or dark as the reader's system is."""
    tokens = (TEMPLATES / "tokens.css").read_text(encoding="utf-8")
    end = element.index(">") + 1
    return f"{element[:end]}<style>{tokens}svg {{ background: var(--panel); }}</style>{element[end:]}"
