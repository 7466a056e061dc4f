"""A whole answer, made from its record."""

from filled_results import filled

from spi.storage import StoredResults

WHOLE = {"answer": StoredResults({"kind": "answer", "title": "Answer"}, (filled("answer"),))}
