"""`grader author`: write a question, and see it certified while you type."""

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

    settings = read_settings()
    root = find_content_root(folder or settings.content)
    say(f"{root} at http://{HOST}:{port} until you press Ctrl-C")
    serve_author(root, PassedChecks(settings.cache), open_pipeline, port)
