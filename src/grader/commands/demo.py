"""The command that fills a course to try the service on: `grader demo`."""

from pathlib import Path
from typing import Annotated

import typer

from grader.commands.options import Course, read_settings, say

cli = typer.Typer()


@cli.command()
def demo(
    data: Annotated[Path, typer.Option(help="Folder of the database.")] = Path(".demo"),
    course: Course = None,
    learners: Annotated[int, typer.Option(min=2, max=500, help="How many learners.")] = 30,
    seed: Annotated[int, typer.Option(min=0, help="Another seed makes other learners and answers.")] = 1,
    *,
    beside_others: Annotated[
        bool, typer.Option("--beside-others", help="Also into a database with answers of other courses.")
    ] = False,
) -> None:
    """Fill a course with learners who do not exist, to try the service: their verdicts are the grader's own."""
    from grader.service.demo import fill_demo
    from grader.store.tables import now

    settings = read_settings(data=data)
    filled = fill_demo(settings, say, course=course, learners=learners, seed=seed, beside=beside_others, now=now())
    print(
        f"{filled.course}: {filled.learners} learners, {filled.answers} answers, {filled.judged} different scripts, "
        f"{filled.waiting} open answers that wait for you"
    )
    say(f"Look at it with: grader serve --data {data}")
