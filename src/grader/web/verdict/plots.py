"""Draws the evidence of a verdict: a plot's title says what is to be seen, its table says it without the picture."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any

from markupsafe import Markup

from grader.domain.pages.pictures import Chart
from grader.web.text.numbers import capitalize, keep_unbroken
from grader.web.verdict import evidence as read
from grader.web.verdict.line_plots import plot_chart, plot_difference, plot_order
from grader.web.verdict.motion_plot import plot_motion
from grader.web.verdict.scene_plot import plot_models
from grader.web.verdict.stability_map import plot_stability
from grader.web.verdict.svg import Drawing, Sketch

WIDTHS = {"wide-plot": 734.0, "narrow-plot": 308.0}
BORDER, HEAD = 12, 36
"""Room around a plot in a file of its own, and above it for the title."""


@dataclass(frozen=True)
class Figure:
    """A plot for the page: `name` is the part of its address for the download, `table` has a row of headings first."""

    name: str
    title: str
    caption: str
    pictures: Markup
    table: Sequence[tuple[str, ...]] = ()


def draw_figures(evidence: Mapping[str, Any], titles: Mapping[str, str]) -> list[Figure]:
    """Returns the plots of a verdict, the one that argues most first. `titles` are those of the findings by id."""
    return [draw_both(sketch) for sketch in list_sketches(evidence, titles)]


def draw_both(sketch: Sketch, wide_width: float = WIDTHS["wide-plot"]) -> Figure:
    """Returns the plot at both widths; a style sheet shows one of them."""
    wide, narrow = (sketch.draw(width) for width in (wide_width, WIDTHS["narrow-plot"]))
    described = f"{sketch.title}. {sketch.caption}"
    text = wide.svg("wide-plot", described) + narrow.svg("narrow-plot", described)
    return Figure(sketch.name, sketch.title, sketch.caption, Markup(text), sketch.table)  # noqa: S704  # escaped by Drawing


def list_sketches(evidence: Mapping[str, Any], titles: Mapping[str, str]) -> Iterator[Sketch]:
    """Yields every plot that the evidence allows."""
    runs = read.read_list(evidence, "angles", read.Run)
    limits = {limit.case: limit for limit in read.read_list(evidence, "limits", read.Limit)}
    for claims in group_claims(read.read_list(evidence, "claims", read.Claim)):
        name = titles.get(claims[0].case, claims[0].case).rpartition(", ")[0]
        yield plot_stability(claims, limits, runs, name)
    named = {claim.case: claim.integrator for claim in read.read_list(evidence, "claims", read.Claim)}
    if runs:
        yield plot_motion(runs, named)
    references = {model.case: model for model in read.read_list(evidence, "references", read.Model)}
    for index, model in enumerate(read.read_list(evidence, "models", read.Model)):
        yield plot_models(model, references.get(model.case), capitalize(name_case(titles, model.case)), index)
    order = read.read_one(evidence, "order", read.Order)
    if order is not None and (plot := plot_order(order)) is not None:
        yield plot
    for difference in read.read_list(evidence, "differences", read.Difference):
        if (plot := plot_difference(difference, titles.get(difference.case, difference.case))) is not None:
            yield plot
    charts = [chart for key in ("motions", "charts") for chart in read.read_list(evidence, key, Chart)]
    for index, chart in enumerate(charts):
        if (plot := plot_chart(chart, capitalize(keep_unbroken(name_case(titles, chart.case))), index)) is not None:
            yield plot


def name_case(titles: Mapping[str, str], case: str) -> str:
    """Returns the title of a case, of which each part may be a finding, `case.part`: what stands before the colon."""
    if case in titles:
        return titles[case]
    return next((title for id_, title in titles.items() if id_.startswith(f"{case}.")), case).partition(": ")[0]


def group_claims(claims: Sequence[read.Claim]) -> list[list[read.Claim]]:
    """Returns the claims of each case, whose trials are named `case.integrator`."""
    return [list(some) for _, some in groupby(claims, key=lambda claim: claim.case.rpartition(".")[0])]


def draw_file(sketch: Sketch, styles: str) -> str:
    """Returns the wide plot as a file of its own, in light colours, with the title above it."""
    picture = sketch.draw(WIDTHS["wide-plot"])
    text = picture.svg("wide-plot", sketch.title)
    width, height = picture.width + 2 * BORDER, picture.height + HEAD + BORDER
    corner = f'x="{-BORDER}" y="{-HEAD}"'
    rules = f'<style>{styles}</style><rect {corner} width="{width:g}" height="{height:g}" fill="#fff"/>'
    title = Drawing(picture.width, 0)
    title.text(sketch.title, 0, -14, "name")
    view = f'viewBox="{-BORDER} {-HEAD} {width:g} {height:g}" width="{width:g}"'
    text = re.sub(r'viewBox="[^"]*"', f'xmlns="http://www.w3.org/2000/svg" {view}', text, count=1)
    return text.replace(">", f">{rules}{''.join(title.parts)}", 1)


def extract_light_styles(css: str) -> str:
    """Returns the rules of the style sheet that plots need: the light tokens, the integrators and `.plot`."""
    tokens = re.search(r":root \{.*?\n\}", css, re.DOTALL)
    rules = re.findall(r"^\.(?:plot|Euler|RK4|implicit\w*|discrete)[ .{].*$", css, re.MULTILINE)
    return "\n".join([tokens[0] if tokens else "", *rules])
