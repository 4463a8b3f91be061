"""The command line: `grader serve | worker | grade | check | import | extend | token | invite | advise | bench`.

`operate.py` adds `backup | migrate | prune | erase | export | rotate-secret | deliveries | replay`, `teach.py` adds
`pack | roster`, `platforms.py` the commands of `grader lti`. What only some commands need is imported in them: MuJoCo,
SQLAlchemy and pydantic take several times as long as the rest of a short command.
"""

import json
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer
from rich.console import Console

from grader.commands.operate import operate
from grader.commands.platforms import lti
from grader.commands.teach import pack, roster
from grader.errors import CallerError, ContentError, InvalidAnswer, JailFault, Unprocessable

if TYPE_CHECKING:
    from sqlalchemy.orm import Session

    from grader.domain.policy import Extension
    from grader.domain.verdict import Verdict
    from grader.grading.pipeline import Pipeline
    from grader.library import Library
    from grader.settings import Settings

CORRECT, OTHER_VERDICT, USAGE, FAULT = range(4)
INTERRUPTED = 130
STDERR = 2

cli = typer.Typer(
    help="Auto-grading of a MuJoCo course.", no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False
)
token = typer.Typer(help="Bearer tokens.", no_args_is_help=True)
cli.add_typer(token, name="token")
cli.add_typer(operate)
cli.add_typer(pack, name="pack")
cli.add_typer(roster, name="roster")
cli.add_typer(lti, name="lti")

err = Console(stderr=True)
Json = Annotated[bool, typer.Option("--json", help="Print one JSON document on stdout.")]
Course = Annotated[str | None, typer.Option(help="Name of the course.")]
Data = Annotated[Path | None, typer.Option(help="Folder of the database.")]


def main(run: Callable[[], object] = cli) -> None:
    """Runs a command. Every error that is the caller's becomes a line on stderr and an exit code."""
    open_missing_standard_streams()
    try:
        run()
    except ContentError as error:
        complain(*map(str, error.faults))
        sys.exit(USAGE)
    except (CallerError, InvalidAnswer, OSError, UnicodeDecodeError) as error:
        complain(str(error))
        sys.exit(USAGE)
    except JailFault as error:
        complain(str(error))
        sys.exit(FAULT)
    except ValueError as error:
        complain(*faults_of_settings(error))
        sys.exit(USAGE)


@cli.callback()
def begin() -> None:
    """Auto-grading of a MuJoCo course."""
    from grader.logs import log_to_stderr

    log_to_stderr()


def complain(*lines: str) -> None:
    """Prints errors on stderr."""
    for line in lines:
        err.print(line, style="red", markup=False, soft_wrap=True)


def faults_of_settings(error: ValueError) -> list[str]:
    """What is wrong with the settings, a line for each. Raises the error again if they are not its cause."""
    from pydantic import ValidationError
    from pydantic_settings import SettingsError

    from grader.settings import PREFIX, Settings

    if isinstance(error, ValidationError):
        return [
            (f"{PREFIX}{'_'.join(map(str, wrong['loc']))}: ".upper() if wrong["loc"] else "")
            + wrong["msg"].removeprefix("Value error, ")
            for wrong in error.errors()
            if wrong["type"] != "default_factory_not_called"  # it follows from another error
        ]
    if isinstance(error, SettingsError):  # not JSON where JSON is needed
        fields = [(name, field) for name, field in Settings.model_fields.items() if f'"{name}"' in str(error)]
        return [f"{PREFIX}{name.upper()}: {field.description}" for name, field in fields]
    raise error


def open_missing_standard_streams() -> None:
    """Opens closed standard streams on /dev/null. Otherwise the next file would get their number, and their output."""
    while (descriptor := os.open(os.devnull, os.O_RDWR)) <= STDERR:
        pass
    os.close(descriptor)


def settings_with(**overrides: Any) -> "Settings":
    """The settings from the environment, overridden by the options of the command line."""
    from grader.settings import Settings

    return Settings(**{name: value for name, value in overrides.items() if value is not None})


def say(message: str) -> None:
    """Prints a line of progress on stderr."""
    err.print(message, style="dim", markup=False, highlight=False, soft_wrap=True)


