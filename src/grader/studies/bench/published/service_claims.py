"""What sentences of the pages say about the service, as `claims` does for the other studies."""

from grader.studies.bench.published.claims import Results, claim, demand, span


def service_rows(results: Results, kind: str) -> list[Results]:
    """Returns the rows of the service's study of one kind."""
    return [row for row in results["service"]["loads"] if row["kind"] == kind]


@claim
def more_answers(results: Results) -> str:
    """How many answers the service takes beside a route that only stores them, whatever the database."""
    ratios = [row["ratio"] for row in service_rows(results, "beside")]
    demand(min(ratios) > 1, f"ratios {span(ratios, '.2f')}")
    return f"takes {span(ratios, '.1f')} times as many answers"


@claim
def late_answers(results: Results) -> str:
    """How late the last of a hundred answers are."""
    rows = service_rows(results, "beside")
    most = max(row["students"] for row in rows)
    late = max(row["p99_s"] for row in rows if row["students"] == most)
    demand(late < 0.05, f"99 of 100 within {1e3 * late:.0f} ms")
    return f"With {most} learners at once 99 of 100 answers are back within {1e3 * late:.0f} ms"


@claim
def second_worker(results: Results) -> str:
    """What a second worker brings, by how long scripts compute."""
    found = {row["script"]: row for row in service_rows(results, "workers") if row["workers"] == 2}
    long, right, empty = (found[script]["ratio"] for script in ("long", "reference", "empty"))
    demand(long > right > empty > 1 and long > 1.8, [long, right, empty])
    return f"grades {long:.1f} times as many long scripts, {right:.1f} times as many reference solutions"


@claim
def one_worker(results: Results) -> str:
    """How many cores one worker keeps busy with short scripts: why a second one brings less."""
    found = {row["script"]: row for row in service_rows(results, "workers") if row["workers"] == 1}
    cores = [found[script]["cores"] for script in ("reference", "empty")]
    demand(min(cores) > 1.05, cores)
    return f"One worker keeps {span(cores)} cores busy with short scripts"
