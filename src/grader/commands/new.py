"""Commands that begin content: `grader new course | lesson | question | exercise`."""

from pathlib import Path
from typing import Annotated

import typer

from grader.commands.options import say

cli = typer.Typer(help="Begin content that passes `grader check` at once, for you to change.", no_args_is_help=True)

Folder = Annotated[Path, typer.Option("--in", help="The content folder.")]
HERE = Path()


@cli.command()
def course(folder: Annotated[Path, typer.Argument(help="A new content folder.")]) -> None:
    """A content folder with one quiz."""
    from grader.library import scaffold

    tell(scaffold.begin_course(folder))


@cli.command()
def lesson(
    quiz: Annotated[str, typer.Argument(help="The id of its quiz, such as 2.1-check.")],
    title: Annotated[str, typer.Option(help="The title of the quiz.")] = "Knowledge check",
    folder: Folder = HERE,
    *,
    markdown: Annotated[bool, typer.Option("--markdown", help="Write it as Markdown, not as JSON.")] = False,
) -> None:
    """A quiz of one question; the number at the head of its id says of which lesson it is."""
    from grader.library import scaffold

    tell(scaffold.begin_quiz(folder, quiz, title, as_markdown=markdown))


@cli.command()
def question(
    kind: Annotated[str, typer.Argument(help="mcq, numeric, predict, open, order, ...")],
    quiz: Annotated[str, typer.Argument(help="The quiz that gets it.")],
    folder: Folder = HERE,
) -> None:
    """A question of a kind, at the end of a quiz."""
    from grader.library import scaffold

    tell(scaffold.add_question(folder, quiz, kind))


@cli.command()
def exercise(
    kind: Annotated[str, typer.Argument(help="threshold, rk4, values, ...")],
    quiz: Annotated[str, typer.Argument(help="The quiz that gets it.")],
    folder: Folder = HERE,
) -> None:
    """An exercise of a kind, with a starter and a reference program that is right."""
    from grader.library import scaffold

    tell(scaffold.add_exercise(folder, quiz, kind))


def tell(written: list[Path]) -> None:
    """Prints the files that were written, and what comes next."""
    for file in written:
        print(file)
    say("Change them, and run `grader check`.")
