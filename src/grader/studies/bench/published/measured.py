"""The pages' tables and figures from the studies' JSON, so that none is typed by hand, and the studies run for them.

`<!-- measured:begin NAME -->` ... `<!-- measured:end NAME -->` in a page is filled with the block NAME, and
`<!--=NAME-->` ... `<!--=-->` in a sentence with the claim NAME.
`python -m grader.studies.bench.published.measured docs docs/measured.md docs/deploy.md` measures, resuming where it was
stopped, and rewrites the pages; with `--tables-only` it renders the committed JSON again. It lists the sentences that
the results deny, which stay as they were, and exits 1 where there are any.
"""

import json
import re
import shutil
import sys
import textwrap
from importlib.util import find_spec
from pathlib import Path

import typer

from grader.numerics.version import INSTALLED
from grader.studies.bench import run
from grader.studies.bench.physics import versions
from grader.studies.bench.published import deadline_tables as _deadline_tables
from grader.studies.bench.published import error_tables as _error_tables
from grader.studies.bench.published import mjx_tables as _mjx_tables
from grader.studies.bench.published.claims import CLAIMS, Denied, Results
from grader.studies.bench.published.interactive import render_page
from grader.studies.bench.published.other import OTHER, REPEATED, describe_other
from grader.studies.bench.published.tables import BLOCKS

__all__ = ["_deadline_tables", "_error_tables", "_mjx_tables"]

STUDIES = (
    *("precision", "quantities", "impacts", "stability", "regions", "energy", "adaptive", "skip", "models"),
    *("batches", "service", "script", "deadline"),
)
"""The studies whose results are committed."""

ADVICE = "advice"
"""The survey of `grader advise`, which `grader.studies.advise.survey` writes: its models are not on this machine."""

COMPARED = {"Pinocchio": "pinocchio", "Drake": "pydrake", "Gymnasium": "gymnasium", "MJX": "mujoco.mjx"}
"""What the pages compare with or measure, and its module."""

PICTURE = re.compile(r"\(measured/([\w.]+)\)")
MARKED = re.compile(r"(<!-- measured:begin (\w+) -->\n).*?(<!-- measured:end \2 -->)", re.DOTALL)
CLAIMED = re.compile(r"(\s*)<!--=(\w+)-->(\s*)(.*?)<!--=-->", re.DOTALL)
PARAGRAPH = re.compile(r"^(\d+\. )?(?!\d+\. |[|#!]|<!-- )\S.*(?:\n(?!\d+\. |[|#!]|<!-- ).+)*", re.MULTILINE)
WIDTH = 120


def load_results(folder: Path) -> Results:
    """Returns the committed JSON of the studies by name; `versions`, digests of runs by MuJoCo's version; and `other`,
    the studies that were repeated with the other version."""
    names = [*STUDIES, ADVICE, *(["versions"] if (folder / "versions.json").exists() else [])]
    results: Results = {"versions": None} | {name: read_json(folder / f"{name}.json") for name in names}
    return results | {"other": {path.stem: read_json(path) for path in sorted((folder / OTHER).glob("*.json"))}}


def read_json(path: Path) -> Results:
    """Returns the content of a file of results."""
    data: Results = json.loads(path.read_text(encoding="utf-8"))
    return data


def fill(page: str, results: Results) -> tuple[str, list[str]]:
    """The page with every marked block and claim rendered anew, and the claims that the results deny, left as they are.
    Raises KeyError for a block or claim that does not exist."""
    denied = []

    def claimed(match: re.Match[str]) -> str:
        space, name, moved, text = match.groups()
        try:
            text = CLAIMS[name](results)
        except Denied as shown:
            denied.append(f"{name}: the page says: {text}\n  the results show: {shown}")
        # A line of Markdown that began with the comment would be HTML: the space stands behind it.
        return f"<!--={name}-->{space or moved}{text}<!--=-->"

    def paragraph(match: re.Match[str]) -> str:
        if not CLAIMED.search(match[0]):
            return match[0]
        text, indent = CLAIMED.sub(claimed, " ".join(match[0].split())), " " * len(match[1] or "")
        return textwrap.fill(text, WIDTH, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)

    def block(match: re.Match[str]) -> str:
        render = BLOCKS[match[2]]
        return f"{match[1]}{render(results)}{describe_other(match[2], render, results)}\n{match[3]}"

    page = MARKED.sub(block, page)
    return PARAGRAPH.sub(paragraph, page), denied


def main(
    docs: Path, pages: list[Path], work: Path = Path(".data/bench"), quick: bool = False, tables_only: bool = False
) -> None:
    """Measure in the folder WORK, copy results and the pictures shown to DOCS/measured, fill the pages, and write the
    interactive one. With MuJoCo OTHER, measure what has no times, and copy it to a folder of its own."""
    texts = {page: page.read_text(encoding="utf-8") for page in pages}
    kept = docs / "measured"
    missing = [name for name, module in COMPARED.items() if find_spec(module) is None and INSTALLED != OTHER]
    if missing and not (quick or tables_only):
        install = "pip install '.[peers]' gymnasium -r requirements-mjx.lock"
        sys.exit(f"the page compares with {', '.join(missing)}: run {install} first")
    if not tables_only:
        other = INSTALLED == OTHER
        for name in REPEATED if other else STUDIES:
            run(name, work, quick)
        shown = [f"{study}.json" for study in (REPEATED if other else STUDIES)]
        shown += [] if other else PICTURE.findall("".join(texts.values()))
        folder = kept / OTHER if other else kept
        folder.mkdir(parents=True, exist_ok=True)
        for name in shown:
            shutil.copyfile(work / name, folder / name)
        versions.main(kept / "versions.json")
    denied, results = [], load_results(kept)
    (docs / "measured.html").write_text(render_page(results), encoding="utf-8")
    for page, text in texts.items():
        filled, against = fill(text, results)
        page.write_text(filled, encoding="utf-8")
        denied += [f"{page}: {sentence}" for sentence in against]
    if denied:
        sys.exit("\n".join(denied))


if __name__ == "__main__":
    typer.run(main)
