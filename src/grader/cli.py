"""The command line: `grader serve | worker | grade | check | import | token | advise | bench`."""

import json
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer
from pydantic import ValidationError
from rich.console import Console

from grader.domain.verdict import Status, Verdict
from grader.errors import CallerError, ContentError, InvalidAnswer, JailFault, Unprocessable
from grader.library import Library, load
from grader.pipeline import Pipeline
from grader.settings import Settings, log_to_stderr

CORRECT, OTHER_VERDICT, USAGE, FAULT = range(4)
INTERRUPTED = 130
STDERR = 2

cli = typer.Typer(
    help="Auto-grading of a MuJoCo course.", no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False
)
token = typer.Typer(help="Bearer tokens.", no_args_is_help=True)
cli.add_typer(token, name="token")

err = Console(stderr=True)
Json = Annotated[bool, typer.Option("--json", help="Print one JSON document on stdout.")]
Data = Annotated[Path | None, typer.Option(help="Folder of the database.")]


def main() -> None:
    """Run a command; every error becomes a line on stderr and the contract's exit code."""
    hold_standard_streams()
    log_to_stderr()
    try:
        cli()
    except ValidationError as error:
        for wrong in error.errors():
            where = "_".join(("GRADER", *map(str, wrong["loc"]))).upper()
            err.print(f"{where}: {wrong['msg']}", style="red", markup=False, soft_wrap=True)
        sys.exit(USAGE)
    except ContentError as error:
        for fault in error.faults:
            err.print(str(fault), style="red", markup=False, soft_wrap=True)
        sys.exit(USAGE)
    except (CallerError, InvalidAnswer, OSError, UnicodeDecodeError) as error:
        err.print(str(error), style="red", markup=False, soft_wrap=True)
        sys.exit(USAGE)
    except JailFault as error:
        err.print(str(error), style="red", markup=False, soft_wrap=True)
        sys.exit(FAULT)


def hold_standard_streams() -> None:
    """Where a caller closed one, the next file or socket would get its number, and be written to as if it were it."""
    while (descriptor := os.open(os.devnull, os.O_RDWR)) <= STDERR:
        pass
    os.close(descriptor)


def settings_with(**overrides: Any) -> Settings:
    """The settings from the environment, with the options that were given on the command line."""
    return Settings(**{name: value for name, value in overrides.items() if value is not None})


def say(message: str) -> None:
    """A line of progress."""
    err.print(message, style="dim", markup=False, highlight=False, soft_wrap=True)


@contextmanager
def pipeline_for(library: Library, jailed: bool = True) -> Iterator[Pipeline]:
    """A pipeline without server or database; the jail starts only where a script is to run."""
    if not jailed:
        yield Pipeline(library)
        return
    from grader.sandbox.jail import Jail

    with Jail(library.root / "models", allow_t2=Settings().allow_t2) as jail:
        yield Pipeline(library, jail.run)


@cli.command()
def serve(
    host: Annotated[str | None, typer.Option(help="Address to bind: 127.0.0.1 if not given.")] = None,
    port: Annotated[int | None, typer.Option(help="Port to bind: 8000 if not given.")] = None,
    data: Data = None,
) -> None:
    """API, pages and an embedded worker."""
    from grader.app import run_server

    run_server(settings_with(host=host, port=port, data=data))


@cli.command()
def worker(data: Data = None) -> None:
    """One more grading worker beside a server that shares its database."""
    from grader.worker import run_worker

    run_worker(settings_with(data=data))


@cli.command()
def grade(
    quiz: str,
    question: str,
    answer: Annotated[str, typer.Argument(help="A file for an exercise, else the answer itself.")],
    as_json: Json = False,
    seed: Annotated[int | None, typer.Option(min=0, help="Draws the hidden cases of an exercise.")] = None,
) -> None:
    """Grade one answer with no server and no database. Exits 0 where it is correct, else 1."""
    library = load(Settings().content)
    instant = Pipeline(library).is_instant(library.question(quiz, question))
    given: Any = answer if instant else {"source": read_script(Path(answer))}
    with pipeline_for(library, jailed=not instant) as pipeline:
        verdict = pipeline.grade(quiz, question, given, seed)
    print(verdict.model_dump_json(indent=2)) if as_json else show(verdict)
    if verdict.status is Status.GRADER_FAULT:
        sys.exit(FAULT)
    sys.exit(CORRECT if verdict.status is Status.CORRECT else OTHER_VERDICT)


