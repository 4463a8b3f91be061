"""The kit of an exercise: what a learner needs on a machine of her own. The same content gives the same bytes."""

import io
import json
import re
import zipfile
from dataclasses import dataclass, field
from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from grader.domain.pages.markup import plain_text
from grader.errors import NotFound
from grader.exercises import describe_exercise, list_visible_models
from grader.library import Library
from grader.numerics.version import INSTALLED
from grader.pack.notebook import build_notebook
from grader.pack.wheel import make_entry
from grader.questions.kinds.script import ScriptQuestion

FORMAT = 1
"""The version of exercise.json, which the client compares with its own."""

COURSE_MODULE = files("grader.pack").joinpath("kit_files/mjcourse.py").read_text(encoding="utf-8")

README = """# {title}

- `{quiz} {question}`, {points:g} points; {hidden:g} of them are for hidden cases, which only the server runs.
- `{script}` is where you begin: `pip install mujoco=={mujoco} numpy`, then `python {script}`.
- `{notebook}` has the task and the same script, for Jupyter, VS Code and Colab.
- `mjcourse.py` finds the models in `models/`, as the course's own module does on the server.
- `exercise.json` has the visible cases, and says how they are judged.
- With `mujoco-grader-client`, a wheel that your course gives you: `mjgrade check {script}` {checks}
  and uses no attempt; `mjgrade submit {script}` hands in. Without it, hand in on the exercise's page.
{address}- {decides}
"""

JUDGED_HERE = {
    "checks": "judges the visible cases here",
    "decides": """The server decides. It has MuJoCo {mujoco}; with another version the last digits may differ, with
  another major version verdicts too: then `pip install mujoco=={mujoco}`.""",
}
JUDGED_THERE = {
    "checks": "sees that the script can be imported, judges nothing",
    "decides": """The server judges, all cases. It has MuJoCo {mujoco}; with another version the last digits may differ,
  with another major version also whether an answer is right: then `pip install mujoco=={mujoco}`.""",
}
"""What the client's `check` does where it can judge a visible case, and where only the server judges."""

ON_THE_SERVER = """\
- `mjgrade submit {script}`, of the wheel `mujoco-grader-client` that your course gives you, hands in. Without it,
  hand in on the exercise's page.
{address}- {decides}
"""

READMES = {
    "mjcf": """# {title}

- `{quiz} {question}`, {points:g} points.
- `{script}` is the MJCF where you begin. To look at it: `pip install mujoco=={mujoco}`, then
  `python -m mujoco.viewer --mjcf={script}`.
"""
    + ON_THE_SERVER,
    "npz": """# {title}

- `{quiz} {question}`, {points:g} points.
- You hand in `{script}`, a file that `numpy.savez` writes{begin}. `mjcourse.py` finds the models in `models/`, for
  which you need `pip install mujoco=={mujoco}`.
"""
    + ON_THE_SERVER,
}


ADDRESS = """- Its page: {origin}/quizzes/{quiz}/{question}. `mjgrade sign-in {origin}` signs you in from a terminal.
"""


@dataclass(frozen=True)
class _Kit:
    """An exercise of content that a digest names."""

    quiz: str
    question: str
    digest: str
    judged: bool
    origin: str
    library: Library = field(compare=False)


def build_kit(library: Library, quiz: str, question: str, *, judged: bool, origin: str = "") -> bytes:
    """Returns the kit of an exercise, a zip file of one folder of its name. `judged` is whether it may say how the
    visible cases are judged, as feedback does; `origin` is that of the server, if its README is to name it. Raises
    NotFound, also for a question that is no exercise."""
    return _build(_Kit(quiz, question, library.digest(quiz), judged, origin, library))


@lru_cache(maxsize=64)
def _build(kit: _Kit) -> bytes:
    texts = list_texts(kit.library, kit.quiz, kit.question, judged=kit.judged, origin=kit.origin)
    written = io.BytesIO()
    with zipfile.ZipFile(written, "w", zipfile.ZIP_DEFLATED) as packed:
        for path, text in texts.items():
            packed.writestr(make_entry(f"{kit.question}/{path}"), text)
    return written.getvalue()


def list_texts(library: Library, quiz: str, name: str, *, judged: bool, origin: str = "") -> dict[str, str]:
    """Returns the files of a kit by their paths. Raises NotFound."""
    question = library.question(quiz, name)
    if not isinstance(question, ScriptQuestion):
        raise NotFound(f"{quiz} {name} is no exercise: only exercises have a kit.")
    starter = library.starter(question) or write_starter(question)
    title = plain_text(question.title or question.id)
    exercise = {
        "format": FORMAT,
        "mujoco": INSTALLED,
        "quiz": quiz,
        "question": name,
        "title": title,
        "entry": question.entry,
        "takes": question.takes,
        "points": question.points,
        "limits": question.limits.model_dump(),
        "reveal": question.reveal or "size",
        **describe_exercise(question, library.model_xml, library.text, judged=judged),
    }
    script = f"{name.replace('-', '_')}{question.form.suffix}"
    notebook = f"{name}.ipynb"
    named = list_visible_models(question) | {model for model in library.models if is_named(model, starter)}
    texts = {
        "exercise.json": json.dumps(exercise, indent=1, ensure_ascii=False, allow_nan=False) + "\n",
        "mjcourse.py": COURSE_MODULE,
        **{f"models/{model}.xml": library.model_xml(model) for model in sorted(named)},
    }
    address = ADDRESS.format(origin=origin, quiz=quiz, question=name) if origin else ""
    judges_here = question.takes == "python" and any(trial["problem"] is not None for trial in exercise["trials"])
    sentences = JUDGED_HERE if judges_here else JUDGED_THERE
    values: dict[str, Any] = {
        **exercise,
        **{key: sentence.format_map(exercise) for key, sentence in sentences.items()},
        "address": address,
        "hidden": exercise["hidden_points"],
        "script": script,
        "notebook": notebook,
    }
    if question.takes != "python":
        begins = {script: starter} if question.takes == "mjcf" else {f"{Path(script).stem}.py": starter}
        values["begin"] = f"; `{Path(script).stem}.py` is where you begin" if starter else ""
        return {"README.md": READMES[question.takes].format_map(values), **(begins if starter else {}), **texts}
    return {
        "README.md": README.format_map(values),
        script: starter,
        notebook: build_notebook(question.q, starter, exercise, texts, origin=origin),
        **texts,
    }


def write_starter(question: ScriptQuestion) -> str:
    """Returns what to begin with where the author gives nothing; empty for a file."""
    if question.takes == "python":
        return f"def {question.entry}(*arguments):\n    raise NotImplementedError\n"
    return "<mujoco>\n  <worldbody>\n  </worldbody>\n</mujoco>\n" if question.takes == "mjcf" else ""


def is_named(model: str, starter: str) -> bool:
    """Whether a starter names a model, as in model_path("pendulum")."""
    return re.search(rf"""["']{re.escape(model)}(\.xml)?["']""", starter) is not None
