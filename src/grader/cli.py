"""The command line: `grader serve | worker | grade | check | import | extend | token | invite | advise | bench`.

`operate.py` adds `backup | migrate | prune | erase | rotate-secret`.
"""

import json
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import timedelta
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer
from pydantic import ValidationError
from pydantic_settings import SettingsError
from rich.console import Console

from grader.domain.policy import Extension
from grader.domain.quiz import CodeQuestion
from grader.domain.verdict import Status, Verdict
from grader.errors import CallerError, ContentError, InvalidAnswer, JailFault, Unprocessable
from grader.library import Library, load
from grader.logs import log_to_stderr
from grader.operate import operate
from grader.pipeline import Pipeline
from grader.settings import PREFIX, Settings

CORRECT, OTHER_VERDICT, USAGE, FAULT = range(4)
INTERRUPTED = 130
STDERR = 2

cli = typer.Typer(
    help="Auto-grading of a MuJoCo course.", no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False
)
token = typer.Typer(help="Bearer tokens.", no_args_is_help=True)
cli.add_typer(token, name="token")
cli.add_typer(operate)

err = Console(stderr=True)
Json = Annotated[bool, typer.Option("--json", help="Print one JSON document on stdout.")]
Course = Annotated[str | None, typer.Option(help="Name of the course.")]
Data = Annotated[Path | None, typer.Option(help="Folder of the database.")]


def main() -> None:
    """Runs a command. Every error becomes a line on stderr and an exit code."""
    open_missing_standard_streams()
    log_to_stderr()
    try:
        cli()
    except ValidationError as error:
        for wrong in error.errors():
            told = wrong["msg"].removeprefix("Value error, ")
            where = f"{PREFIX}{'_'.join(map(str, wrong['loc']))}: ".upper() if wrong["loc"] else ""
            err.print(f"{where}{told}", style="red", markup=False, soft_wrap=True)
        sys.exit(USAGE)
    except SettingsError as error:  # not JSON where JSON is needed
        fields = [(name, field) for name, field in Settings.model_fields.items() if f'"{name}"' in str(error)]
        for name, field in fields:
            err.print(f"{PREFIX}{name.upper()}: {field.description}", style="red", markup=False, soft_wrap=True)
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


def open_missing_standard_streams() -> None:
    """Opens closed standard streams on /dev/null. Otherwise the next file would get their number, and their output."""
    while (descriptor := os.open(os.devnull, os.O_RDWR)) <= STDERR:
        pass
    os.close(descriptor)


def settings_with(**overrides: Any) -> Settings:
    """The settings from the environment, overridden by the options of the command line."""
    return Settings(**{name: value for name, value in overrides.items() if value is not None})


def say(message: str) -> None:
    """Prints a line of progress on stderr."""
    err.print(message, style="dim", markup=False, highlight=False, soft_wrap=True)


@contextmanager
def pipeline_for(library: Library, jailed: bool = True) -> Iterator[Pipeline]:
    """A pipeline without server or database; the jail starts only if a script is to run."""
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
    """Serve the API and the pages, with an embedded worker."""
    from grader.app import run_server

    run_server(settings_with(host=host, port=port, data=data))


@cli.command()
def worker(data: Data = None) -> None:
    """Run one more grading worker on the database of a server."""
    from grader.worker import run_worker

    run_worker(settings_with(data=data))


@cli.command()
def grade(
    quiz: str,
    question: str,
    answer: Annotated[str, typer.Argument(help="A file for an exercise, else the answer itself.")],
    as_json: Json = False,
    seed: Annotated[
        int | None,
        typer.Option(min=0, help="Repeats the hidden cases of an earlier verdict; drawn at random if not given."),
    ] = None,
) -> None:
    """Grade one answer with no server and no database. Exits 0 if it is correct, else 1."""
    library = load(Settings().content)
    is_script = isinstance(library.question(quiz, question), CodeQuestion)
    given: Any = {"source": read_script(Path(answer))} if is_script else answer
    with pipeline_for(library, jailed=is_script) as pipeline:
        submission = pipeline.read(quiz, question, given, seed)
        verdict = pipeline.judge_with_retries(submission)
    if as_json:
        document = json.loads(verdict.model_dump_json()) | {"seed": submission.seed}
        print(json.dumps(document, ensure_ascii=False, indent=2))
    else:
        show(verdict, submission.seed)
    if verdict.status is Status.GRADER_FAULT:
        sys.exit(FAULT)
    sys.exit(CORRECT if verdict.status is Status.CORRECT else OTHER_VERDICT)


def read_script(path: Path) -> str:
    """Reads the text of a script. Raises OSError, Unprocessable."""
    try:
        return path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise Unprocessable(f"{path} is not UTF-8 text: {error}") from error


def show(verdict: Verdict, seed: int | None) -> None:
    """Prints a verdict for a person at a terminal, with the seed that repeats it."""
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
    if seed is not None:
        out.print(f"hidden cases: --seed {seed}")


@cli.command()
def check(paths: Annotated[list[Path] | None, typer.Argument()] = None, as_json: Json = False) -> None:
    """Load every quiz and model, re-derive every answer key, grade every reference solution."""
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
    """Write the fenced quiz and lab blocks of a Markdown lesson as quiz JSON."""
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
    quantity: Annotated[str | None, typer.Option(help="The quantity of interest, as a lab expression.")] = None,
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
    quick: Annotated[bool, typer.Option(help="A small part of the benchmark.")] = False,
) -> None:
    """Run a benchmark. Interrupted and started again, it continues where it stopped."""
    from grader.bench import run

    try:
        run(name, out, quick)
    except KeyboardInterrupt:
        sys.exit(INTERRUPTED)


