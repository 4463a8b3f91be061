"""Lays out the sources of the site: every page in one folder, its links changed to fit, and the reference."""

import re
import shutil
from collections.abc import Iterator
from functools import partial
from pathlib import Path

LINK = re.compile(r"(\]\()(?!https?://|#)([^)#\s]+)((?:#[^)\s]+)?\))")
NAMED = re.compile(r"\[[\w.-]+\.md\]\((?=[^)#]+\.md\))")
"""What begins a link to a page that is called by its file: Sphinx calls it by its title."""

DOCS = "docs"
DOOR = re.compile(r"^## (.+)$", re.MULTILINE)
PAGE = re.compile(r"\]\(([\w./-]+\.md)\)")


def stage(root: Path, out: Path) -> None:
    """Writes the sources of the site into a new folder: the pages of docs/ and of the checkout side by side, and what
    they link to. Raises FileNotFoundError for a link that leads nowhere."""
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir(parents=True)
    for page in list_pages(root):
        target = out / place_of(page.relative_to(root))
        target.parent.mkdir(parents=True, exist_ok=True)
        text = page.read_text(encoding="utf-8")
        text = LINK.sub(partial(move_link, page=page, root=root, out=out), text)
        target.write_text(NAMED.sub("[](", text), encoding="utf-8")
    index = out / "index.md"
    index.write_text(index.read_text(encoding="utf-8") + "".join(build_doors(index)), encoding="utf-8")


def list_pages(root: Path) -> list[Path]:
    """Returns every page in Markdown: those beside docs/, that of the client, and those in docs/."""
    return [*sorted(root.glob("*.md")), *sorted(root.glob("client/*.md")), *sorted((root / DOCS).rglob("*.md"))]


def place_of(path: Path) -> Path:
    """Returns where a file of the checkout is in the site: docs/ is its top."""
    return path.relative_to(DOCS) if path.parts[0] == DOCS else path


def move_link(link: re.Match[str], *, page: Path, root: Path, out: Path) -> str:
    """Returns a link of a page as it is in the site; copies what it leads to, unless that is a page."""
    source = (page.parent / link[2]).resolve()
    if not source.exists():
        raise FileNotFoundError(f"{page.relative_to(root)}: {link[2]} does not exist")
    if source.is_dir():
        source = next(path for path in sorted(source.rglob("*.md")) or sorted(source.iterdir()) if path.is_file())
    place = place_of(source.relative_to(root))
    if source.suffix != ".md":
        (out / place).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(source, out / place)
    here = place_of(page.relative_to(root)).parent
    return f"{link[1]}{Path('../' * len(here.parts)) / place if here.parts else place}{link[3]}"


def build_doors(index: Path) -> Iterator[str]:
    """Yields the table of contents of each door: its pages, in the order of docs/index.md."""
    parts = ["Start", *DOOR.split(index.read_text(encoding="utf-8"))]
    for title, body in zip(parts[::2], parts[1::2], strict=True):
        yield write_toctree(title, list(dict.fromkeys(PAGE.findall(body))))
    yield write_toctree("Reference", ["reference/rest.md", "reference/python.md"])


def write_toctree(title: str, pages: list[str]) -> str:
    """Returns the directive that puts pages under a title into the side bar."""
    return "\n".join(["", "```{toctree}", ":hidden:", f":caption: {title}", "", *pages, "```", ""])
