"""Building blocks of HTML reports: one file that needs nothing else.

Text is escaped by every function here; only the results of these functions are put together
unescaped. Colours keep a contrast of at least 4.5 on light and dark screens, and nothing is told
by colour alone.
"""

from __future__ import annotations

import base64
from collections.abc import Iterable, Mapping, Sequence
from html import escape as escape_markup
from typing import NewType

from meshlab_lowrank.plain_text import plain

Html = NewType("Html", str)

_STYLE = """
:root { color-scheme: light dark; --line: #c8ccd2; --soft: #f3f5f8; --mark: #dbe7fb; }
@media (prefers-color-scheme: dark) {
  :root { --line: #4a4f57; --soft: #23272e; --mark: #2b3b5c; }
}
* { box-sizing: border-box; }
body { font: 16px/1.5 system-ui, sans-serif; margin: 0 auto; max-width: 76rem; padding: 1rem; }
h1 { font-size: 1.6rem; line-height: 1.2; } h2 { font-size: 1.25rem; margin-top: 2.5rem; }
h3 { font-size: 1rem; margin: 1.5rem 0 .25rem; } p { max-width: 46rem; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-size: .875rem; font-variant-numeric: tabular-nums; }
.caption { font-size: .875rem; margin: 1.25rem 0 .5rem; }
th, td { border-bottom: 1px solid var(--line); padding: .3rem .6rem; text-align: right; }
td { white-space: nowrap; }
thead th { border-bottom-width: 2px; vertical-align: bottom; }
th:first-child, .text { text-align: left; }
tbody th { font-weight: 600; position: sticky; left: 0; background: Canvas; white-space: nowrap; }
td.best { background: var(--mark); font-weight: 700; }
td.text { min-width: 6rem; max-width: 24rem; white-space: normal; }
.row { display: grid; gap: 1rem; grid-template-columns: repeat(auto-fill, minmax(11rem, 1fr)); }
figure { margin: 0; } figure img { width: 100%; height: auto; display: block; border-radius: 4px; }
figcaption { font-size: .8125rem; line-height: 1.4; padding: .3rem 0; overflow-wrap: anywhere; }
.missing { aspect-ratio: 1; display: grid; place-items: center; padding: 1rem; text-align: center;
  background: var(--soft); border: 1px dashed var(--line); border-radius: 4px; }
figure img + img { margin-top: 4px; }
.scale { display: flex; align-items: center; gap: .6rem; font-size: .8125rem; margin: .5rem 0; }
.bar { flex: 1; max-width: 20rem; height: .9rem; border: 1px solid var(--line); }
.note { background: var(--soft); border-left: 4px solid var(--line); padding: .5rem 1rem; }
pre { background: var(--soft); overflow-x: auto; padding: .75rem; }
dl { display: grid; grid-template-columns: minmax(6rem, max-content) 1fr; gap: .2rem 1rem; }
dt { font-weight: 600; } dd { margin: 0; overflow-wrap: anywhere; }
@media (max-width: 480px) {
  body { padding: .75rem; }
  .row { grid-template-columns: repeat(2, minmax(0, 1fr)); gap: .6rem; }
  th, td { padding: .3rem .4rem; }
  .missing { aspect-ratio: auto; padding: .5rem; }
  dl { grid-template-columns: 1fr; gap: 0; } dd { margin-bottom: .5rem; }
}
@media (max-width: 640px) {
  .cards, .cards tbody { display: block; }
  .cards thead { display: none; }
  .cards tr { display: grid; grid-template-columns: 1fr 1fr; gap: .1rem 1.25rem;
    border: 1px solid var(--line); border-radius: 4px; margin-bottom: .75rem; padding: .5rem; }
  .cards tbody th, .cards td { border: 0; padding: 0; white-space: normal; }
  .cards tbody th { grid-column: 1 / -1; position: static; overflow-wrap: anywhere; }
  .cards td { display: flex; justify-content: space-between; gap: .5rem; }
  .cards td::before { content: attr(data-name); opacity: .75; }
  .cards td.text { grid-column: 1 / -1; max-width: none; justify-content: flex-start;
    overflow-wrap: anywhere; }
  .cards td.text::before { flex: 0 0 4rem; }
  .cards td:empty { display: none; }
}
"""


def page(title: str, *parts: Html) -> str:
    """Give a whole HTML document with a heading and parts below it."""
    head = escape(title)
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{head}</title>\n<style>{_STYLE}</style>\n</head>\n<body>\n<h1>{head}</h1>\n"
        + "\n".join(parts)
        + "\n</body>\n</html>\n"
    )


def escape(text: str) -> str:
    """Escape markup, and characters that would turn the text around or are not text."""
    return escape_markup(plain(text, keep="\n"))


def heading(text: str, level: int = 2) -> Html:
    """Give a heading of a level from 2 to 6."""
    return Html(f"<h{level}>{escape(text)}</h{level}>")


