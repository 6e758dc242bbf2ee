"""Check a built site: every link, image and anchor between its pages leads somewhere.

``python docs/check_links.py docs/_build/html`` prints what is broken and exits with 1 if anything is. Links that leave
the site are not followed.
"""

from __future__ import annotations

import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

_ATTRIBUTES = {"a": ("href",), "link": ("href",), "img": ("src", "srcset"), "script": ("src",), "source": ("src",),
               "iframe": ("src",)}  # fmt: skip


class Page(HTMLParser):
    """The links of one page and the anchors it offers."""

    def __init__(self, text: str) -> None:
        """Read the page."""
        super().__init__()
        self.links: list[str] = []
        self.anchors: set[str] = set()
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Collect ids and links."""
        values = {name: value for name, value in attrs if value}
        self.anchors |= {values[name] for name in ("id", "name") if name in values}
        for name in _ATTRIBUTES.get(tag, ()):
            if name not in values:
                continue
            if name == "srcset":
                self.links += [part.split()[0] for part in values[name].split(",") if part.strip()]
            else:
                self.links.append(values[name])


def broken_links(site: Path) -> list[str]:
    """List links that lead nowhere, as "page: link"."""
    pages = {p: Page(p.read_text(encoding="utf-8")) for p in sorted(site.rglob("*.html")) if "_static" not in p.parts}
    broken: list[str] = []
    for page, content in pages.items():
        for link in content.links:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            target = page if not parts.path else (page.parent / unquote(parts.path)).resolve()
            if target.is_dir():
                target = target / "index.html"
            anchor = unquote(parts.fragment)
            missing = not target.exists()
            lost = anchor and target in pages and anchor not in pages[target].anchors
            if missing or lost:
                broken.append(f"{page.relative_to(site)}: {link}")
    return broken


def main(arguments: list[str]) -> int:
    """Check the site named on the command line."""
    if len(arguments) != 1 or not Path(arguments[0]).is_dir():
        print("usage: python docs/check_links.py SITE", file=sys.stderr)
        return 2
    site = Path(arguments[0]).resolve()
    broken = broken_links(site)
    for line in broken:
        print(line)
    print(f"{len(list(site.rglob('*.html')))} pages, {len(broken)} broken links")
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
