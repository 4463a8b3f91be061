"""Commands that run the service: `grader serve | worker`."""

from typing import Annotated

import typer

from grader.commands.options import Data, read_settings

cli = typer.Typer()


@cli.command()
def serve(
    host: Annotated[str | None, typer.Option(help="Address to bind: 127.0.0.1 if not given.")] = None,
    port: Annotated[int | None, typer.Option(help="Port to bind: 8000 if not given.")] = None,
    data: Data = None,
) -> None:
    """Serve the API and the pages, with an embedded worker."""
    from grader.service.processes import serve

    serve(read_settings(host=host, port=port, data=data))


@cli.command()
def worker(data: Data = None) -> None:
    """Run one more grading worker on the database of a server."""
    from grader.service.deliveries import build_deliveries
    from grader.service.worker import run_worker

    run_worker(read_settings(data=data), build_deliveries)