@cli.command()
def extend(
    quiz: str,
    user: Annotated[str, typer.Option(help="The learner, by the name of their token.")],
    due: Annotated[str | None, typer.Option(help="A later due date, such as 2026-10-26T18:00+01:00.")] = None,
    until: Annotated[str | None, typer.Option(help="Late answers are taken until then.")] = None,
    attempts: Annotated[int, typer.Option(help="Further attempts at every question.")] = 0,
    *,
    course: Annotated[str | None, typer.Option()] = None,
    data: Data = None,
) -> None:
    """Give one learner an extension of a quiz; with no option but --user, take an earlier one back."""
    from grader.app import give_extension

    granted = extension_of(due, until, attempts)
    give_extension(settings_with(data=data), (course, quiz, user), granted)
    print(granted.model_dump_json())


def extension_of(due: str | None, until: str | None, attempts: int) -> Extension:
    """The extension that the options describe. Raises Unprocessable."""
    try:
        return Extension.model_validate({"due": due, "until": until, "attempts": attempts})
    except ValidationError as error:
        raise Unprocessable("; ".join(f"--{wrong['loc'][0]}: {wrong['msg']}" for wrong in error.errors())) from error


@token.command("create")
def token_create(
    user: Annotated[str, typer.Option()],
    role: Annotated[str, typer.Option(help="student, instructor or service")],
    course: Course = None,
    data: Data = None,
    *,
    scope: Annotated[
        list[str] | None, typer.Option(help="What the token is restricted to; repeat it. All of the role if not given.")
    ] = None,
    expires: Annotated[str | None, typer.Option(help="Lifetime, as 12h, 30d or 26w. Unlimited if not given.")] = None,
) -> None:
    """Print a new bearer token, and nothing else, on stdout."""
    from grader.app import in_database
    from grader.courses.tokens import create_token

    lifetime = None if expires is None else lifetime_of(expires)
    create = partial(create_token, user=user, role=role, course=course, scopes=scope or None, lifetime=lifetime)
    print(in_database(settings_with(data=data), create))


def lifetime_of(text: str) -> timedelta:
    """A duration such as `12h`, `30d` or `26w`. Raises Unprocessable."""
    units = {"h": timedelta(hours=1), "d": timedelta(days=1), "w": timedelta(weeks=1)}
    number, unit = text[:-1], text[-1:]
    if not (number.isascii() and number.isdecimal() and 0 < int(number[:6]) < 100_000 and unit in units):
        raise Unprocessable(f"A lifetime is a whole number and h, d or w, as in 30d; {text!r} is not one.")
    return int(number) * units[unit]


@token.command("list")
def token_list(course: Course = None, data: Data = None, as_json: Json = False) -> None:
    """List the valid tokens of a course, one a line: id, user, role, scopes, expiry and last use."""
    from grader.app import in_database
    from grader.courses.tokens import shown, tokens
    from grader.identity import DEFAULT_COURSE

    rows = in_database(
        settings_with(data=data), lambda session: [shown(one) for one in tokens(session, course or DEFAULT_COURSE)]
    )
    if as_json:
        print(json.dumps(rows, indent=2, default=str))
        return
    for row in rows:
        times = (f"{row[key]:%Y-%m-%dT%H:%MZ}" if row[key] else "never" for key in ("expires_at", "last_used_at"))
        scopes = "all" if row["scopes"] is None else ",".join(row["scopes"])
        print("\t".join((row["id"], row["name"], row["role"], scopes, *times)))


@token.command("revoke")
def token_revoke(
    user: Annotated[str | None, typer.Option(help="Ends every token, session and link of this user.")] = None,
    token_id: Annotated[str | None, typer.Option("--id", help="Ends this one token, by its id.")] = None,
    course: Course = None,
    data: Data = None,
) -> None:
    """Revoke every token and browser session of a user, or one token, and print how many there were."""
    from grader.app import in_database, revoke_tokens
    from grader.courses.tokens import revoke
    from grader.identity import DEFAULT_COURSE

    if (user is None) == (token_id is None):
        raise Unprocessable("Give either --user or --id.")
    settings = settings_with(data=data)
    if token_id is not None:
        in_database(settings, lambda session: revoke(session, token_id, course or DEFAULT_COURSE))
        ended = 1
    else:
        ended = revoke_tokens(settings, user or "", course)
    print(f"{ended} revoked")
    sys.exit(0 if ended else USAGE)


@cli.command()
def invite(
    names: list[str],
    course: Course = None,
    role: Annotated[str, typer.Option(help="student or instructor")] = "student",
    data: Data = None,
) -> None:
    """Print a single-use link for each name, in their order, one a line on stdout; the names go to stderr."""
    from grader.app import in_database
    from grader.courses.invitations import invite as make

    settings = settings_with(data=data)
    made = in_database(settings, lambda session: make(session, None, course, names, role))
    for one in made:
        say(f"{one.member.name}, until {one.expires_at:%Y-%m-%d %H:%M} UTC:")
        print(f"{settings.origin}/signin?code={one.code}", flush=True)
