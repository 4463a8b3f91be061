"""docs/learning.md: its notebook runs from top to bottom, on a server with its jail, and prints what the page says."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from grader.settings import Settings
from support.sites import open_site
from support.tokens import issue_token

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "learning.md").read_text(encoding="utf-8")
CELLS = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
PRINTED = re.findall(r"```text\n(.*?)```", PAGE, re.DOTALL)
TEMPLATES = ROOT / "src/grader/web/templates"


@pytest.mark.jail
@pytest.mark.slow
def test_the_notebook_hands_in_an_answer_and_a_script(tmp_path: Path) -> None:
    with open_site(Settings(content=ROOT, data=tmp_path / "data", workers=1)) as site:
        token = issue_token(site.settings, "ada", "student", None)
        done = subprocess.run(
            [sys.executable, "-c", "\n".join(CELLS)],
            cwd=tmp_path, env={**os.environ, "SITE": site.origin, "TOKEN": token}, capture_output=True, text=True,
            check=False,
        )  # fmt: skip
    assert done.returncode == 0, done.stderr
    [shown] = PRINTED
    assert done.stdout.startswith(shown)
    script = done.stdout.removeprefix(shown).splitlines()
    assert script[0] == "incorrect 0.0 of 3.0"  # the starter finds nothing
    assert script[1] not in ("", "None")
    assert [line for line in script[2:] if line.startswith("wrong")]


def test_the_buttons_of_the_page_are_there() -> None:
    templates = "".join(path.read_text(encoding="utf-8") for path in TEMPLATES.glob("*.html"))
    for button in re.findall(r"\*\*([A-Z][^*.]*)\*\*", PAGE):
        assert re.search(rf'[>"]{button}["<]', templates), button
