"""Kits on this machine: a folder for each exercise, with its exercise.json."""

import io
import json
import sys
import zipfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

from mjgrader.errors import Sentence

FORMAT = 1
"""The version of exercise.json that this client reads."""

DESCRIPTION = "exercise.json"
FIELDS = {
    "question", "quiz", "title", "entry", "mujoco", "kind", "without_integrators", "reveal", "trials", "limits",
    "points", "hidden_points",
}  # fmt: skip
"""What the client reads in exercise.json beside `format`, and `takes`, which older kits lack."""
TRIAL_FIELDS = {"id", "title", "points", "entries", "inputs", "problem"}
OF_THE_LEARNER = (".py", ".ipynb", ".xml", ".npz")
"""Files of a kit that a learner changes: they are never overwritten, but for mjcourse.py and models/."""

SUFFIXES = {"python": ".py", "mjcf": ".xml", "npz": ".npz"}
"""The files that exercises take."""


@dataclass(frozen=True)
class Kit:
    """The kit of one exercise."""

    folder: Path
    exercise: Mapping[str, Any]

    @property
    def name(self) -> str:
        """The exercise's id."""
        return str(self.exercise["question"])

    @property
    def takes(self) -> str:
        """What the exercise takes: `python`, `mjcf` or `npz`."""
        return str(self.exercise.get("takes", "python"))

    @property
    def script(self) -> str:
        """The path of the script, the model or the file that the learner writes."""
        return str(self.folder / f"{self.name.replace('-', '_')}{SUFFIXES.get(self.takes, '')}")

    @property
    def starter(self) -> Path:
        """The path of what the learner begins with: the script that writes an .npz file, which some kits lack."""
        script = Path(self.script)
        return script.with_suffix(".py") if self.takes == "npz" else script

    def tell_next(self) -> str:
        """Returns a sentence on how the file comes about that is handed in; empty where the learner begins with it."""
        script, starter = Path(self.script), self.starter
        if script == starter:
            return ""
        todo = f"edit {starter.name} and run it in its folder" if starter.exists() else "write it with numpy.savez"
        return f"You hand in {script.name}: {todo}, then `mjgrade submit {quote_path(script)}`."


def quote_path(path: Path) -> str:
    """Returns a path as it is typed in a terminal."""
    return f'"{path}"' if " " in str(path) else str(path)


def read_kit(folder: Path) -> Kit:
    """Reads the kit in a folder. Raises Sentence where there is none, a damaged one, or one of another version."""
    path = folder / DESCRIPTION
    damaged = f"{path} is damaged: delete it, and get the kit again with g.start()."
    try:
        exercise = json.loads(path.read_text(encoding="utf-8"))
    except OSError:
        raise Sentence(f'There is no kit in {folder}: get it with g.start("the-exercise").') from None
    except ValueError:
        raise Sentence(damaged) from None
    found = exercise.get("format") if isinstance(exercise, dict) else None
    if found != FORMAT:
        newer = isinstance(found, int) and found > FORMAT
        cure = "pip install --upgrade mujoco-grader-client" if newer else "get the kit again with g.start()"
        raise Sentence(f"The kit in {folder} has format {found}, and this client reads {FORMAT}: {cure}.")
    if not is_whole(exercise):
        raise Sentence(damaged)
    return Kit(folder, exercise)


def is_whole(exercise: Mapping[str, Any]) -> bool:
    """Whether an exercise.json has every field that the client reads."""
    try:
        trials = all(trial.keys() >= TRIAL_FIELDS for trial in exercise["trials"])
        return trials and exercise.keys() >= FIELDS and "wall_s" in exercise["limits"]
    except (KeyError, TypeError, AttributeError):  # a field is missing, or no list or object
        return False


def list_kits(folder: Path) -> Iterator[Kit]:
    """Yields the kits in a folder and in the folders below it."""
    for path in (folder / DESCRIPTION, *sorted(folder.glob(f"*/{DESCRIPTION}"))):
        if path.is_file():
            yield read_kit(path.parent)


def find_kit(folder: Path, question: str | None, entry: str | None = None, quiz: str | None = None) -> Kit:
    """Returns the kit of an exercise, or the only one whose function has this name. Raises Sentence."""
    kits = [kit for kit in list_kits(folder) if quiz is None or kit.exercise["quiz"] == quiz]
    if question is not None:
        found = [kit for kit in kits if kit.name == question]
        if not found:
            raise Sentence(f'The kit of {question} is not in {folder}: get it with g.start("{question}").')
        return found[0]
    if len(kits) > 1 and entry is not None:
        kits = [kit for kit in kits if kit.exercise["entry"] == entry]
    if not kits:
        raise Sentence('No kit fits: get it with g.start("the-exercise"), or name it with question="the-exercise".')
    if len(kits) > 1:
        names = ", ".join(kit.name for kit in kits)
        raise Sentence(f'Several exercises fit ({names}): name one with question="{kits[0].name}".')
    return kits[0]


def unpack_kit(data: bytes, folder: Path) -> Kit:
    """Writes a kit to a folder; what the learner has changed there stays. Raises Sentence."""
    try:
        packed = zipfile.ZipFile(io.BytesIO(data))
    except zipfile.BadZipFile:
        raise Sentence("The server sent no kit. Is the address that of your course?") from None
    with packed:
        for name in packed.namelist():
            parts = PurePosixPath(name).parts
            if name.startswith("/") or "\\" in name or ":" in name or ".." in parts or len(parts) < 2:
                raise Sentence(f"The kit has a file with an odd name, {name!r}: it was not unpacked.")
        for name in packed.namelist():
            path = folder.joinpath(*PurePosixPath(name).parts[1:])  # the first one is named as the exercise
            is_ours = path.name == "mjcourse.py" or path.parent.name == "models"
            if path.exists() and path.suffix in OF_THE_LEARNER and not is_ours:
                continue
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(packed.read(name))
    return read_kit(folder)


def add_course_module(kit: Kit) -> None:
    """Lets `from mjcourse import model_path` find the models of this kit."""
    folder = str(kit.folder.resolve())
    sys.path[:] = [folder, *(path for path in sys.path if path != folder)]
    sys.modules.pop("mjcourse", None)
