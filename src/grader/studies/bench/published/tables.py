"""The tables of the pages, rendered from the studies' JSON. A function under `table` is the block of its name."""

from collections.abc import Callable, Iterator

from grader.studies.bench.physics.skip import IN_C, SKIPPING, STAGES, TIMER
from grader.studies.bench.physics.stability import LOOK, SECONDS, Class
from grader.studies.bench.published.advice_claims import advice_rows
from grader.studies.bench.published.claims import Results
from grader.studies.bench.published.service_claims import DATABASES, SERVERS, service_rows
from grader.studies.bench.scenes import describe_scene

ERRORS = tuple(f"1e-{k:02}" for k in range(1, 11))
SHOWN_ERRORS = ERRORS[1:8:2]

Rows = Callable[[Results], Iterator[tuple[str, ...]]]
BLOCKS: dict[str, Callable[[Results], str]] = {}


def table(*head: str) -> Callable[[Rows], Rows]:
    """Make a block of the rows that a function yields: a Markdown table under the function's name."""

    def register(rows: Rows) -> Rows:
        def render(results: Results) -> str:
            lines = ["| " + " | ".join(cells) + " |" for cells in (head, *rows(results))]
            return "\n".join([lines[0], "|" + "---|" * len(head), *lines[1:]])

        BLOCKS[rows.__name__] = render
        return rows

    return register


def milliseconds(timestep_s: float) -> str:
    """`2 ms`, `0.0313 ms`."""
    return f"{1e3 * timestep_s:.3g} ms"


def times(timed: Results, digits: str = ".2f") -> str:
    """Returns a ratio and its 95 % confidence interval, where it was measured: `x2.61 (2.53 to 2.84)`."""
    ratio = f"x{timed['ratio']:{digits}}"
    if "interval" not in timed:
        return ratio
    low, high = timed["interval"]
    return f"{ratio} ({low:{digits}} to {high:{digits}})"


def setting(best: Results | None) -> str:
    """`RK4 8 ms (x0.9)`, or a dash where no setting gets there."""
    return f"{best['integrator']} {milliseconds(best['timestep_s'])} (x{best['ratio']:.3g})" if best else "-"


def fitted(fit: Results | None) -> str:
    """`3.98 (3.95 to 4.01)`, or a dash where no order was fitted."""
    return "{order:.2f} ({interval[0]:.2f} to {interval[1]:.2f})".format(**fit) if fit else "-"


def trade(point: Results) -> str:
    """Error and cost of one setting with its interval, or that it warned."""
    error = "warned" if point["error"] is None else f"{point['error']:.1e}"
    return f"{error}, {times(point, '.3g')}"


def ratio(peer: Results | None, mujoco: Results | None) -> str:
    """Returns the peer's cost over MuJoCo's; in words where one of the two does not get there."""
    if peer is None:
        return "neither" if mujoco is None else "does not get there"
    return "gets there, MuJoCo does not" if peer["ratio"] is None else times(peer, ".2g")


def reset(record: Results | None) -> str:
    """Returns the first warned run, and what its loop reads next."""
    if record is None:
        return "never warned"
    return (
        f"{record['warning']} at t = {record['warned_at_s']:.3g} s (h = {milliseconds(record['timestep_s'])}); "
        f"then time reads {record['time_after_s']:.3g} s and qpos {record['qpos_after']}"
    )


def machine(results: Results) -> str:
    """Machine and versions of every study."""
    lines = []
    for name, entry in results.items():
        if not (entry and "machine" in entry):
            continue
        versions = ", ".join(map(" ".join, entry["versions"].items()))
        lines.append(
            f"- `{name}`: {'quick' if entry['quick'] else 'whole'} run, {entry['measurements']} measurements, "
            "{processor}, {cores} cores, load {load_1min}; ".format(**entry["machine"])
            + versions
        )
    return "\n".join(lines)


def maps(results: Results) -> str:
    """Returns the totals of the stability maps."""
    totals = results["stability"]["totals"]
    return (
        "Stability maps: {evaluated} of {grid_points} points evaluated ({share:.0f} %), {disagreeing} of {compared} "
        "compared points differ from the full grid; spectral radius and closed form agree to {apart:.0e}."
    ).format(
        share=100 * totals["evaluated"] / totals["grid_points"], apart=totals["largest_spectral_to_closed"], **totals
    )


