"""Grades answers without a server: `grader grade`, and `grader grade-notebook` for cells of notebooks."""

import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, Never

import typer
from rich.console import Console

from grader.commands.options import CORRECT, FAULT, OTHER_VERDICT, Json, read_settings
from grader.errors import CallerError, InvalidAnswer, Unprocessable

if TYPE_CHECKING:
    from grader.domain.verdict import Verdict
    from grader.grading.pipeline import Pipeline
    from grader.library import Library
    from grader.questions import Question, Quiz
    from grader.reports import GradedAnswer

cli = typer.Typer()

Form = Literal["gradescope", "junit"]
"""The document of another grader."""


@contextmanager
def open_pipeline(library: "Library", jailed: bool = True) -> Iterator["Pipeline"]:
    """Makes a pipeline without server or database; the jail starts only if a script is to run."""
    from grader.grading.pipeline import Pipeline

    if not jailed:
        yield Pipeline(library)
        return
    from grader.sandbox.jail import Jail

    with Jail(library.root / "models", allow_t2=read_settings().allow_t2) as jail:
        yield Pipeline(library, jail.run)


@cli.command(context_settings={"ignore_unknown_options": True})  # an answer may begin with a minus
def grade(
    quiz: str,
    question: str,
    answer: Annotated[
        str, typer.Argument(help="The file of an exercise: a script, notebook, model, .npz or .onnx; else the answer.")
    ],
    as_json: Json = False,
    seed: Annotated[
        int | None,
        typer.Option(min=0, help="Repeats the hidden cases of an earlier verdict; drawn at random if not given."),
    ] = None,
    *,
    key: Annotated[
        Path | None, typer.Option(help="A file of random bytes: with it the same answer gets the same hidden cases.")
    ] = None,
    form: Annotated[Form | None, typer.Option("--format", help="Print the document of another grader.")] = None,
) -> None:
    """Grade one answer with no server and no database. Exits 0 if it is correct, else 1."""
    from grader.courses.rules.policy import report_verdict
    from grader.domain.verdict import Status
    from grader.library import load
    from grader.questions import kind_of

    if as_json and form is not None:
        raise Unprocessable("Give either --json or --format.")
    library = load(read_settings().content, quiz, question=question)
    asked = library.question(quiz, question)
    is_script = kind_of(asked).is_script
    secret = None if key is None else key.read_bytes()
    with open_pipeline(library, jailed=is_script) as opened:
        pipeline = opened if secret is None else replace(opened, secret=secret)
        try:
            given = kind_of(asked).from_text(asked, read_handed_in(Path(answer), asked) if is_script else answer)
            submission = pipeline.read(quiz, question, given, seed)
        except CallerError as error:
            if form is None:
                raise
            report_unreadable(library.quiz(quiz), asked, str(error), form)
        verdict = report_verdict(pipeline.judge_with_retries(submission), submission.question)
    if form is not None:
        from grader.reports import GradedAnswer

        print_report(GradedAnswer(library.quiz(quiz), submission.question, verdict, submission.seed), form)
    elif as_json:
        document = json.loads(verdict.model_dump_json()) | {"seed": submission.seed}
        print(json.dumps(document, ensure_ascii=False, indent=2))
    else:
        show(verdict, submission.seed)
    if verdict.status is Status.GRADER_FAULT:
        sys.exit(FAULT)
    sys.exit(CORRECT if verdict.status is Status.CORRECT else OTHER_VERDICT)


def print_report(graded: "GradedAnswer", form: Form) -> None:
    """Prints a verdict as the document of another grader. Raises JailFault for a fault of ours."""
    from grader.reports import junit_xml, results_json

    print({"gradescope": results_json, "junit": junit_xml}[form](graded))


def report_unreadable(quiz: "Quiz", question: "Question", why: str, form: Form) -> Never:
    """Prints the document of a file that cannot be read, which is the learner's mistake, and ends the command as for
    any wrong answer: 2 is left to faults of the content and the command."""
    from grader.domain.verdict import Status
    from grader.grading.pipeline import build_ungraded
    from grader.reports import GradedAnswer

    print_report(GradedAnswer(quiz, question, build_ungraded(question, Status.INVALID_ANSWER, why)), form)
    sys.exit(OTHER_VERDICT)


@cli.command("grade-notebook")
def grade_notebook(
    quiz: str,
    question: str,
    cell: Annotated[str, typer.Argument(help="The grade_id that nbgrader gave the cell with the function.")],
    notebooks: list[Path],
    key: Annotated[
        Path | None, typer.Option(help="A file of random bytes: with it the same answer gets the same hidden cases.")
    ] = None,
) -> None:
    """Grade one cell of each notebook. Prints a line of JSON for each. Exits 3 if one could not be graded."""
    from grader.courses.rules.policy import report_verdict
    from grader.domain.verdict import Status
    from grader.grading.notebooks import assemble_script, find_cell, read_notebook
    from grader.library import load
    from grader.questions import question_view

    library = load(read_settings().content, quiz, question=question)
    asked = library.question(quiz, question)
    if question_view(asked).get("takes") != "python":
        raise Unprocessable(f"{quiz} {question} is no exercise that takes a script, as cells of notebooks are.")
    code = CORRECT
    with open_pipeline(library) as opened:
        pipeline = opened if key is None else replace(opened, secret=key.read_bytes())
        for path in notebooks:
            summary = dict.fromkeys(("points", "max_points", "status", "message"))
            try:
                source = assemble_script([find_cell(read_notebook(path), cell)])
                submission = pipeline.read(quiz, question, {"source": source})
                verdict = report_verdict(pipeline.judge_with_retries(submission), submission.question)
                summary["message"] = verdict.diagnosis
                if verdict.status is not Status.GRADER_FAULT:
                    summary |= verdict.model_dump(mode="json", include={"points", "max_points", "status"})
            except (OSError, CallerError, InvalidAnswer) as error:
                summary["message"] = str(error)
            code = FAULT if summary["status"] is None else code
            print(json.dumps({"notebook": str(path), **summary}, ensure_ascii=False), flush=True)
    sys.exit(code)


def read_handed_in(path: Path, asked: "Question") -> str:
    """Reads the text of a script or a model, the code cells of a notebook, or a file as base64. Raises OSError,
    Unprocessable."""
    from grader.questions import decode_file, question_view

    takes = question_view(asked)["takes"]
    if path.suffix == ".ipynb" and takes == "python":
        from grader.grading.notebooks import assemble_script, read_notebook

        return assemble_script(read_notebook(path))
    try:
        return decode_file(takes, path.read_bytes())
    except UnicodeDecodeError as error:
        raise Unprocessable(f"{path} is not UTF-8 text: {error}") from error


def show(verdict: "Verdict", seed: int | None) -> None:
    """Prints a verdict for a person at a terminal, with the seed that repeats it."""
    from grader.domain.verdict import format_points

    out = Console(markup=False, highlight=False, soft_wrap=True)
    out.print(f"{verdict.status}: {verdict.points:g} of {format_points(verdict.max_points)}")
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
