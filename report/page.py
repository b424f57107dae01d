"""One self-contained HTML page: text, tables, pictures, films.

The page needs no network and no other file, so it can be mailed, archived and printed. It follows
the reader's choice of light or dark, and fits a phone.
"""

from __future__ import annotations

import base64
import html
import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pipeline.cli import InputError
from pipeline.files import write_text
from report.table import Table, text

LARGEST_FILM_BYTES = 3_000_000
"""A film up to this size is put into the page; a larger one lies next to it."""

MEDIA_TYPES = {
    ".png": "image/png",
    ".jpg": "image/jpeg",
    ".jpeg": "image/jpeg",
    ".gif": "image/gif",
    ".svg": "image/svg+xml",
    ".mp4": "video/mp4",
}


@dataclass(frozen=True)
class Paragraph:
    """Plain text; HTML in it is shown, not interpreted."""

    text: str

    def html(self) -> str:
        """The element as HTML."""
        return f"<p>{text(self.text)}</p>"


@dataclass(frozen=True)
class Picture:
    """A picture or film from a file (png, jpg, gif, svg, mp4), copied into the page.

    `description` says what it shows, for readers who cannot see it. `least_width_px`: on a
    narrower screen the picture scrolls sideways instead of shrinking further; 0: it shrinks.
    """

    path: str | os.PathLike[str]
    description: str
    caption: str = ""
    least_width_px: int = 0

    def html(self) -> str:
        """The element as HTML."""
        path = Path(self.path)
        media_type = MEDIA_TYPES.get(path.suffix.lower())
        if media_type is None:
            allowed = ", ".join(suffix[1:] for suffix in MEDIA_TYPES)
            raise InputError(f"{path}: cannot be shown on a page: allowed are {allowed}")
        try:
            data = base64.b64encode(path.read_bytes()).decode()
        except OSError as error:
            raise InputError(f"{path}: cannot be read: {error.strerror}") from None
        source = f'src="data:{media_type};base64,{data}"'
        words = html.escape(self.description, quote=True)
        if media_type.startswith("video"):
            shown = f'<video controls loop muted playsinline aria-label="{words}" {source}></video>'
        else:
            shown = f'<img alt="{words}" {source}>'
        if self.least_width_px:
            least = f'<div class="wide picture" style="--least: {self.least_width_px}px">'
            shown = f"{least}{shown}</div>"
        caption = f"<figcaption>{text(self.caption)}</figcaption>" if self.caption else ""
        return f"<figure>{shown}{caption}</figure>"


@dataclass(frozen=True)
class KeyNumbers:
    """The few numbers that matter most, side by side: (what it is, its value, a remark)."""

    entries: Sequence[tuple[str, str, str]]

    def html(self) -> str:
        """The element as HTML."""
        made = [
            f"<div><dt>{html.escape(name)}</dt><dd>{html.escape(value)}</dd>"
            f'<dd class="remark">{html.escape(remark)}</dd></div>'
            for name, value, remark in self.entries
        ]
        return f'<dl class="key">{"".join(made)}</dl>'


@dataclass(frozen=True)
class Folded:
    """Details under a line that opens them; in print they are open."""

    title: str
    parts: Sequence[Part]

    def html(self) -> str:
        """The element as HTML."""
        inner = "\n".join(part.html() for part in self.parts)
        return f"<details>\n<summary>{html.escape(self.title)}</summary>\n{inner}\n</details>"


Part = Paragraph | Table | Picture | KeyNumbers | Folded


def said(sentences: Iterable[str]) -> list[Part]:
    """A paragraph for each sentence; empty ones are left out."""
    return [Paragraph(sentence) for sentence in sentences if sentence]


def shown(path: Path | None, description: str, *sentences: str, **more: Any) -> list[Part]:
    """A picture under the sentences that explain it; nothing where there is no picture."""
    return [] if path is None else [*said(sentences), Picture(path, description, **more)]


def filmed(film: Path | None, description: str, **more: Any) -> list[Part]:
    """A film in the page, or where it is too large its name; nothing where there is none."""
    if film is None:
        return []
    size = film.stat().st_size
    if size > LARGEST_FILM_BYTES:
        return said([f"The film ({size / 1e6:.1f} MB) is next to this page: {film.name}."])
    return [Picture(film, description, **more), *said([f"Also next to this page: {film.name}."])]


def tabulated(*tables: Table | None) -> list[Part]:
    """The tables that have rows."""
    return [table.without_empty_columns() for table in tables if table is not None and table.rows]


def folded(title: str, *tables: Table | None) -> list[Part]:
    """The tables that have rows, under a line that opens them; nothing where there are none."""
    found = tabulated(*tables)
    return [Folded(title, found)] if found else []


@dataclass(frozen=True)
class PageSection:
    """A part of the page under its own heading."""

    title: str
    parts: Sequence[Part] = field(default_factory=tuple)

    def html(self) -> str:
        """The element as HTML."""
        inner = "\n".join(part.html() for part in self.parts)
        return f"<section>\n<h2>{html.escape(self.title)}</h2>\n{inner}\n</section>"


