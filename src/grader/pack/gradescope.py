"""The autograder of one exercise for Gradescope: two scripts, the grader as a wheel, and what grading needs. Source:
gradescope-autograders.readthedocs.io, "Autograder Specifications": setup.sh and run_autograder lie at the root of the
zip file, which becomes /autograder/source; scripts arrive in /autograder/submission."""

import json
import secrets
import shlex
import zipfile
from dataclasses import dataclass, replace
from importlib.metadata import distribution, entry_points
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from grader.errors import Conflict, Unprocessable
from grader.exercises import GROUP
from grader.library import Library, load
from grader.library.quiz_files import parse_quiz
from grader.pack.wheel import list_constraints, make_entry, write_wheel
from grader.questions.kinds.script import ScriptQuestion

SCRIPTS = Path(__file__).parent / "scripts"
KEY_BYTES = 32
OURS = "mujoco-grader"

LEFT_OUT = ("explain", "rubric", "starter", "verify")
"""Keys of a question that a verdict on a script does not depend on."""

KEPT = ("id", "title", "policy")
"""Keys of a quiz; Gradescope itself keeps its dates and attempts."""

MODELS = "models/"

EXECUTABLE, READABLE, PRIVATE = 0o755, 0o644, 0o600


@dataclass(frozen=True)
class PackedFile:
    """One file of the package."""

    path: str
    data: bytes
    mode: int = READABLE


def pack_gradescope(library: Library, quiz: str, question: str, out: Path, *, allow_t2: bool = False) -> Path:
    """Writes the autograder of an exercise to `out`: a zip file if it is named so, else a folder. Returns its path.
    `allow_t2` accepts a container without user namespaces. Raises NotFound, Unprocessable for a question without a
    script, and Conflict if there is something at `out`."""
    asked = library.question(quiz, question)
    if not isinstance(asked, ScriptQuestion):
        raise Unprocessable(f"{quiz} {question} is no exercise: Gradescope's autograder takes scripts.")
    if out.exists():
        raise Conflict(f"{out} is there already: name another place with --out, or remove it.")
    files = [
        *build_scripts(quiz, asked, allow_t2=allow_t2),
        *build_content(library, quiz, asked),
        *build_wheels(asked.check.kind),
        PackedFile("key", secrets.token_bytes(KEY_BYTES), PRIVATE),
    ]
    (write_zip if out.suffix == ".zip" else write_folder)(out, files)
    return out


def build_scripts(quiz: str, question: ScriptQuestion, *, allow_t2: bool) -> list[PackedFile]:
    """Returns the scripts that Gradescope calls, and what this exercise says to them."""
    suffixes = ".py .ipynb" if question.takes == "python" else " ".join(question.form.suffixes)
    values = {
        "QUIZ": quiz, "QUESTION": question.id, "SUFFIXES": suffixes, "GRADER_ALLOW_T2": str(allow_t2).lower()
    }  # fmt: skip
    text = "".join(f"{name}={shlex.quote(value)}\n" for name, value in values.items())
    members = [
        PackedFile(path.name, path.read_bytes(), EXECUTABLE) for path in sorted(SCRIPTS.iterdir()) if path.is_file()
    ]
    return [*members, PackedFile("exercise.sh", text.encode())]


def build_content(library: Library, quiz: str, question: ScriptQuestion) -> list[PackedFile]:
    """Returns a content folder with this question alone, and the models, which scripts may read. No other question, no
    explanation, no starter and nothing of reference_solutions/ is in it; what judging needs of the author's is."""
    file = library.file(quiz)
    sources = {path: text for path, text in library.sources[quiz].items() if isinstance(text, str)}  # no pictures
    raw: dict[str, Any] = parse_quiz(sources[file], file).raw or {}
    place = [candidate.id for candidate in library.quiz(quiz).questions].index(question.id)
    asked = {key: value for key, value in raw["questions"][place].items() if key not in LEFT_OUT}
    reduced: dict[str, Any] = {key: raw[key] for key in KEPT if key in raw}
    reduced["questions"] = [{**asked, "id": question.id}]
    named = json.dumps(reduced)
    texts = {path: text for path, text in sources.items() if path.startswith(MODELS) or json.dumps(path) in named}
    texts[str(Path(file).with_suffix(".json"))] = json.dumps(reduced, ensure_ascii=False, indent=2)
    files = [PackedFile(path, text.encode(), choose_mode(path)) for path, text in texts.items()]
    with TemporaryDirectory(prefix="grader-pack-") as folder:
        write_folder(Path(folder, "content"), files)
        load(Path(folder, "content"))  # what was left out must not be missed
    return [replace(file, path=f"content/{file.path}") for file in files]


def choose_mode(path: str) -> int:
    """Models are for everybody: in the jail the script is another user."""
    return READABLE if path.startswith(MODELS) else PRIVATE


def build_wheels(kind: str) -> list[PackedFile]:
    """The grader as a wheel, the package that the kind of exercise comes from, and the versions of all they need."""
    packages = {OURS: "grader"}
    for point in entry_points(group=GROUP, name=kind):
        assert point.dist is not None
        packages.setdefault(point.dist.name, point.module.partition(".")[0])
    with TemporaryDirectory(prefix="grader-pack-") as folder:
        wheels = [write_wheel(distribution(name), module, Path(folder)) for name, module in packages.items()]
        packed = [PackedFile(f"wheels/{path.name}", path.read_bytes()) for path in wheels]
    return [*packed, PackedFile("constraints.txt", list_constraints(list(packages)).encode())]


def write_folder(folder: Path, files: list[PackedFile]) -> None:
    """Writes the files below a new folder, each with its mode from the start."""
    folder.mkdir(mode=0o755, parents=True)
    for file in files:
        path = folder / file.path
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch(mode=file.mode)
        path.write_bytes(file.data)
        path.chmod(file.mode)


def write_zip(path: Path, files: list[PackedFile]) -> None:
    """Writes the files as a zip with their modes, at the root of it, where Gradescope looks for them."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.touch(mode=PRIVATE)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as packed:
        for file in files:
            packed.writestr(make_entry(file.path, file.mode), file.data)
