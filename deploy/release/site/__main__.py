"""`python -m release.site`: builds the site into build/site, and checks that it fetches nothing from elsewhere."""

import re
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

from release.building import ROOT, ReleaseError
from release.site.openapi import read_document, write_page
from release.site.staging import stage

FETCHED = re.compile(
    r"""<(?:script|img|iframe|source|video|audio|embed|object)\b[^>]*?\b(?:src|data|srcset)=["']?((?:https?:)?//[^"'\s>]+)"""
    r"""|<link\b(?![^>]*rel=["']?canonical)[^>]*?\bhref=["']?((?:https?:)?//[^"'\s>]+)"""
    r"""|(?:url\(\s*["']?|@import\s+["'])((?:https?:)?//[^"')\s]+)""",
    re.IGNORECASE,
)
"""What a browser fetches by itself from another host: not the links that a reader may follow."""


def list_fetched(site: Path) -> Iterator[str]:
    """Yields every foreign address that a page or style sheet of the site would fetch."""
    for path in sorted(site.rglob("*")):
        if path.suffix in (".html", ".css", ".svg"):
            for found in FETCHED.findall(path.read_text(encoding="utf-8")):
                yield f"{path.relative_to(site)}: {''.join(found)}"


def build(sources: Path, site: Path) -> None:
    """Builds the site. Raises ReleaseError where Sphinx warns, as of a broken link, or a page would fetch elsewhere."""
    from sphinx.cmd.build import build_main

    stage(ROOT, sources)
    reference = sources / "reference"
    reference.mkdir()
    (reference / "rest.md").write_text(write_page(read_document()), encoding="utf-8")
    shutil.copyfile(Path(__file__).with_name("python.md"), reference / "python.md")
    shutil.rmtree(site, ignore_errors=True)
    if build_main(["-q", "-E", "-W", "--keep-going", "-c", str(Path(__file__).parent), str(sources), str(site)]):
        raise ReleaseError("the site is not built: mend what the warnings above name")
    if fetched := list(list_fetched(site)):
        raise ReleaseError("the site fetches from elsewhere:\n" + "\n".join(fetched))


if __name__ == "__main__":
    try:
        build(ROOT / "build/site-sources", ROOT / "build/site")
    except (ReleaseError, FileNotFoundError) as error:
        sys.exit(f"docs: {error}")
    print("build/site/index.html")