def render_page(title: str, sections: Sequence[PageSection], *, lead: str = "") -> str:
    """The whole page as text.

    Args:
        title: the page's title.
        sections: what it shows, in order.
        lead: a sentence or two under the title: the answer, before the details.
    """
    opening = f'<p class="lead">{text(lead)}</p>' if lead else ""
    body = "\n".join(section.html() for section in sections)
    # Its title at the foot of every printed page. A string of CSS that ends no element.
    foot = "".join(f"\\{ord(letter):06x}" for letter in title)
    style = _STYLE.replace("FOOT", foot)
    return _PAGE.format(title=html.escape(title), style=style, lead=opening, body=body)


def write_page(
    path: str | os.PathLike[str], title: str, sections: Sequence[PageSection], *, lead: str = ""
) -> None:
    """Write the page to `path`, atomically."""
    write_text(path, render_page(title, sections, lead=lead))


_PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>{title}</title>
<style>{style}</style>
</head>
<body>
<main>
<h1>{title}</h1>
{lead}
{body}
</main>
</body>
</html>
"""

# Pictures keep a white ground in the dark as well: they are drawn for paper.
_STYLE = """
:root { --ground: #ffffff; --ink: #1c2126; --soft: #5b6670; --line: #d5dbe0; }
@media (prefers-color-scheme: dark) {
  :root { --ground: #15191d; --ink: #e4e8eb; --soft: #9aa5ae; --line: #38414a; }
}
* { box-sizing: border-box; }
body { margin: 0; background: var(--ground); color: var(--ink);
  font: 16px/1.55 system-ui, -apple-system, "Segoe UI", Roboto, sans-serif; }
main { max-width: 62rem; margin: 0 auto; padding: 1.5rem 1rem 4rem; }
h1 { font-size: 1.6rem; line-height: 1.25; margin: 0 0 .5rem; }
h2 { font-size: 1.2rem; margin: 2.2rem 0 .6rem; padding-top: .8rem;
  border-top: 1px solid var(--line); }
.lead { font-size: 1.1rem; color: var(--soft); margin-top: 0; }
.wide { overflow-x: auto; }
.wide + .wide { margin-top: 1.4rem; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
caption { text-align: left; color: var(--soft); padding-bottom: .4rem; }
th, td { padding: .25rem .9rem .25rem 0; text-align: left; vertical-align: top;
  border-bottom: 1px solid var(--line); }
td.number { text-align: right; }
td.short { white-space: nowrap; }
td.long { min-width: 15rem; }
.key { display: grid; grid-template-columns: repeat(auto-fit, minmax(9.5rem, 1fr)); gap: .8rem;
  margin: 1.2rem 0; }
.key div { border: 1px solid var(--line); border-radius: 6px; padding: .6rem .8rem; }
.key dt { color: var(--soft); font-size: .85rem; line-height: 1.3; }
.key dd { margin: .15rem 0 0; font-size: 1.2rem; font-weight: 600; line-height: 1.25;
  font-variant-numeric: tabular-nums; }
.key dd.remark { font-size: .85rem; font-weight: 400; color: var(--soft); }
details { margin: .8rem 0; }
summary { cursor: pointer; color: var(--soft); }
details[open] > summary { margin-bottom: .6rem; }
figure { margin: 1rem 0; }
img, video { max-width: 100%; height: auto; background: #ffffff; border-radius: 4px; }
img[src^="data:image/svg"] { width: min(100%, 41rem); }
.picture img, .picture video { width: 100%; min-width: var(--least); max-width: none; }
figcaption { color: var(--soft); font-size: .92rem; margin-top: .3rem; }
@page { size: A4; margin: 17mm 16mm 19mm;
  @bottom-left { content: "FOOT"; color: #555; font: 8pt sans-serif; }
  @bottom-right { content: counter(page) " / " counter(pages); color: #555; font: 8pt sans-serif; }
}
@media print {
  :root { --ground: #ffffff; --ink: #000000; --soft: #444444; --line: #bbbbbb; font-size: 10pt; }
  body { font-size: 1rem; line-height: 1.42; }
  h2 { margin-top: 1.4rem; }
  main { max-width: none; padding: 0; }
  p { break-inside: avoid; margin: .55rem 0; }
  table { font-size: .82rem; line-height: 1.32; }
  th, td { padding: .16rem .6rem .16rem 0; overflow-wrap: break-word; }
  td.long { min-width: 10em; }
  td.short { white-space: normal; }
  .wide { overflow: visible; }
  figure, tr, .key { break-inside: avoid; }
  .wide:not(:has(tbody tr:nth-child(30))) { break-inside: avoid; }
  h2, summary, caption, thead, p:has(+ figure), p:has(+ p + figure), p:has(+ p + p + figure),
  p:has(+ .wide) { break-after: avoid; }
  summary { list-style: none; font-weight: 600; }
  details::details-content { content-visibility: visible; block-size: auto; }
  video, figure:has(video) { display: none; }
  img { max-height: 21cm; object-fit: contain; }
  img[src^="data:image/svg"] { width: min(100%, 28rem); }
  .picture img, .picture video { width: 100%; min-width: 0; }
}
"""