def read_script(path: Path) -> str:
    """The text of a script. Raises OSError, Unprocessable."""
    try:
        return path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise Unprocessable(f"{path} is not UTF-8 text: {error}") from error


def show(verdict: Verdict) -> None:
    """A verdict for a person at a terminal."""
    out = Console(markup=False, highlight=False, soft_wrap=True)
    out.print(f"{verdict.status}: {verdict.points:g} of {verdict.max_points:g} points")
    if verdict.read_as:
        out.print(f"read as: {verdict.read_as}")
    if verdict.diagnosis:
        out.print(verdict.diagnosis)
    for finding in verdict.findings:
        mark = {True: "+", False: "-", None: "?"}[finding.passed]
        out.print(f"  {mark} {finding.title}: {finding.message}")
    for name, text in (("stdout", verdict.stdout), ("stderr", verdict.stderr)):
        if text:
            out.print(f"--- {name}\n{text.rstrip()}")


@cli.command()
def check(paths: Annotated[list[Path] | None, typer.Argument()] = None, as_json: Json = False) -> None:
    """Load every quiz and model, re-derive every key, grade every reference solution."""
    from grader.check import check_content

    reports = [check_content(path, pipeline_for, say) for path in paths or [Settings().content]]
    faults = [fault for report in reports for fault in report.faults]
    if as_json:
        documents = [report.to_json() for report in reports]
        print(json.dumps(documents if len(documents) > 1 else documents[0], indent=2))
    else:
        for warning in [warning for report in reports for warning in report.warnings]:
            err.print(f"warning: {warning}", style="yellow", markup=False, soft_wrap=True)
        for fault in faults:
            print(fault)
        say(f"{len(faults)} fault(s)" if faults else "all holds")
    sys.exit(USAGE if faults else 0)


@cli.command("import")
def import_(
    lesson: Path,
    out: Annotated[Path, typer.Option(help="Folder for the quiz files.")] = Path("quizzes"),
) -> None:
    """Pull the fenced quiz and lab blocks out of a lesson written in Markdown into quiz JSON."""
    from grader.lesson import import_lesson

    quizzes = import_lesson(lesson.read_text(encoding="utf-8"), lesson.stem)
    out.mkdir(parents=True, exist_ok=True)
    for quiz_id, quiz in quizzes.items():
        path = out / f"{quiz_id}.json"
        path.write_text(json.dumps(quiz, ensure_ascii=False, indent=2) + "\n", encoding="utf-8")
        print(path)


@cli.command()
def advise(
    model: Annotated[str, typer.Argument(help="A model of the content folder, or the path of an MJCF file.")],
    quantity: Annotated[str | None, typer.Option(help="What you care about: a lab expression.")] = None,
    tol: Annotated[float | None, typer.Option(help="Its largest error, in its own unit.")] = None,
    seconds: Annotated[float | None, typer.Option(help="Length of the run [s].")] = None,
) -> None:
    """Pick integrator and timestep by the lesson's procedure, with the measurements."""
    from grader.advise import advise as measure

    named = Settings().content / "models" / f"{model}.xml"
    print(measure(named if named.is_file() else Path(model), quantity, tol, seconds))


@cli.command()
def bench(
    name: Annotated[str, typer.Argument(help="precision, stability, skip or service")],
    out: Annotated[Path, typer.Option(help="Folder for JSON, CSV and pictures.")] = Path("out"),
    quick: Annotated[bool, typer.Option(help="A part of it, in under a minute.")] = False,
) -> None:
    """Measure, with a progress bar; interrupted and started again, it goes on where it was."""
    from grader.bench import run

    try:
        run(name, out, quick)
    except KeyboardInterrupt:
        sys.exit(INTERRUPTED)


@token.command("create")
def token_create(
    user: Annotated[str, typer.Option()],
    role: Annotated[str, typer.Option(help="student, instructor or service")],
    course: Annotated[str | None, typer.Option()] = None,
    data: Data = None,
) -> None:
    """Print a new bearer token, nothing else, on stdout."""
    from grader.app import issue_token

    print(issue_token(settings_with(data=data), user, role, course))


@token.command("revoke")
def token_revoke(
    user: Annotated[str, typer.Option()],
    course: Annotated[str | None, typer.Option()] = None,
    data: Data = None,
) -> None:
    """End every token and browser session of a user; says how many there were."""
    from grader.app import revoke_tokens

    ended = revoke_tokens(settings_with(data=data), user, course)
    print(f"{ended} of {user} ended")
    sys.exit(0 if ended else USAGE)
