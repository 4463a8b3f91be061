"""The other version of MuJoCo beside the pinned one, under every table: the rows in which its figures differ, or that
its runs are the same to the last bit. Studies of errors are repeated whole with it (`docs/measured/4.0.0`), times are
not; for these tables, `versions.json` has digests of all runs with both versions."""

from collections.abc import Callable

from grader.numerics.integrators import BY_NAME
from grader.studies.bench.physics import adaptive, precision, skip, stability
from grader.studies.bench.physics.collisions import CASES
from grader.studies.bench.published.claims import Results
from grader.studies.bench.scenes import describe_scene

PINNED, OTHER = "3.14.0", "4.0.0"
REPEATED = ("quantities", "impacts", "energy", "regions", "stability")
"""The studies that measure no time, which are repeated with the other version."""

CHARTS = tuple(chart.scene for chart in stability.CHARTS.values())
TABLES: dict[str, tuple[str, tuple[str, ...]]] = {
    **dict.fromkeys(("summary", "precision", "procedure", "orders", "peers"), ("precision", precision.SCENES)),
    **dict.fromkeys(("adaptive",), ("adaptive", (*adaptive.SCENES,))),
    **dict.fromkeys(("pile",), ("adaptive", ("pile",))),
    **dict.fromkeys(("stability", "maps", "windows"), ("stability", CHARTS)),
    **dict.fromkeys(("cases",), ("stability", tuple(case.scene for case in CASES.values()))),
    **dict.fromkeys(("skip", "flags"), ("skip", skip.SCENES)),
    "regions": ("regions", ("oscillator",)),
    "energy": ("energy", ("double_pendulum", "spinning_body")),
    "impacts": ("impacts", ("joint_limits", "cube", "pile")),
    "quantities": ("quantities", (*precision.SCENES, "closed_loop")),
    "models": ("models", ()),
}
"""Each table that depends on MuJoCo: its study, and the scenes of it; for `models` those of its results."""


def describe_other(name: str, render: Callable[[Results], str], results: Results) -> str:
    """Returns what stands under a table about the other version; nothing where the table does not depend on MuJoCo."""
    if name not in TABLES or not results["versions"]:
        return ""
    study, scenes = TABLES[name]
    if study in results["other"]:
        return describe_rows(render(results), render(results | {study: results["other"][study]}))
    return describe_bits(scenes or tuple(results["models"]["models"]), results["versions"]["versions"])


def describe_rows(pinned: str, other: str) -> str:
    """Returns the rows of a rendered table that the other version has otherwise, or that there are none."""
    head, rule, *rows = pinned.splitlines() if pinned.startswith("|") else ("", "", pinned)
    differing = [row for row in other.splitlines()[2 if rule else 0 :] if row not in rows]
    if not differing:
        return f"\n\nMuJoCo {OTHER} gives the same figures in every row."
    if not rule:
        return f"\n\nMuJoCo {OTHER}: {other}"
    rest = f"; its other {len(rows) - len(differing)} rows are the same" if len(differing) < len(rows) else ""
    return "\n".join([f"\n\nMuJoCo {OTHER}{rest}:\n", head, rule, *differing])


def describe_bits(scenes: tuple[str, ...], versions: Results) -> str:
    """Returns for which scenes and integrators the runs of both versions are the same to the last bit."""
    ours, theirs = (versions[version]["digests"] for version in (PINNED, OTHER))
    otherwise: dict[tuple[str, ...], list[str]] = {}
    for name in dict.fromkeys(scenes):
        kinds = tuple(kind for kind, digest in ours[name].items() if digest != theirs[name][kind])
        if kinds:
            otherwise.setdefault(kinds, []).append(describe_scene(name))
    if not otherwise:
        return f"\n\nMuJoCo {OTHER}: the same runs, to the last bit, under every integrator."
    parts = [
        ("" if len(kinds) == len(BY_NAME) else f"under {', '.join(kinds)} ") + f"on {', '.join(names)}"
        for kinds, names in otherwise.items()
    ]
    return f"\n\nMuJoCo {OTHER}: the same runs, to the last bit, except {'; '.join(parts)}."
