"""`grader author` and `grader convert`: write questions, as JSON or Markdown, and see them certified while you type."""

from pathlib import Path
from typing import Annotated

import typer

from grader.commands.grade import open_pipeline
from grader.commands.options import read_settings, say

cli = typer.Typer()


@cli.command()
def author(
    folder: Annotated[Path | None, typer.Argument(help="The content folder; that of the settings if left out.")] = None,
    port: Annotated[int, typer.Option(help="Port on this machine.")] = 8010,
) -> None:
    """Show each question as students see it, beside its source and what the check says; follows every saved file."""
    from grader.grading.checking import find_content_root
    from grader.library import PassedChecks
    from grader.service.authoring import HOST, serve_author
    from grader.service.processes import require_free_port

    settings = read_settings()
    root = find_content_root(folder or settings.content)
    require_free_port(HOST, port)
    say(f"{root} at http://{HOST}:{port} until you press Ctrl-C")
    serve_author(root, PassedChecks(settings.cache), open_pipeline, port)


@cli.command()
def convert(
    file: Annotated[Path, typer.Argument(help="A quiz: quizzes/NAME.json or quizzes/NAME.md.")],
    *,
    write: Annotated[
        bool, typer.Option("--write", help="Write it beside the file, which gets a ~ at its end.")
    ] = False,
) -> None:
    """Print a quiz of JSON as Markdown, or of Markdown as JSON: the same quiz, without loss."""
    from grader.library.conversion import convert_file, write_converted

    if write:
        for written in write_converted(file):
            print(written)
    else:
        print(next(iter(convert_file(file).values())), end="")