def paragraph(text: str) -> Html:
    """Give a paragraph."""
    return Html(f"<p>{escape(text)}</p>")


def note(text: str) -> Html:
    """Give a paragraph that stands out."""
    return Html(f'<p class="note">{escape(text)}</p>')


def code(text: str) -> Html:
    """Give text as it would stand in a terminal."""
    return Html(f"<pre>{escape(text)}</pre>")


def definitions(items: Mapping[str, object]) -> Html:
    """Give names and what they stand for."""
    rows = (
        f"<dt>{escape(name)}</dt><dd>{escape(str(value))}</dd>" for name, value in items.items()
    )
    return Html("<dl>" + "".join(rows) + "</dl>")


def table(
    columns: Sequence[str],
    rows: Iterable[Sequence[str]],
    *,
    caption: str = "",
    text_columns: Iterable[int] = (),
    best: Iterable[tuple[int, int]] = (),
    cards: bool = False,
) -> Html:
    """Give a table that scrolls sideways where the screen is too narrow, or becomes cards there.

    Parameters
    ----------
    columns : sequence of str
    rows : iterable of sequences of str
        The first cell of a row names it.
    caption : str
    text_columns : iterable of int
        Columns aligned to the left; the others hold numbers.
    best : iterable of (row, column)
        Cells that are set bold on a coloured ground.
    cards : bool
        On a narrow screen give each row a card of its own, with the names of the columns in it.

    Returns
    -------
    Html
    """
    left, marked = set(text_columns), set(best)
    kinds_of = [' class="text"' if j in left else "" for j in range(len(columns))]
    heads = zip(columns, kinds_of, strict=True)
    lines = ["".join(f'<th scope="col"{kind}>{escape(name)}</th>' for name, kind in heads)]
    for i, row in enumerate(rows):
        cells = [f'<th scope="row">{escape(row[0])}</th>']
        for j, cell in enumerate(row[1:], 1):
            kinds = [kind for kind, yes in (("text", j in left), ("best", (i, j) in marked)) if yes]
            label = f' class="{" ".join(kinds)}"' if kinds else ""
            name = f' data-name="{escape(columns[j])}"' if cards else ""
            cells.append(f"<td{label}{name}>{escape(cell)}</td>")
        lines.append("".join(cells))
    head, *body = (f"<tr>{line}</tr>" for line in lines)
    above = f'<p class="caption">{escape(caption)}</p>' if caption else ""
    kind = ' class="cards"' if cards else ""
    label = escape(caption or "table")
    return Html(
        f'{above}<div class="wide" tabindex="0"><table{kind} aria-label="{label}">'
        f"<thead>{head}</thead><tbody>{''.join(body)}</tbody></table></div>"
    )


def picture(data: bytes, alternative: str, *lines: str) -> Html:
    """Give a JPEG or PNG with lines of text under it; see `pictures`."""
    return pictures([(data, alternative)], *lines)


def pictures(items: Sequence[tuple[bytes, str]], *lines: str) -> Html:
    """Give JPEGs or PNGs, one under the other, with lines of text under them.

    Parameters
    ----------
    items : sequence of (data, alternative)
        The file's content, which is put into the page, and what the picture shows, for those who
        can't see it.
    *lines : str
        The first line is set bold.
    """
    return _figure("".join(_image(data, alternative) for data, alternative in items), lines)


def missing_picture(reason: str, *lines: str) -> Html:
    """Give a placeholder of the size of a picture, with the reason in it."""
    return _figure(f'<div class="missing">{escape(reason)}</div>', lines)


def picture_row(pictures: Iterable[Html]) -> Html:
    """Set pictures side by side, as many as the screen holds."""
    return Html(f'<div class="row">{"".join(pictures)}</div>')


def colour_scale(colours: Sequence[str], low: str, high: str) -> Html:
    """Give a bar that runs through colours, with a label at either end."""
    bar = f"linear-gradient(to right, {', '.join(colours)})"
    return Html(
        f'<div class="scale"><span>{escape(low)}</span>'
        f'<span class="bar" style="background: {escape(bar)}"></span>'
        f"<span>{escape(high)}</span></div>"
    )


def _image(data: bytes, alternative: str) -> str:
    kind = "png" if data.startswith(b"\x89PNG") else "jpeg"
    source = f"data:image/{kind};base64,{base64.b64encode(data).decode('ascii')}"
    return f'<img loading="lazy" src="{source}" alt="{escape(alternative)}">'


def _figure(content: str, lines: Sequence[str]) -> Html:
    first, rest = lines[:1], lines[1:]
    text = [f"<strong>{escape(line)}</strong>" for line in first]
    text += [escape(line) for line in rest]
    caption = f"<figcaption>{'<br>'.join(text)}</figcaption>" if text else ""
    return Html(f"<figure>{content}{caption}</figure>")