BLOCKS |= {"machine": machine, "maps": maps}


@table("scene", *ERRORS)
def precision(results: Results) -> Iterator[tuple[str, ...]]:
    """Yields the cheapest setting within each error on each scene."""
    for name, scene in results["precision"]["scenes"].items():
        yield describe_scene(name), *(setting(scene["cheapest"][error]) for error in ERRORS)


@table("scene", "implicitfast at 2 ms", "RK4 at 0.5 ms", "RK4 at 8 ms")
def procedure(results: Results) -> Iterator[tuple[str, ...]]:
    """Yields the lesson's start beside RK4 at a quarter and at four times its step."""
    for name, scene in results["precision"]["scenes"].items():
        yield describe_scene(name), *(trade(scene["procedure"][kind]) for kind in ("start", "quarter", "four_times"))


@table("scene", "own error of the reference", "Euler", "RK4", "implicit", "implicitfast", "discrete")
def orders(results: Results) -> Iterator[tuple[str, ...]]:
    """Fitted orders with their 95 % intervals."""
    for name, scene in results["precision"]["scenes"].items():
        fits = map(fitted, scene["orders"].values())
        yield describe_scene(name), f"{scene['reference']['own_error']:.0e}", *fits


@table("scene", "peer", *SHOWN_ERRORS)
def peers(results: Results) -> Iterator[tuple[str, ...]]:
    """Yields the cost of each peer over that of MuJoCo's cheapest setting within four errors."""
    for name, scene in results["precision"]["scenes"].items():
        for peer, ratios in scene["peers"].items():
            costs = (ratio(ratios[error], scene["cheapest"][error]) for error in SHOWN_ERRORS)
            yield describe_scene(name), peer, *costs


@table(
    *("map", "integrator", "points evaluated", "points that the full grid has otherwise"),
    *("spectral radius to closed form", "3 s simulated to closed form"),
)
def stability(results: Results) -> Iterator[tuple[str, ...]]:
    """Per map: what it cost, whether the full grid agrees, and how far closed form, radius and simulation are apart."""
    for chart, maps in results["stability"]["maps"].items():
        for integrator, entry in maps.items():
            spectral, simulated = entry["edges"]["spectral_to_closed"], entry["edges"]["simulated_to_closed"]
            yield (
                *(chart, integrator, f"{entry['evaluated']} of {entry['points']} (x{entry['saving']:.1f})"),
                f"{entry['disagreeing']} of {entry['full_points']}",
                "no limit" if spectral is None else f"{spectral:.0e}",
                "no limit" if simulated is None else f"{100 * simulated[0]:+.2f} to {100 * simulated[1]:+.1f} %",
            )


@table("map", "integrator", "what", "share of the unstable points", "timesteps", "steps in 3 s")
def windows(results: Results) -> Iterator[tuple[str, ...]]:
    """Where `no warning` misleads."""
    for chart, kinds in results["stability"]["windows"].items():
        for integrator, listed in kinds.items():
            for window in listed:
                share = window["share_of_unstable"]
                shown = "-" if share is None else f"{100 * share:.1f} %"
                span = " to ".join(map(milliseconds, window["timesteps_s"]))
                steps = " to ".join(f"{SECONDS / h:.0f}" for h in window["timesteps_s"])
                yield chart, integrator, LOOK[Class[window["kind"].upper()]][1], shown, span, steps


@table("case", "integrator", "outcomes over the grid", "first warning, at the smallest timestep")
def cases(results: Results) -> Iterator[tuple[str, ...]]:
    """What collisions end in, and what the warning and reset do."""
    for case, kinds in results["stability"]["cases"].items():
        for integrator, entry in kinds.items():
            shares = ", ".join(f"{name} {100 * share:.0f} %" for name, share in entry["shares"].items() if share)
            yield case, integrator, shares, reset(entry["reset"])


@table("scene", *STAGES, "bitwise equal", "needed, so kept")
def skip(results: Results) -> Iterator[tuple[str, ...]]:
    """Yields the three savings apart and together."""
    for name, scene in results["skip"]["scenes"].items():
        needed = ", ".join(flag["part"] for flag in scene["flags"] if not flag["proven"]) or "none"
        saved = (times(scene["savings"][stage]) for stage in STAGES)
        yield describe_scene(name), *saved, "yes" if scene["bitwise"] else "NO", needed


