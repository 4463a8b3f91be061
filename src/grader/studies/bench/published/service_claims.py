"""What sentences of the pages say about the service, as `claims` does for the other studies."""

from grader.studies.bench.published.claims import Results, claim, demand, span


def service_rows(results: Results, kind: str) -> list[Results]:
    """Returns the rows of the service's study of one kind."""
    return [row for row in results["service"]["loads"] if row["kind"] == kind]


BARE = {"each": "a bare route that commits each", "gathered": "a bare route that gathers commits"}
SERVERS = {"service": "the service"} | BARE
DATABASES = {"sqlite": "SQLite", "postgresql": "PostgreSQL"}


def select_busiest(results: Results) -> list[Results]:
    """Returns the rows of answers with the most learners at once."""
    rows = service_rows(results, "beside")
    most = max(row["students"] for row in rows)
    return [row for row in rows if row["students"] == most]


def compare_rates(results: Results, commits: str) -> str:
    """Returns the service's rate over that of a bare route, on each database."""
    rows = [row for row in select_busiest(results) if row["server"] == commits]
    return " and ".join(f"{row['ratio']:.2f} on {DATABASES[row['backend']]}" for row in rows)


@claim
def answer_effort(results: Results) -> str:
    """How long was measured, and how busy the machine was meanwhile."""
    rows = service_rows(results, "beside")
    bursts, seconds, learners, load = (
        span([row[name] for row in rows], digits)
        for name, digits in (("bursts", ".0f"), ("seconds", ".2g"), ("learners", ".0f"), ("load_average", ".1f"))
    )
    return f"in {bursts} bursts of {seconds} s each, with {learners} learners, at a load average of {load}"


@claim
def answer_rates(results: Results) -> str:
    """How many answers the service takes beside the two bare routes."""
    most = select_busiest(results)[0]["students"]
    return (
        f"With {most} learners at once it takes {compare_rates(results, 'each')} times the answers of the route that "
        f"commits each, and {compare_rates(results, 'gathered')} times those of the route that gathers"
    )


@claim
def answer_costs(results: Results) -> str:
    """What an answer costs the server process."""
    costs = {name: [1e3 * row["cpu_s"] for row in select_busiest(results) if row["server"] == name] for name in SERVERS}
    ours, each, gathered = (span(costs[name], ".2f") for name in SERVERS)
    return f"takes {ours} ms of the server's CPU time, beside {each} ms and {gathered} ms of the bare routes'"


@claim
def late_answers(results: Results) -> str:
    """How late the last of a hundred answers are."""
    rows = [row for row in select_busiest(results) if row["server"] == "service"]
    late = (f"{1e3 * row['p99_s']:.0f} ms on {DATABASES[row['backend']]}" for row in rows)
    return f"With {rows[0]['students']} learners at once 99 of 100 answers are back within {' and '.join(late)}"


@claim
def script_effort(results: Results) -> str:
    """How much was measured, and how busy the machine was meanwhile."""
    rows = results["script"]["scripts"]
    count, load = (span([row[name] for row in rows], ".0f") for name in ("scripts", "load_average"))
    return f"in turn, {count} times, at a load average of {load}"


@claim
def script_costs(results: Results) -> str:
    """What a script's process and judging cost over the bare function."""
    rows = results["script"]["scripts"]
    child, judge = (span([row[f"{part}_ratio"] for row in rows]) for part in ("child", "judge"))
    return f"takes {child} times the CPU time of the bare function, and judging it {judge} times"


@claim
def script_waits(results: Results) -> str:
    """How long a learner waits beyond the function's own time, in cold imports."""
    waits = {
        name: span([row["wait_in_imports"] for row in results["script"]["scripts"] if row["backend"] == name])
        for name in DATABASES
    }
    shown = " and ".join(f"{waits[name]} on {DATABASES[name]}" for name in DATABASES)
    return f"waits for 1.5 times the bare function and a part of a cold import: {shown}"


@claim
def second_worker(results: Results) -> str:
    """What a second worker brings, by how long scripts compute."""
    by_script = {row["script"]: row for row in service_rows(results, "workers") if row["workers"] == 2}
    long, right, empty = (by_script[script]["ratio"] for script in ("long", "reference", "empty"))
    demand(long > right > empty > 1 and long > 1.8, [long, right, empty])
    return f"grades {long:.1f} times as many long scripts, {right:.1f} times as many reference solutions"


@claim
def one_worker(results: Results) -> str:
    """How many cores one worker keeps busy with short scripts: why a second one brings less."""
    by_script = {row["script"]: row for row in service_rows(results, "workers") if row["workers"] == 1}
    cores = [by_script[script]["cores"] for script in ("reference", "empty")]
    demand(min(cores) > 1.05, cores)
    return f"One worker keeps {span(cores)} cores busy with short scripts"
