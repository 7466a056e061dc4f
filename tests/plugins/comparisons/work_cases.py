"""What the tests of work and precision share."""

from itertools import takewhile


def answers(text):
    """Of each table of requested errors the cells of its rows."""
    lines = iter(text.splitlines())
    for line in lines:
        if line.startswith("cheapest scheme"):
            next(line for line in lines if line.startswith("───"))
            rows = takewhile(lambda line: line[:1].isdigit(), lines)
            yield {row.split()[0]: row for row in rows}