@table("scene", "flag", "", "why", "bitwise equal", "time saved")
def flags(results: Results) -> Iterator[tuple[str, ...]]:
    """Yields every flag on every scene: proof, bits, time."""
    for name, scene in results["skip"]["scenes"].items():
        for flag in scene["flags"]:
            proven = "proven" if flag["proven"] else "needed"
            bits = "yes" if flag["bitwise"] else f"no, {flag['largest_difference']:.0e}"
            yield describe_scene(name), flag["part"], proven, flag["reason"], bits, times(flag)


@table("servo", "eigenvalue [1/s]", "Euler", "RK4", "implicit, implicitfast", "discrete")
def regions(results: Results) -> Iterator[tuple[str, ...]]:
    """Yields the servos on the plane, and the largest stable timestep of each integrator."""
    for name, servo in results["regions"]["servos"].items():
        limits = {kind: "no limit" if h is None else milliseconds(h) for kind, h in servo["limits_s"].items()}
        real, imaginary = servo["eigenvalue"]
        methods = ("Euler", "RK4", "implicit", "discrete")
        yield name, f"{real:.1f} + {imaginary:.1f}i", *(limits[kind] for kind in methods)


@table("scene", "integrator", "4 ms", "2 ms", "1 ms", "drift per minute at 2 ms")
def energy(results: Results) -> Iterator[tuple[str, ...]]:
    """Yields the largest relative error of the energy, up to the first warning."""
    for name, kinds in results["energy"]["scenes"].items():
        for kind, runs in kinds.items():
            drifts = f"{runs['2 ms']['per_minute']:+.1e}" if runs["2 ms"]["warning"] is None else "-"
            yield describe_scene(name), kind, *(largest(runs[h]) for h in ("4 ms", "2 ms", "1 ms")), drifts


def largest(run: Results) -> str:
    """`8.9e-01`, or with the warning that ended the run."""
    warned = run["warning"]
    return f"{run['largest']:.1e}" + (f", {warned[0]} at {warned[1]:.0f} s" if warned else "")


ADAPTIVE_ERRORS = ("1e-02", "1e-03", "1e-04", "1e-05", "1e-06")


@table("scene", "method", *ADAPTIVE_ERRORS)
def adaptive(results: Results) -> Iterator[tuple[str, ...]]:
    """Yields the fewest evaluations within each error, and the CPU time of that run."""
    for name, scene in results["adaptive"]["scenes"].items():
        fewest = (scene["mujoco"][error] for error in ADAPTIVE_ERRORS)
        cells = (run and f"{evaluations(run)}, {run['method']} {milliseconds(run['setting'])}" for run in fewest)
        yield describe_scene(name), "MuJoCo, fewest", *(cell or "-" for cell in cells)
        for method, by_error in scene["adaptive"].items():
            yield describe_scene(name), method, *(evaluations(by_error[error]) for error in ADAPTIVE_ERRORS)


def evaluations(best: Results | None) -> str:
    """`512 (x1.0)`, or a dash where no setting gets there."""
    return f"{best['evaluations']} (x{best['ratio']:.2g})" if best else "-"


PILE_STEPS = ("8 ms", "4 ms", "2 ms", "1 ms", "0.5 ms", "0.25 ms", "0.125 ms")


@table("integrator", *PILE_STEPS, "order")
def pile(results: Results) -> Iterator[tuple[str, ...]]:
    """Error against timestep where many stiff contacts open and close."""
    scene = results["adaptive"]["scenes"]["pile"]
    for kind, errors in scene["errors"].items():
        order = fitted(scene["orders"][kind])
        yield kind, *(f"{errors[h]:.0e}" if h in errors else "warned" for h in PILE_STEPS), order


@table(
    *("model", "degrees of freedom", "needed, so kept", "skipping", "an `nstep` loop over our run"),
    *("`mujoco.rollout` over our recording", "beside the steps", "MuJoCo's reset", "bitwise equal"),
)
def models(results: Results) -> Iterator[tuple[str, ...]]:
    """What skipping saves on each model, and what a run costs beside its steps."""
    for name, model in results["models"]["models"].items():
        parts = [part for part in model["needed"] if part not in ("constraints", "islands")]
        fixed = f"{model['fixed_us']:.1f} us", f"{model['reset_us']:.1f} us"
        ratios = (times(model[name]) for name in ("skipping", "nstep", "recording"))
        cells = (*ratios, *fixed, "yes" if model["bitwise"] else "NO")
        yield describe_scene(name), str(model["degrees"]), ", ".join(parts) or "none", *cells


