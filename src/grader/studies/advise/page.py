"""Writes advice as a page of its own: the work-precision diagram of the model as SVG, and its numbers as a table."""

from collections.abc import Iterator
from html import escape
from math import ceil, floor, inf, isfinite, log10

from grader.numerics.integrators import INTEGRATORS
from grader.studies.advise.report import Advice
from grader.studies.advise.selection import Candidate, write_error

WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 860.0, 466.0, 70.0, 24.0, 40.0, 56.0
"""Size of the picture and its margins, in its own units."""

ERROR_MIN = 1e-15
"""The smallest error that is drawn: round-off."""

MARKS = ("circle", "square", "diamond", "up", "down")
"""Shapes of the integrators, in the order of INTEGRATORS: colours alone would not tell them apart."""

STYLE = """
:root { color-scheme: light dark; --back: #fff; --ink: #1b1b1f; --faint: #d5d5dc; --c0: #2456a6; --c1: #b3261e;
  --c2: #7a5c00; --c3: #1d6b3a; --c4: #6b3fa0; }
@media (prefers-color-scheme: dark) { :root { --back: #16161a; --ink: #e8e8ee; --faint: #3b3b44; --c0: #8ab4ff;
  --c1: #ff9a92; --c2: #e2c15a; --c3: #7fd6a0; --c4: #c9a6ff; } }
body { font: 16px/1.5 system-ui, sans-serif; max-width: 56rem; margin: 2rem auto; padding: 0 1rem;
  background: var(--back); color: var(--ink); }
h1, p { overflow-wrap: anywhere; } figure { margin: 0; }
svg { display: block; width: 100%; min-width: 46rem; height: auto; }
svg text { fill: var(--ink); font-size: 13px; paint-order: stroke; stroke: var(--back); stroke-width: 4px; }
.grid { stroke: var(--faint); } .front { fill: none; stroke: var(--ink); stroke-width: 1.5; }
.limit { stroke: var(--ink); stroke-dasharray: 6 4; } .doubt { stroke: var(--ink); stroke-dasharray: 2 4; }
.choice { fill: none; stroke: var(--ink); stroke-width: 2; } .diverged { fill: none !important; }
.scroll { overflow-x: auto; } th, td { white-space: nowrap; } table { border-collapse: collapse; width: 100%; }
th, td { padding: .2rem .6rem; border-bottom: 1px solid var(--faint); text-align: right; }
th:first-child, td:first-child, th:last-child, td:last-child { text-align: left; } tr.choice-row { font-weight: 600; }
""" + "".join(f".k{i} {{ fill: var(--c{i}); stroke: var(--c{i}); }} " for i in range(len(INTEGRATORS)))


def draw_page(advice: Advice, title: str) -> str:
    """Returns the whole page; it loads nothing, and follows the reader's choice of light or dark."""
    steps = "".join(f"<li>{escape(step.split('. ', 1)[-1])}</li>" for step in advice.steps)
    skips = "".join(f"<li>{escape(skip)}</li>" for skip in advice.skips)
    name = escape(title)
    picture = draw_figure(advice) if advice.selection.candidates else ""
    better = advice.own_setting()
    reason = escape("; ".join([advice.selection.reason, *([better] if better else [])]))
    return f"""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<title>Advice on {name}</title><style>{STYLE}</style></head><body><main>
<h1>Integrator and timestep for {name}</h1>
<p><strong>{escape(advice.name(advice.choice)) if advice.choice else "No choice"}</strong>:
{reason}.</p>
{picture}
<h2>Every setting that was measured</h2>
{draw_table(advice)}
<p>The reference: {escape(advice.selection.reference) or "none"}, uncertain by
{advice.selection.reference_error:.2g}. Error: the largest,
{advice.describe_samples()}. Cost: evaluations of the forward dynamics a simulated second.</p>
<h2>The procedure</h2><ol>{steps}</ol>
{f"<h2>Skipped: proved to change no bit of the result</h2><ul>{skips}</ul>" if skips else ""}
</main></body></html>
"""


def draw_figure(advice: Advice) -> str:
    """Returns the picture with what its marks mean. It keeps its size on a narrow screen, and scrolls there."""
    about = "The line joins the settings that no other beats in both cost and error; the ring is the choice."
    if any(candidate.error == inf for candidate in advice.selection.candidates):
        about += " Hollow marks at the upper edge diverged."
    picture = f'<div class="scroll" tabindex="0" role="region" aria-label="Diagram">{draw_diagram(advice)}</div>'
    return f"<figure>{picture}<figcaption>{about}</figcaption></figure>"


def draw_table(advice: Advice) -> str:
    """Returns the settings as a table, the cheapest first."""
    rows, doubt = [], advice.selection.reference_error
    for candidate in advice.selection.candidates:
        mark = ' class="choice-row"' if candidate == advice.choice else ""
        error = "diverged" if candidate.error == inf else escape(write_error(candidate.error, doubt, ".2e", "< "))
        front = "yes" if candidate in advice.selection.front else ""
        cells = (f"{candidate.cost:g}", error, f"{1e3 * candidate.cpu:.3g}", front, escape(candidate.warning or ""))
        body = "".join(f"<td>{cell}</td>" for cell in cells)
        rows.append(f'<tr{mark}><th scope="row">{escape(advice.name(candidate))}</th>{body}</tr>')
    head = "".join(
        f'<th scope="col">{name}</th>'
        for name in ("setting", "cost [1/s]", "error", "CPU [ms/s]", "Pareto front", "warning")
    )
    region = '<div class="scroll" tabindex="0" role="region" aria-label="Every setting">'
    return f"{region}<table><thead><tr>{head}</tr></thead><tbody>{''.join(rows)}</tbody></table></div>"


