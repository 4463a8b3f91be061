"""Commands that study MuJoCo: `grader advise | bench`."""

import sys
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from grader.commands.options import OTHER_VERDICT, read_settings
from grader.errors import Unprocessable

INTERRUPTED = 130

UNTIL = 4
"""Exit code of `advise` for a choice that holds for a part of the run: 2 and 3 are errors."""

cli = typer.Typer()


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
    page: Annotated[Path | None, typer.Option(help="Write the work-precision diagram and its table as HTML.")] = None,
) -> None:
    """Pick integrator and timestep by the lesson's procedure, with the measurements.

    Runs are compared with a reference every 20 ms, those shorter than 1 s more often: what is faster than that may be
    missed.

    Exits with 0 for a choice that holds for the whole run, with 1 if there is none, and with 4 for one that holds up to
    the time it names: run it again with --seconds of that time, or with a larger --tol.
    """
    from grader.studies.advise.page import draw_page
    from grader.studies.advise.report import RunStart
    from grader.studies.advise.report import advise as measure

    named = read_settings().content / "models" / f"{model}.xml"
    state = (parse_numbers(qpos, "--qpos"), parse_numbers(qvel, "--qvel"), parse_numbers(ctrl, "--ctrl"))
    start = RunStart(int(key) if key is not None and key.isdecimal() else key, *state, perturb)
    with Console(stderr=True).status("compiling the model") as status:
        place = named if named.is_file() else Path(model)
        advice = measure(place, quantity, tol, seconds, start=start, budget_s=budget, progress=status.update)
    print(advice)
    if page is not None:
        page.write_text(draw_page(advice, place.stem), encoding="utf-8")
    if advice.choice is None:
        sys.exit(OTHER_VERDICT)
    if advice.selection.until_s is not None:
        sys.exit(UNTIL)


def parse_numbers(text: str | None, option: str) -> list[float] | None:
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
        str,
        typer.Argument(
            help="precision, stability, regions, energy, adaptive, skip, models, batches, impacts, quantities, "
            "service, script or deadline"
        ),
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