@table(
    *("database", "learners at once", "server", "answers a second", "the service beside it", "median", "95 of 100"),
    *("99 of 100", "CPU time of an answer"),
)
def answers(results: Results) -> Iterator[tuple[str, ...]]:
    """The answers of a class beside two bare routes: rates, wall times and the servers' CPU times, with their span."""
    for row in service_rows(results, "beside"):
        waits = (f"{1e3 * row[name]:.1f} ms" for name in ("median_s", "p95_s", "p99_s"))
        rate = f"{row['per_second']:.0f} ({row['per_second_least']:.0f} to {row['per_second_most']:.0f})"
        ratio = f"x{row['ratio']:.2f} ({row['ratio_least']:.2f} to {row['ratio_most']:.2f})" if "ratio" in row else "-"
        cost = f"{1e3 * row['cpu_s']:.2f} ms ({1e3 * row['cpu_s_least']:.2f} to {1e3 * row['cpu_s_most']:.2f})"
        yield DATABASES[row["backend"]], str(row["students"]), SERVERS[row["server"]], rate, ratio, *waits, cost


@table(
    *("exercise", "right answer", "database", "the bare function", "until the verdict is heard", "a cold import"),
    *("the script's process", "judging", "the service beside"),
)
def scripts(results: Results) -> Iterator[tuple[str, ...]]:
    """Scripts beside their bare functions: wall times until the verdict, and CPU times by part."""
    for row in results["script"]["scripts"]:
        parts = {
            part: f"{1e3 * row[f'{part}_s']:.0f} ms (x{row[f'{part}_ratio']:.2f})"
            for part in ("whole", "child", "judge", "service")
        }
        times = (f"{1e3 * row[name]:.0f} ms" for name in ("bare_s", "imported_s"))
        bare, imported = times
        program = row["program"].replace("_", " ")
        shown = bare, parts["whole"], imported, parts["child"], parts["judge"], parts["service"]
        yield row["exercise"], program, DATABASES[row["backend"]], *shown


@table("scripts", "workers", "scripts a second", "beside one worker", "busy cores", "CPU time of a script")
def workers(results: Results) -> Iterator[tuple[str, ...]]:
    """Queued scripts, worked off by more and more grading processes."""
    for row in service_rows(results, "workers"):
        rate, ratio = f"{row['per_second']:.2g}", f"x{row['ratio']:.2f}"
        yield row["script"], str(row["workers"]), rate, ratio, f"{row['cores']:.2f}", f"{1e3 * row['cpu_s']:.0f} ms"


@table("scene", *(f"error {error}" for error in SHOWN_ERRORS), "timer x C x skipping")
def summary(results: Results) -> Iterator[tuple[str, ...]]:
    """One line a scene: the cheapest settings, and the three savings."""
    skipped = {name: scene["savings"] for name, scene in results["skip"]["scenes"].items()}
    for name, scene in results["precision"]["scenes"].items():
        apart = [f"{skipped[name][stage]['ratio']:.2f}" for stage in (TIMER, IN_C, SKIPPING)] if name in skipped else []
        cheapest = (setting(scene["cheapest"][error]) for error in SHOWN_ERRORS)
        yield describe_scene(name), *cheapest, " x ".join(apart) or "-"


@table("model", "joints", "advice", "until", "error", "independent error", "by", "CPU time")
def advice(results: Results) -> Iterator[tuple[str, ...]]:
    """Yields the advice on every foreign model, and the error of the choice by the independent reference."""
    for name, row in advice_rows(results).items():
        until = "" if row.get("until_s") is None else f"{row['until_s']:g} s"
        cost = f"{row['cpu_s']:.2g} s"
        if "choice" not in row:
            yield name, str(row["degrees"]), row["verdict"], until, "-", "-", "-", cost
            continue
        choice, doubt = row["choice"], row["independent_doubt"]
        setting = f"{choice['integrator']} at {milliseconds(choice['timestep_s'])}"
        error = f"{row['independent_error']:.1e} +- {doubt:.0e}"
        yield name, str(row["degrees"]), setting, until, f"{choice['error']:.1e}", error, row["independent"], cost