@contextmanager
def pipeline_for(library: "Library", jailed: bool = True) -> Iterator["Pipeline"]:
    """A pipeline without server or database; the jail starts only if a script is to run."""
    from grader.grading.pipeline import Pipeline

    if not jailed:
        yield Pipeline(library)
        return
    from grader.sandbox.jail import Jail

    with Jail(library.root / "models", allow_t2=settings_with().allow_t2) as jail:
        yield Pipeline(library, jail.run)


@cli.command()
def serve(
    host: Annotated[str | None, typer.Option(help="Address to bind: 127.0.0.1 if not given.")] = None,
    port: Annotated[int | None, typer.Option(help="Port to bind: 8000 if not given.")] = None,
    data: Data = None,
) -> None:
    """Serve the API and the pages, with an embedded worker."""
    from grader.service.processes import serve

    serve(settings_with(host=host, port=port, data=data))


@cli.command()
def worker(data: Data = None) -> None:
    """Run one more grading worker on the database of a server."""
    from grader.service.deliveries import deliveries_of
    from grader.service.worker import run_worker

    run_worker(settings_with(data=data), deliveries_of)


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
    *,
    key: Annotated[
        Path | None, typer.Option(help="A file of random bytes: with it the same answer gets the same hidden cases.")
    ] = None,
    form: Annotated[
        Literal["gradescope", "junit"] | None, typer.Option("--format", help="Print the document of another grader.")
    ] = None,
) -> None:
    """Grade one answer with no server and no database. Exits 0 if it is correct, else 1."""
    from grader.courses.rules.policy import reported
    from grader.domain.verdict import Status
    from grader.library import load
    from grader.questions import kind_of

    if as_json and form is not None:
        raise Unprocessable("Give either --json or --format.")
    library = load(settings_with().content)
    asked = library.question(quiz, question)
    kind = kind_of(asked)
    is_script = kind.is_script
    given = kind.from_text(asked, read_script(Path(answer)) if is_script else answer)
    with pipeline_for(library, jailed=is_script) as pipeline:
        keyed = pipeline if key is None else replace(pipeline, secret=key.read_bytes())
        submission = keyed.read(quiz, question, given, seed)
        verdict = reported(keyed.judge_with_retries(submission), submission.question)
    if form is not None:
        from grader.reports import Graded, junit_xml, results_json

        write = {"gradescope": results_json, "junit": junit_xml}[form]
        print(write(Graded(library.quiz(quiz), submission.question, verdict, submission.seed)))
    elif as_json:
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


def show(verdict: "Verdict", seed: int | None) -> None:
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
def check(
    paths: Annotated[list[Path] | None, typer.Argument()] = None,
    as_json: Json = False,
    draws: Annotated[int, typer.Option(min=1, help="draws of the hidden cases for each reference program")] = 1,
) -> None:
    """Load every quiz and model, re-derive every answer key, grade every reference solution."""
    from grader.grading.checking import check_content

    reports = [check_content(path, pipeline_for, say, draws) for path in paths or [settings_with().content]]
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
    """Write the fenced quiz and lab blocks of a Markdown lesson as quiz JSON; labs with faults are left out."""
    from grader.importing.lesson import import_lesson

    imported = import_lesson(lesson.read_text(encoding="utf-8"), lesson.stem)
    for remark in imported.remarks:
        print(f"warning: {remark}", file=sys.stderr)
    out.mkdir(parents=True, exist_ok=True)
    for quiz_id, quiz in imported.quizzes.items():
        path = out / f"{quiz_id}.json"
        path.write_text(json.dumps(quiz, ensure_ascii=False, indent=2) + "\n", encoding="utf-8")
        print(path)
    if imported.faults:
        raise ContentError(imported.faults)


