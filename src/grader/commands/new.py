"""Commands that begin content: `grader new course | lesson | question | exercise | lab`."""

import shlex
from pathlib import Path
from typing import Annotated

import typer

from grader.commands.options import say
from grader.errors import NotFound

cli = typer.Typer(help="Begin content that passes `grader check` at once, for you to change.", no_args_is_help=True)

Folder = Annotated[Path, typer.Option("--in", help="The content folder.")]
Markdown = Annotated[bool, typer.Option("--markdown", help="Write the quiz as Markdown, not as JSON.")]
Place = Annotated[
    str,
    typer.Argument(metavar="QUIZ[/ID]", help="The quiz that gets it, begun if there is none, and the question's id."),
]
HERE = Path()


@cli.command()
def course(
    folder: Annotated[Path, typer.Argument(help="A new content folder.")], *, markdown: Markdown = False
) -> None:
    """A content folder with one quiz."""
    from grader.library import scaffold

    tell(scaffold.begin_course(folder, as_markdown=markdown), folder)


@cli.command()
def lesson(
    quiz: Annotated[str, typer.Argument(help="The id of its quiz, such as 2.1-check.")],
    title: Annotated[str, typer.Option(help="The title of the quiz.")] = "Knowledge check",
    folder: Folder = HERE,
    *,
    markdown: Markdown = False,
) -> None:
    """A quiz of one question; the number at the head of its id says of which lesson it is."""
    from grader.library import scaffold

    tell(scaffold.begin_quiz(require_content(folder), quiz, title, as_markdown=markdown), folder)


@cli.command()
def question(
    kind: Annotated[str, typer.Argument(help="mcq, numeric, predict, open, order, ...")],
    quiz: Place,
    folder: Folder = HERE,
) -> None:
    """A question of a kind, at the end of a quiz."""
    from grader.library import scaffold

    tell(scaffold.add_question(require_content(folder), quiz, kind), folder)


@cli.command()
def exercise(
    kind: Annotated[str, typer.Argument(help="threshold, rk4, values, ...")],
    quiz: Place,
    folder: Folder = HERE,
) -> None:
    """An exercise of a kind, with a starter and a reference program that is right."""
    from grader.library import scaffold

    tell(scaffold.add_exercise(require_content(folder), quiz, kind), folder)


@cli.command()
def lab(
    kind: Annotated[str, typer.Argument(help="simlab, integrators, or another installed kind")],
    quiz: Annotated[str, typer.Argument(help="The quiz that gets it.")],
    folder: Folder = HERE,
) -> None:
    """A lab of a kind, at the end of a quiz."""
    from grader.library import scaffold

    tell(scaffold.add_lab(require_content(folder), quiz, kind), folder)


def require_content(folder: Path) -> Path:
    """Returns the content folder. Raises NotFound where it is none, such as one with a mistyped name."""
    if not (folder / "quizzes").is_dir():
        begin = f"`grader new course {shlex.quote(str(folder))}` begins one"
        raise NotFound(f"{folder}: no content folder here, which has quizzes/ inside: {begin}")
    return folder


def tell(written: list[Path], folder: Path) -> None:
    """Prints the files that were written, and what comes next."""
    for file in written:
        print(file)
    place = shlex.quote(str(folder))
    say(f"Change them: `grader author {place}` shows them as students see them, `grader check {place}` checks them.")
