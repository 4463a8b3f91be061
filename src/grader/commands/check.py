"""Commands for authors: `grader check | import`."""

import json
import sys
from pathlib import Path
from typing import Annotated

import typer

from grader.commands.grade import open_pipeline
from grader.commands.options import CORRECT, OTHER_VERDICT, USAGE, Json, err, read_settings, say
from grader.errors import ContentError

cli = typer.Typer()


@cli.command()
def check(
    paths: Annotated[list[Path] | None, typer.Argument()] = None,
    as_json: Json = False,
    draws: Annotated[int, typer.Option(min=1, help="draws of the hidden cases for each reference program")] = 1,
    *,
    only: Annotated[str | None, typer.Option(metavar="QUIZ[/QUESTION]", help="Check this part alone.")] = None,
    again: Annotated[
        bool, typer.Option("--again", help="Run also what has passed before and has not changed.")
    ] = False,
) -> None:
    """Load every quiz and model, re-derive every answer key, grade every reference solution.

    Exits with 2 for a fault, with 1 if only undecided keys are left.
    """
    from grader.grading.checking import Look, check_content, nothing_unshown
    from grader.grading.selection import Selection
    from grader.library import NOTHING_PASSED, PassedChecks
    from grader.questions import installed_kinds, is_own

    settings = read_settings()
    if not paths:
        say(f"the content folder is {settings.content}")
    look: Look = nothing_unshown
    if not all(map(is_own, installed_kinds().values())):
        from grader.web.author.preview import find_unshown  # the pages take half a second to import

        look = find_unshown
    passed = NOTHING_PASSED if again else PassedChecks(settings.cache)
    with err.status("starting") as status:  # nothing where stderr is no terminal
        reports = [
            check_content(
                path, open_pipeline, say, draws, passed, only=Selection.parse(only), doing=status.update, look=look
            )
            for path in paths or [settings.content]
        ]
    faults = [fault for report in reports for fault in report.faults]
    undecided = [fault for report in reports for fault in report.undecided]
    if as_json:
        documents = [report.to_json() for report in reports]
        print(json.dumps(documents if len(documents) > 1 else documents[0], indent=2))
    else:
        for warning in [warning for report in reports for warning in report.warnings]:
            err.print(f"warning: {warning}", style="yellow", markup=False, soft_wrap=True)
        for fault in (*faults, *undecided):
            print(fault)
        counts = [f"{len(faults)} fault(s)"] * bool(faults) + [f"{len(undecided)} undecided key(s)"] * bool(undecided)
        say(", ".join(counts) or "all holds")
    sys.exit(USAGE if faults else OTHER_VERDICT if undecided else CORRECT)


@cli.command()
def schema() -> None:
    """Print the JSON schema of quiz files, for editors."""
    from grader.library.json_schema import build_quiz_schema

    print(json.dumps(build_quiz_schema(), indent=1))


@cli.command("import")
def import_(
    lesson: Path,
    out: Annotated[Path, typer.Option(help="Folder for the quiz files.")] = Path("quizzes"),
    source: Annotated[str, typer.Option(help="Address of the lesson's page, for what does not run here.")] = "",
) -> None:
    """Write a Markdown lesson as content: its quiz and lab blocks as quiz JSON, its text and pictures beside them."""
    from grader.importing.lesson import import_lesson

    imported = import_lesson(lesson.read_text(encoding="utf-8"), lesson.stem, lesson.parent, source)
    for remark in imported.remarks:
        print(f"warning: {remark}", file=sys.stderr)
    for path, body in imported.list_files(out).items():
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(body)
        print(path)
    if imported.faults:
        raise ContentError(imported.faults)