@cli.command()
def advise(
    model: Annotated[str, typer.Argument(help="A model of the content folder, or the path of an MJCF file.")],
    *,
    quantity: Annotated[str | None, typer.Option(help="The quantity of interest, as a lab expression.")] = None,
    tol: Annotated[float | None, typer.Option(help="Its largest error, in its own unit (1e-3).")] = None,
    seconds: Annotated[float | None, typer.Option(help="Length of the run in seconds (2).")] = None,
    key: Annotated[str | None, typer.Option(help="Keyframe of the start, by name or index.")] = None,
    qpos: Annotated[str | None, typer.Option(help="Positions of the start, separated by commas.")] = None,
    qvel: Annotated[str | None, typer.Option(help="Velocities of the start, separated by commas.")] = None,
    ctrl: Annotated[str | None, typer.Option(help="Controls, separated by commas; constant during the run.")] = None,
    perturb: Annotated[float, typer.Option(help="Add to every velocity a random number of this size at most.")] = 0.0,
    budget: Annotated[float, typer.Option(help="Seconds after which the best of what was measured is chosen.")] = 60.0,
) -> None:
    """Pick integrator and timestep by the lesson's procedure, with the measurements.

    Exits with 1 if no setting passes, or if it cannot be told.
    """
    from grader.studies.advise.report import Start
    from grader.studies.advise.report import advise as measure

    named = settings_with().content / "models" / f"{model}.xml"
    start = Start(
        int(key) if key is not None and key.isdecimal() else key,
        numbers_of(qpos, "--qpos"),
        numbers_of(qvel, "--qvel"),
        numbers_of(ctrl, "--ctrl"),
        perturb,
    )
    with Console(stderr=True).status("compiling the model") as status:
        advice = measure(
            named if named.is_file() else Path(model),
            quantity,
            tol,
            seconds,
            start=start,
            budget_s=budget,
            progress=status.update,
        )
    print(advice)
    if advice.choice is None:
        sys.exit(1)


def numbers_of(text: str | None, option: str) -> list[float] | None:
    """Reads numbers separated by commas. Raises Unprocessable for anything else."""
    if text is None:
        return None
    try:
        return [float(part) for part in text.split(",")]
    except ValueError as error:
        raise Unprocessable(f"{option} takes numbers separated by commas, such as 0.1,0,-2; not {text!r}") from error


@cli.command()
def bench(
    name: Annotated[
        str, typer.Argument(help="precision, stability, regions, energy, adaptive, skip, models or service")
    ],
    out: Annotated[Path, typer.Option(help="Folder for JSON, CSV and pictures.")] = Path("out"),
    quick: Annotated[bool, typer.Option(help="A small part of the benchmark.")] = False,
) -> None:
    """Run a benchmark. Interrupted and started again, it continues where it stopped."""
    from grader.studies.bench import run

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
    from grader.service.accounts import give_extension

    granted = extension_of(due, until, attempts)
    give_extension(settings_with(data=data), (course, quiz, user), granted)
    print(granted.model_dump_json())


def extension_of(due: str | None, until: str | None, attempts: int) -> "Extension":
    """The extension that the options describe. Raises Unprocessable."""
    from pydantic import ValidationError

    from grader.domain.policy import Extension

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
    """Print a new bearer token, and nothing else, on stdout; stderr says if the user is new in the course."""
    from grader.courses.people.identity import DEFAULT_COURSE
    from grader.courses.people.members import known
    from grader.courses.people.tokens import create_token
    from grader.service.accounts import in_database

    lifetime = None if expires is None else lifetime_of(expires)

    def create(session: "Session") -> tuple[bool, str]:
        is_new = not known(session, user, course or DEFAULT_COURSE)
        made = create_token(session, user, role, course, scopes=scope or None, lifetime=lifetime)
        return is_new, made

    is_new, text = in_database(settings_with(data=data), create)
    if is_new:
        say(f"{user} is a new {role} of the course {course or DEFAULT_COURSE}.")
    print(text)


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
    from grader.courses.people.identity import DEFAULT_COURSE
    from grader.courses.people.tokens import shown, tokens
    from grader.service.accounts import in_database

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
    from grader.courses.people.identity import DEFAULT_COURSE
    from grader.courses.people.tokens import revoke
    from grader.service.accounts import in_database, revoke_tokens

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
    from grader.courses.people.invitations import invite as make
    from grader.service.accounts import in_database

    settings = settings_with(data=data)
    made = in_database(settings, lambda session: make(session, None, course, names, role))
    for one in made:
        say(f"{one.member.name}, until {one.expires_at:%Y-%m-%d %H:%M} UTC:")
        print(f"{settings.origin}/signin?code={one.code}", flush=True)


if __name__ == "__main__":
    main()
