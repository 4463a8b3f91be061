"""Every page leads on: links resolve, docs/index.md leads everywhere, and every command of a page exists."""

import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from typer.core import TyperGroup
from typer.main import get_command

from grader.commands.main import cli
from grader.settings import Settings

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = [*sorted(ROOT.glob("*.md")), *sorted(DOCS.rglob("*.md"))]
FENCE = re.compile(r"^ *```(\w+)\n(.*?)^ *```", re.DOTALL | re.MULTILINE)
LINK = re.compile(r"\]\((?!https?://)([^)#\s]*)(?:#([^)\s]+))?\)")


def name_of(page: Path) -> str:
    return str(page.relative_to(ROOT))


def prose(page: Path) -> str:
    """The page without its code."""
    return FENCE.sub("", page.read_text(encoding="utf-8"))


def slugs(page: Path) -> set[str]:
    """The anchors of a page's headings, as GitHub makes them."""
    headings = re.findall(r"^#+ (.*)$", prose(page), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def links(page: Path) -> Iterator[tuple[Path, str]]:
    """Where the relative links of a page lead: the file, and the anchor in it, which may be empty."""
    for path, anchor in LINK.findall(prose(page)):
        yield (page.parent / path).resolve() if path else page, anchor


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_every_relative_link_resolves(page: Path) -> None:
    for target, anchor in links(page):
        assert target.exists(), target
        assert not anchor or anchor in slugs(target), f"{target}#{anchor}"


def test_the_index_leads_to_every_page() -> None:
    reached, ahead = set(), [DOCS / "index.md"]
    while ahead:
        page = ahead.pop()
        if page not in reached:
            reached.add(page)
            ahead += [target for target, _ in links(page) if target.suffix == ".md"]
    assert set(PAGES) <= reached
    assert set(DOCS.rglob("*.md")) <= {target for target, _ in links(DOCS / "index.md")} | {DOCS / "index.md"}


def commands(of: Any, *above: str) -> dict[tuple[str, ...], Any]:
    """Every command of the command line by its words."""
    if not isinstance(of, TyperGroup):
        return {above: of}
    return {words: one for name, below in of.commands.items() for words, one in commands(below, *above, name).items()}


COMMANDS = commands(get_command(cli))


def shell(page: Path) -> Iterator[list[str]]:
    """The words of each call of `grader` in the shell blocks of a page."""
    for kind, text in FENCE.findall(page.read_text(encoding="utf-8")):
        if kind in ("sh", "yaml"):
            for line in re.sub(r"\\\n", " ", text).splitlines():
                if match := re.match(r" *(?:- )?(?:[A-Z_]+=\S+ )*(?:\.venv/bin/)?grader ([^>#]*)", line):
                    yield shlex.split(match[1])


CALLS = [(name_of(page), words) for page in PAGES for words in shell(page)]


@pytest.mark.parametrize(("page", "words"), CALLS, ids=lambda one: one if isinstance(one, str) else " ".join(one))
def test_every_command_exists_with_its_options(page: str, words: list[str]) -> None:
    command = COMMANDS.get(tuple(words[:2])) or COMMANDS[tuple(words[:1])]
    options = {option for parameter in command.params for option in parameter.opts}
    assert {word for word in words if word.startswith("--")} <= options, page


def test_the_page_of_the_command_line_shows_every_command() -> None:
    shown = {" ".join(words) + " " for page, words in CALLS if page == "docs/commands.md"}
    lti = (ROOT / "docs/lti.md").read_text(encoding="utf-8")  # has the commands of `grader lti`
    missing = [" ".join(words) for words in COMMANDS if not any(one.startswith(" ".join(words) + " ") for one in shown)]
    unshown = [words for words in missing if f"grader {words}" not in lti]
    assert unshown == [], "show each of these commands in docs/commands.md, and test it in tests/commands/"


TARGETS = {target for page in PAGES for target in re.findall(r"^make ([a-z-]+)", page.read_text(), re.MULTILINE)}


@pytest.mark.parametrize("target", sorted(TARGETS))
def test_every_make_target_exists(target: str) -> None:
    assert re.search(rf"^{target}:", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)


TREE = [
    f"/{path.relative_to(ROOT)}" for top in ("src", "tests", "deploy", "client") for path in (ROOT / top).rglob("*.*")
]


def code_files(page: Path) -> set[str]:
    """The files of code that the prose of a page names, without the files that the page itself shows how to write."""
    text = page.read_text(encoding="utf-8")
    shown = set(re.findall(r"`([\w./-]+)`(?: is)?:$", text, re.MULTILINE)) | set(re.findall(r'open\("([\w.]+)"', text))
    return set(re.findall(r"`(?:src/grader/)?([\w./-]+\.(?:py|js|css))`", FENCE.sub("", text))) - shown


@pytest.mark.parametrize("page", [page for page in PAGES if page.name != "CHANGELOG.md"], ids=name_of)
def test_every_file_of_code_is_there(page: Path) -> None:
    assert [file for file in sorted(code_files(page)) if not any(path.endswith(f"/{file}") for path in TREE)] == []


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_every_setting_is_one(page: Path) -> None:
    named = set(re.findall(r"GRADER_[A-Z0-9_]*[A-Z0-9]\b(?!_?\.\.\.)", page.read_text(encoding="utf-8")))
    examples = {"GRADER_NAME", "GRADER_TEST_POSTGRES", "GRADER_TEST_REWRITE"}
    assert named - examples <= {f"GRADER_{name.upper()}" for name in Settings.model_fields}
