"""The notebook of a kit. It has the kit's files in its first cell, so that it also opens alone, as in Colab."""

import json
from collections.abc import Mapping
from typing import Any

SET_UP = """\
# Run this cell first. It writes the kit's files where only the notebook was opened, and fetches a missing MuJoCo.
import importlib.util
import json
import pathlib
import sys

KIT = json.loads({files!r})
for name, text in KIT.items():
    path = pathlib.Path(name)
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
if importlib.util.find_spec("mujoco") is None:
    if sys.platform == "emscripten":
        print("MuJoCo has no Python package for JupyterLite. Write the function here, and hand it in on the page.")
    else:
        %pip install --quiet mujoco=={mujoco} numpy
"""

CHECK = """\
# {what}. No attempt is used.
try:
    import mjgrader as g
except ModuleNotFoundError:
    print("Without mujoco-grader-client the cell above is your script: hand it in on the exercise's page.")
else:
    display(g.check({entry}, question="{question}"))
"""

SUBMIT = """\
# Hands in. {how}
# g.sign_in("{origin}")
# g.submit({entry}, question="{question}", quiz="{quiz}")
"""


UNCOMMENT = "Take the comment signs away"
EXAMPLE = "https://grader.example.edu"
"""What stands for the address of the server where it is not known."""


def build_notebook(
    task: str, starter: str, exercise: Mapping[str, Any], texts: Mapping[str, str], *, origin: str = ""
) -> str:
    """Returns the notebook as nbformat 4.5: the task, the set-up, the starter, a check of the visible cases, and how to
    hand in, at the server of this `origin` where it is known. Without MuJoCo, as in JupyterLite, the task can be read
    and the function written."""
    files = json.dumps(texts, ensure_ascii=False)
    how = f"{UNCOMMENT}." if origin else f"{UNCOMMENT}, and write the address of your course's page."
    judges_here = any(trial["problem"] is not None for trial in exercise["trials"])
    what = "Judges the visible cases here" if judges_here else "Sees that the script can be imported; the server judges"
    handing_in = {**exercise, "how": how, "origin": origin or EXAMPLE}
    cells = [
        make_cell("task", "markdown", f"# {exercise['title']}\n\n{task}\n"),
        make_cell("set-up", "code", SET_UP.format(files=files, mujoco=exercise["mujoco"])),
        make_cell("script", "code", starter),
        make_cell("check", "code", CHECK.format_map({**exercise, "what": what})),
        make_cell("submit", "code", SUBMIT.format_map(handing_in)),
    ]
    kernel = {"kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"}}
    whole = {"cells": cells, "metadata": kernel, "nbformat": 4, "nbformat_minor": 5}
    return json.dumps(whole, indent=1, ensure_ascii=False) + "\n"


def make_cell(name: str, kind: str, text: str) -> dict[str, Any]:
    """Returns a cell without outputs."""
    cell: dict[str, Any] = {"cell_type": kind, "id": name, "metadata": {}, "source": text.splitlines(keepends=True)}
    return cell | ({"execution_count": None, "outputs": []} if kind == "code" else {})
