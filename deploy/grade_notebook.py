"""Grades the function cells of notebooks: prints a line of JSON for each, with the points.

python grade_notebook.py QUIZ QUESTION CELL NOTEBOOK.ipynb ...

CELL is the `grade_id` that nbgrader gave the cell in which the student writes the function. Nothing of the notebook is
run but this cell, by `grader grade`, in its jail.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

FAULT = 3


def source_of(notebook: dict[str, Any], grade_id: str) -> str:
    """The text of the code cell with this grade_id. Raises LookupError unless there is just one."""
    found = [
        cell["source"] if isinstance(cell["source"], str) else "".join(cell["source"])
        for cell in notebook["cells"]
        if cell["cell_type"] == "code" and cell["metadata"].get("nbgrader", {}).get("grade_id") == grade_id
    ]
    if len(found) != 1:
        raise LookupError(f"{len(found)} code cells have the grade_id {grade_id!r}: there must be one")
    return found[0]


def without_magics(source: str) -> str:
    """The cell without lines that only IPython understands, such as `%matplotlib inline` and `!pip`."""
    lines = source.splitlines(keepends=True)
    return "".join("\n" if line.lstrip().startswith(("%", "!")) else line for line in lines)


def graded(quiz: str, question: str, source: str) -> dict[str, Any]:
    """The verdict on a script. Raises RuntimeError if there is none, with the reason."""
    with tempfile.TemporaryDirectory() as folder:
        script = Path(folder, "answer.py")
        script.write_text(source, encoding="utf-8")
        command = ["grader", "grade", quiz, question, str(script), "--json"]
        done = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603
    if done.returncode >= 2:
        raise RuntimeError(done.stderr.strip() or f"grader grade exits with {done.returncode}")
    verdict: dict[str, Any] = json.loads(done.stdout)
    return verdict


def main(quiz: str, question: str, cell: str, *notebooks: str) -> int:
    """Grades each notebook; one that cannot be graded has a reason in place of points, and keeps no other waiting."""
    code = 0
    for name in notebooks:
        told: dict[str, Any] = {"notebook": name, "points": None, "max_points": None, "status": None, "message": None}
        try:
            notebook = json.loads(Path(name).read_text(encoding="utf-8"))
            verdict = graded(quiz, question, without_magics(source_of(notebook, cell)))
            told |= {key: verdict[key] for key in ("points", "max_points", "status")} | {
                "message": verdict["diagnosis"]
            }
        except (OSError, ValueError, LookupError, TypeError, AttributeError, RuntimeError) as error:
            told["message"], code = f"{type(error).__name__}: {error}", FAULT
        print(json.dumps(told, ensure_ascii=False), flush=True)
    return code


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
