"""The pieces of the documentation site; `make docs`, a part of `make release`, builds the whole with Sphinx."""

import json
import re
from pathlib import Path
from typing import Any

import pytest

from release.building import ROOT
from release.site.__main__ import list_fetched
from release.site.openapi import name_type, read_document, write_page
from release.site.staging import LINK, PAGE, list_pages, stage

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def sources(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The sources of the site."""
    folder = tmp_path_factory.mktemp("site") / "sources"
    stage(ROOT, folder)
    return folder


@pytest.fixture(scope="module")
def document() -> dict[str, Any]:
    """The OpenAPI document."""
    return read_document()


def test_every_page_is_in_the_site_and_every_link_leads_somewhere_in_it(sources: Path) -> None:
    pages = sorted(sources.rglob("*.md"))
    assert len(pages) == len(list_pages(ROOT))
    for page in pages:
        for _, target, _ in LINK.findall(page.read_text()):
            place = (page.parent / target).resolve()
            assert place.is_relative_to(sources), (page, target)
            assert place.is_file(), (page, target)


def test_the_doors_lead_to_every_page(sources: Path) -> None:
    index = (sources / "index.md").read_text()
    trees = re.findall(r"```\{toctree\}\n:hidden:\n:caption: (.*)\n\n([^`]*)```", index)
    assert [title for title, _ in trees] == ["Start", "Teach", "Learn", "Operate", "Develop", "Reference"]
    listed = [page for _, body in trees for page in body.split()]
    written = {str(path.relative_to(sources)) for path in sources.rglob("*.md")} - {"index.md"}
    assert set(listed) == written | {"reference/rest.md", "reference/python.md"}
    assert set(PAGE.findall(index)) <= set(listed)


def test_a_link_that_leads_nowhere_stops_the_build(tmp_path: Path) -> None:
    (tmp_path / "docs").mkdir()
    (tmp_path / "docs/index.md").write_text("# One\n\n[two](two.md)\n")
    with pytest.raises(FileNotFoundError, match=r"docs/index.md: two.md does not exist"):
        stage(tmp_path, tmp_path / "out")


def test_the_reference_has_every_route_and_schema_and_their_links_resolve(document: dict[str, Any]) -> None:
    page = write_page(document)
    for path, operations in document["paths"].items():
        for method in operations:
            assert f"## {method.upper()} {path}\n" in page
    for name in document["components"]["schemas"]:
        assert f"(schema-{name.lower()})=\n## {name}\n" in page
    assert set(re.findall(r"\]\(#([\w.-]+)\)", page)) <= set(re.findall(r"^\((.*)\)=$", page, re.MULTILINE))
    examples = re.findall(r"```json\n(.*?)```", page, re.DOTALL)
    assert examples
    assert all(json.loads(example) is not None for example in examples)


def test_a_type_is_named_in_a_word_or_two() -> None:
    schema = {"anyOf": [{"type": "array", "items": {"$ref": "#/x/Card"}}, {"const": 3}, {"enum": ["a"]}, {}]}
    assert name_type(schema) == "list of [Card](#schema-card) or `3` or `a` or any"


FOREIGN = [
    '<script async src="https://cdn.example/a.js"></script>',
    "<link rel=stylesheet href='//cdn.example/a.css'>",
    '<img alt="x" src="http://cdn.example/a.png">',
    "<style>@import \"https://cdn.example/a.css\"; body { background: url( 'https://cdn.example/b.png' ) }</style>",
]


def test_what_a_page_would_fetch_from_elsewhere_is_found(tmp_path: Path) -> None:
    own = (
        '<link rel="canonical" href="https://a.example/"><a href="https://b.example">b</a><script src="a.js"></script>'
    )
    (tmp_path / "own.html").write_text(own)
    assert list(list_fetched(tmp_path)) == []
    for number, text in enumerate(FOREIGN):
        (tmp_path / f"{number}.html").write_text(text)
    report = "\n".join(list_fetched(tmp_path))
    assert report.count("cdn.example") == 5
    assert all(f"{number}.html: " in report for number in range(len(FOREIGN)))
