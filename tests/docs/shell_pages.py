"""Pages of docs/ whose commands are run from top to bottom, and print what the page says."""

import json
import os
import re
import subprocess
import sys
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
ADDRESS = "http://127.0.0.1:8000"
MARK = "-- end of block --"

Printed = list[tuple[str, str, str]]
"""Each block of commands with what it printed, and what the page says that it prints."""


def find_blocks(page: str) -> list[tuple[str, str]]:
    """The blocks of commands, JSON and text of a page: their kind and text."""
    return re.findall(r"```(sh|json|text)\n(.*?)```", (ROOT / "docs" / page).read_text(encoding="utf-8"), re.DOTALL)


def run_page(
    page: str, site: str, folder: Path, shell: str = "bash", after: Mapping[int, str] | None = None
) -> Printed:
    """Runs every block of commands in one shell, on the server `site` with its data in `folder`. `after` has commands
    of the test's own that follow a block."""
    blocks = find_blocks(page)
    commands = [text for kind, text in blocks if kind == "sh"]
    assert commands[0].startswith(f"export SITE={ADDRESS}\n")
    more = after or {}
    script = "set -euo pipefail\n" + "".join(
        f"{text}\necho; echo '{MARK}'\n{more.get(number, '')}\n" for number, text in enumerate(commands)
    )
    path = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
    environment = {**os.environ, "PATH": path, "GRADER_DATA": str(folder / "data"), "GRADER_CONTENT": str(ROOT)}
    done = subprocess.run(
        [shell, "-c", script.replace(ADDRESS, site)], cwd=folder, env=environment, capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    outputs = iter(done.stdout.split(f"\n{MARK}\n")[:-1])
    return [
        (text, next(outputs), shown if following != "sh" else "")
        for (kind, text), (following, shown) in pairwise([*blocks, ("", "")])
        if kind == "sh"
    ]


def check_printed(printed: Printed) -> int:
    """Asserts that each block printed what the page says. Returns how many the page says it of."""
    said = [(command, output, shown) for command, output, shown in printed if shown]
    for command, output, shown in said:
        if shown.startswith(("{", "[")):
            assert fits(json.loads(shown), json.loads(output)), (command, output)
        else:
            assert output.strip() == shown.strip(), command
    return len(said)


def fits(shown: Any, actual: Any) -> bool:
    """Whether everything that is shown is found; "..." stands for any text."""
    if isinstance(shown, dict):
        return isinstance(actual, dict) and all(
            name in actual and fits(one, actual[name]) for name, one in shown.items()
        )
    if isinstance(shown, list) and isinstance(actual, list):
        return all(any(fits(one, other) for other in actual) for one in shown) if shown else not actual
    return bool(shown == actual or (shown == "..." and isinstance(actual, str) and actual))
