"""Documents as a page of HTML that stands alone: for notebooks, and for reports."""

from collections.abc import Iterator
from html import escape
from typing import Any

from trdlab.explanations.sections import Section
from trdlab.show.document import Document, document
from trdlab.show.tables import Table

_STYLE = (
    ".trdlab{font-family:system-ui,sans-serif;max-width:48em;overflow-wrap:break-word}"
    ".trdlab pre{line-height:1.2}.trdlab table{border-collapse:collapse;display:block;"
    "overflow-x:auto}.trdlab td,.trdlab th{padding:.15em .7em;text-align:right;white-space:nowrap;"
    "font-variant-numeric:tabular-nums}.trdlab tr>:first-child,.trdlab tr>:last-child{"
    "text-align:left}.trdlab .about{opacity:.7}"
)


def html(thing: Any) -> str:
    """Returns what there is to see of a noun of trdlab, with what was not asked for folded away."""
    return f'<div class="trdlab"><style>{_STYLE}</style>{"".join(_parts(document(thing)))}</div>'


def _parts(page: Document) -> Iterator[str]:
    yield f"<h3>{escape(page.heading)}</h3>"
    if page.setting:
        yield f'<p class="about">{escape(" · ".join(page.setting))}</p>'
    if page.scene is not None:
        if page.scene.drawing:
            legend = "\n".join(page.scene.legend)
            yield f"<pre>{escape(page.scene.drawing)}\n\n{escape(legend)}</pre>"
        yield from (f'<p class="about">{escape(note)}</p>' for note in page.scene.notes)
    if page.table is not None:
        yield _table(page.table)
    details = "".join(map(_section, page.sections))
    if not page.folded:
        yield details
    else:
        for i, sentence in enumerate(page.answer):
            said = escape(sentence)
            yield f"<p><strong>{said}</strong></p>" if i == 0 else f"<p>{said}</p>"
        yield f"<details><summary>Details</summary>{details}</details>" if details else ""
    if page.check is not None:
        yield f'<p class="about">{escape("✓ " * page.check[1] + page.check[0])}</p>'


def _section(section: Section) -> str:
    items = "".join(f"<li>{escape(sentence)}</li>" for sentence in section.sentences)
    return f"<h4>{escape(section.heading)}</h4><ul>{items}</ul>"


def _table(table: Table) -> str:
    head = "".join(f'<th scope="col">{escape(cell)}</th>' for cell in table.heading)
    body = "".join(
        "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in table.rows
    )
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