class _Scale:
    """Positions of costs and errors in the picture, both logarithmic."""

    def __init__(self, candidates: tuple[Candidate, ...], *levels: float) -> None:
        costs = [log10(candidate.cost) for candidate in candidates]
        sizes = [candidate.error for candidate in candidates] + [level for level in levels if level > 0]
        errors = [log10(max(size, ERROR_MIN)) for size in sizes if isfinite(size)]
        self.costs = (floor(min(costs)), ceil(max(costs) + 1e-9))
        self.errors = (floor(min(errors)), ceil(max(errors) + 1e-9))

    def x(self, cost: float) -> float:
        low, high = self.costs
        return LEFT + (log10(cost) - low) / (high - low) * (WIDTH - LEFT - RIGHT)

    def y(self, error: float) -> float:
        low, high = self.errors
        size = high if error == inf else min(max(log10(max(error, ERROR_MIN)), low), high)
        return TOP + (high - size) / (high - low) * (HEIGHT - TOP - BOTTOM)


def draw_diagram(advice: Advice) -> str:
    """Returns error against cost as SVG. A hollow mark at the upper edge is a run that diverged."""
    selection = advice.selection
    scale = _Scale(selection.candidates, selection.tolerance, selection.reference_error)
    parts = list(_draw_axes(scale))
    front = " ".join(f"{scale.x(candidate.cost):.1f},{scale.y(candidate.error):.1f}" for candidate in selection.front)
    parts.append(f'<polyline class="front" points="{front}"/>')
    parts += (
        _draw_mark(candidate, scale, advice.name(candidate), selection.reference_error)
        for candidate in selection.candidates
    )
    parts += _draw_level(scale, selection.tolerance, "limit", "tolerance", -6)
    parts += _draw_level(scale, selection.reference_error, "doubt", "uncertainty of the reference", 15)
    if (best := advice.choice) is not None:
        parts.append(f'<circle class="choice" cx="{scale.x(best.cost):.1f}" cy="{scale.y(best.error):.1f}" r="11"/>')
    for row, integrator in enumerate(INTEGRATORS):
        x, y = LEFT + 10 + 130 * row, TOP / 2
        parts.append(f"{_draw_shape(row, x, y, '')}<text x='{x + 14}' y='{y + 4}'>{escape(integrator.name)}</text>")
    about = "Error against cost of every setting; the table below has the same numbers."
    return f'<svg viewBox="0 0 {WIDTH:g} {HEIGHT:g}" role="img" aria-label="{about}">{"".join(parts)}</svg>'


def _draw_axes(scale: _Scale) -> Iterator[str]:
    for power in range(scale.costs[0], scale.costs[1] + 1):
        x = scale.x(10.0**power)
        yield f'<line class="grid" x1="{x:.1f}" x2="{x:.1f}" y1="{TOP}" y2="{HEIGHT - BOTTOM}"/>'
        yield f'<text x="{x:.1f}" y="{HEIGHT - BOTTOM + 24}" text-anchor="middle">1e{power}</text>'
    low, high = scale.errors
    for power in range(low, high + 1, max(1, (high - low) // 8)):
        y = scale.y(10.0**power)
        yield f'<line class="grid" x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y:.1f}" y2="{y:.1f}"/>'
        yield f'<text x="{LEFT - 8}" y="{y + 4:.1f}" text-anchor="end">1e{power}</text>'
    middle = (LEFT + WIDTH - RIGHT) / 2
    cost, error = "cost: evaluations of the forward dynamics a simulated second", "error: largest over the run"
    yield f'<text x="{middle}" y="{HEIGHT - 10}" text-anchor="middle">{cost}</text>'
    yield f'<text transform="rotate(-90)" x="{-HEIGHT / 2}" y="16" text-anchor="middle">{error}</text>'


def _draw_level(scale: _Scale, error: float, kind: str, label: str, below: float) -> list[str]:
    """Returns a line across the picture, with its label `below` it, or above it at the lower edge."""
    if not (isfinite(error) and error > 0):
        return []
    y = scale.y(error)
    line = f'<line class="{kind}" x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y:.1f}" y2="{y:.1f}"/>'
    y += below if y + below < HEIGHT - BOTTOM else -6
    return [line, f'<text x="{LEFT + 6}" y="{y:.1f}">{label} {error:.2g}</text>']


def _draw_mark(candidate: Candidate, scale: _Scale, name: str, doubt: float) -> str:
    error = "diverged" if candidate.error == inf else f"error {write_error(candidate.error, doubt)}"
    x, y = scale.x(candidate.cost), scale.y(candidate.error)
    title = escape(
        f"{name}: {error}, cost {candidate.cost:g}" + (f", {candidate.warning}" if candidate.warning else "")
    )
    shape = _draw_shape(INTEGRATORS.index(candidate.integrator), x, y, " diverged" if candidate.error == inf else "")
    return f'<g tabindex="0"><title>{title}</title>{shape}</g>'


def _draw_shape(kind: int, x: float, y: float, extra: str) -> str:
    """Returns the mark of an integrator, about 10 wide."""
    shape = MARKS[kind]
    if shape == "circle":
        return f'<circle class="k{kind}{extra}" cx="{x:.1f}" cy="{y:.1f}" r="5"/>'
    corners = {
        "square": ((-5, -5), (5, -5), (5, 5), (-5, 5)),
        "diamond": ((0, -6), (6, 0), (0, 6), (-6, 0)),
        "up": ((0, -6), (6, 5), (-6, 5)),
        "down": ((0, 6), (6, -5), (-6, -5)),
    }[shape]
    points = " ".join(f"{x + dx:.1f},{y + dy:.1f}" for dx, dy in corners)
    return f'<polygon class="k{kind}{extra}" points="{points}"/>'
