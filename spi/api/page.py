"""Results as a small table in a notebook."""

from collections import Counter
from html import escape
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .results import Results


def as_html(results: "Results") -> str:
    """Title, parts, orders, claims and file of some results."""
    orders, claims = results.orders, results.claims
    lines = [f"<p><b>{escape(str(results.attributes.get('title', '')))}</b>, {escape(results.kind)}</p>"]
    if len(orders):
        lines.append(orders.to_html(index=False, border=0, float_format="{:.3f}".format, na_rep=""))
    else:
        lines.append(f"<p>parts: {escape(', '.join(results.parts))}</p>")
    if len(claims):
        counts = Counter(claims.verdict)
        lines.append(f"<p>claims: {', '.join(f'{count} {verdict}' for verdict, count in counts.items())}</p>")
    if results.path:
        lines.append(f"<p>file: {escape(str(results.path))}</p>")
    return "<div>" + "\n".join(lines) + "</div>"
