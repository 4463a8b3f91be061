"""Runs a script in a fresh process, and judges the visible cases, as the server does."""

import json
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import mujoco

from mjgrader import showing
from mjgrader.errors import NotRunning, Sentence
from mjgrader.kits import Kit, quote_path

OLDEST = (3, 14)
"""The oldest MuJoCo that the judges run with, as pyproject.toml says."""

OUTPUT_CHARS_MAX = 4000
CELLS = "your cells"
"""What a traceback calls the script that was made of a notebook's cells."""

MISSING = ("NameError", "ImportError", "ModuleNotFoundError", "SyntaxError")
"""Errors of a script that is not whole: it would fail on the server as well."""


@dataclass(frozen=True)
class Check:
    """What the visible cases say of a script. Shows itself as text, and in a notebook as HTML."""

    title: str
    findings: tuple[Mapping[str, Any], ...]
    output: str = ""
    remarks: tuple[str, ...] = field(default=())

    @property
    def passed(self) -> bool:
        """Whether every case that is judged here is right."""
        return all(finding["passed"] is not False for finding in self.findings)

    @property
    def obstacle(self) -> str:
        """Why not to hand in: what is missing in any case, or what every case raises; else empty."""
        raised = [finding["message"] for finding in self.findings if finding["raised"]]
        missing = [one for one in raised if one.startswith(MISSING)]
        return next(iter(missing or raised * (len(raised) == len(self.findings))), "")

    def __str__(self) -> str:
        return showing.write_check(self)

    def __repr__(self) -> str:
        return str(self)

    def _repr_html_(self) -> str:
        return showing.draw_check(self)


def check_source(source: str, kit: Kit, file: str = CELLS) -> Check:
    """Judges the visible cases of a script. Raises NotRunning where it does not run alone, and Sentence."""
    exercise = kit.exercise
    refuse_older(exercise["mujoco"])
    trials = [{**trial, "index": index, "hidden": False} for index, trial in enumerate(exercise["trials"])]
    job = {
        **{name: exercise[name] for name in ("kind", "without_integrators", "reveal")},
        "trials": trials, "source": source, "folder": str(kit.folder.resolve()), "file": file,
    }  # fmt: skip
    with tempfile.TemporaryDirectory(prefix="mjgrader-") as folder:
        asked, results = Path(folder, "job.json"), Path(folder, "results.json")
        asked.write_text(json.dumps(job), encoding="utf-8")
        output = start_worker("run", asked, results, exercise["limits"]["wall_s"])
        run = json.loads(results.read_text(encoding="utf-8"))
        if run["status"] != "returned":
            raise NotRunning(run["why"], output)
        start_worker("judge", asked, results, None)
        findings = tuple(json.loads(results.read_text(encoding="utf-8")))
    remarks = list_remarks(exercise)
    return Check(exercise["title"], findings, output, remarks)


def leave_to_server(kit: Kit, file: str = CELLS) -> Check:
    """Returns the check of a model or a file, with the command that hands in `file`, a path from the working folder."""
    path = Path(kit.script if file == CELLS else file)
    is_beside = path.resolve().parent == kit.folder.resolve()
    option = "" if is_beside else f" --question {kit.name}"
    command = f"mjgrade submit {quote_path(path)}{option}"
    remark = f"No attempt is used. Only the server judges {kit.name}: hand it in with `{command}`."
    return Check(kit.exercise["title"], (), remarks=(remark,))


def read_version(text: str) -> tuple[int, ...]:
    """Returns the first two numbers of a version such as "3.14.0"."""
    return tuple(map(int, re.findall(r"\d+", text)[:2]))


def refuse_older(wanted: str) -> None:
    """Raises NotRunning where the MuJoCo that is installed is too old for the judges."""
    if read_version(mujoco.__version__) < OLDEST:
        raise NotRunning(
            f"Your MuJoCo {mujoco.__version__} is too old to check with: `pip install mujoco=={wanted}` gives you that "
            "of the course. Then start Python anew."
        )


def list_remarks(exercise: Mapping[str, Any]) -> tuple[str, ...]:
    """Returns what one should know about the verdict."""
    hidden = f"{exercise['hidden_points']:g} of its {exercise['points']:g} points are for hidden cases"
    remarks = [f"No attempt is used. The server decides, and names the mistake where it knows it; {hidden}."]
    wanted, installed = exercise["mujoco"], mujoco.__version__
    if wanted != installed:
        differs = "the last digits may differ"
        if read_version(wanted)[0] != read_version(installed)[0]:
            differs = "verdicts may differ, not only the last digits: what is wrong here may be right there"
        remarks.append(
            f"The server has MuJoCo {wanted}, you have {installed}: {differs}. `pip install mujoco=={wanted}` makes "
            "them the same."
        )
    return tuple(remarks)


def start_worker(command: str, job: Path, results: Path, seconds: float | None) -> str:
    """Runs a worker to its end, in an empty folder as on the server; returns what it printed. Raises NotRunning."""
    arguments = [sys.executable, "-m", "mjgrader.worker", command, str(job), str(results)]
    environment = {**os.environ, "PYTHONPATH": list_paths(), "PYTHONIOENCODING": "utf-8"}
    try:
        with tempfile.TemporaryDirectory(prefix="mjgrader-") as empty:
            done = subprocess.run(  # noqa: S603 - our own module
                arguments,
                env=environment,
                cwd=empty,
                capture_output=True,
                timeout=seconds,
                check=False,
                stdin=subprocess.DEVNULL,
            )
    except KeyboardInterrupt:
        raise NotRunning("Stopped.") from None
    except subprocess.TimeoutExpired as error:
        raise NotRunning(
            f"Your script did not end within {seconds:g} s: look for a loop that does not end.",
            read_output(error.stdout or b"", error.stderr or b""),
        ) from None
    output = read_output(done.stdout, done.stderr)
    if done.returncode or not results.exists():
        if command == "run":
            raise NotRunning(f"Python ended with status {done.returncode} while your script ran.", output)
        raise Sentence(f"The judge failed; please report this:\n{output}")
    return output


def list_paths() -> str:
    """Returns where the worker finds modules, whatever its folder is. The learner's folder comes last: a file of hers
    replaces no module, and is known as hers."""
    given = os.environ.get("PYTHONPATH", "").split(os.pathsep)
    paths = [str(Path(path).absolute()) for path in (*sys.path, *given) if path]
    return os.pathsep.join([*paths, str(Path.cwd())])


def read_output(stdout: bytes, stderr: bytes) -> str:
    """Returns what was printed, cut in the middle; a traceback that several cases raise comes once."""
    errors = re.split(r"^(?=Traceback )", stderr.decode("utf-8", "replace"), flags=re.MULTILINE)
    text = (stdout.decode("utf-8", "replace") + "".join(dict.fromkeys(errors))).strip()
    half = OUTPUT_CHARS_MAX // 2
    return text if len(text) <= OUTPUT_CHARS_MAX else f"{text[:half]}\n...\n{text[-half:]}"
