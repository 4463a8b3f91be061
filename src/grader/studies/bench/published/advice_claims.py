"""What sentences of the pages say about `grader advise` on foreign models, from the rows of its survey."""

from statistics import median

from grader.studies.bench.published.claims import Results, claim, demand

CHECKED_SHARE = 0.5
"""Largest uncertainty of the independent reference, as a share of the tolerance, with which it checks a choice."""


def advice_rows(results: Results) -> dict[str, Results]:
    """Returns the models that were surveyed, by name."""
    models: dict[str, Results] = results["advice"]["models"]
    return models


def list_checked(results: Results) -> list[Results]:
    """Returns the choices that the independent reference is certain enough to check."""
    limit = CHECKED_SHARE * results["advice"]["tolerance"]
    rows = advice_rows(results).values()
    return [row for row in rows if "choice" in row and row["independent_doubt"] <= limit]


def count_verdict(results: Results, verdict: str) -> int:
    """Returns how many models got this verdict."""
    return sum(row["verdict"] == verdict for row in advice_rows(results).values())


@claim
def advised(results: Results) -> str:
    """How many models were surveyed, and how."""
    about = results["advice"]
    return (
        f"{len(advice_rows(results))} foreign models, thrown with velocities of up to 1, over {about['seconds']:g} s "
        f"within {about['tolerance']:g}"
    )


@claim
def advice_given(results: Results) -> str:
    """How many models got a choice for the whole run, for a part of it, and none."""
    whole, part, none = (count_verdict(results, name) for name in ("choice", "choice until", "none passes"))
    untold, refused = (count_verdict(results, name) for name in ("cannot tell", "refused"))
    demand(untold + refused <= len(advice_rows(results)) / 5, f"{untold} cannot tell, {refused} refused")
    return (
        f"{whole} got a choice for the whole run, {part} up to the time until which it can tell, {none} the answer "
        f"that no setting passes; of {untold + refused} nothing could be told"
    )


@claim
def advice_right(results: Results) -> str:
    """Whether a choice is wrong by the independent reference."""
    about, checked = results["advice"], list_checked(results)
    wrong = [row for row in checked if row["independent_error"] - row["independent_doubt"] > about["tolerance"]]
    demand(not wrong, f"{len(wrong)} wrong: {wrong}")
    chosen = sum("choice" in row for row in advice_rows(results).values())
    return f"none of {len(checked)} choices is wrong, and {chosen - len(checked)} could not be checked"


@claim
def advice_cost(results: Results) -> str:
    """What advice costs."""
    return f"{median(row['cpu_s'] for row in advice_rows(results).values()):.1f} s of CPU time"
