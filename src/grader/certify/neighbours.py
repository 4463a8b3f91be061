"""What an explanation may have overlooked: the same case under every integrator, also those that are no option."""

import re
from dataclasses import replace
from typing import Any

from grader.certify.certificate import Certificate
from grader.domain.lab import Select
from grader.domain.quiz import PredictQuestion
from grader.labs.integrators import INTEGRATORS
from grader.labs.run import lab_scene, run_lab
from grader.labs.running import Variant
from grader.numerics.scene import Scene
from grader.numerics.search import spectral_limit

LOW_S, HIGH_S = 5e-4, 0.1
"""Where limits are looked for [s]."""

ONLY = re.compile(r"\bonly\b|\bno other\b|\balone\b", re.IGNORECASE)


def neighbours(
    certificate: Certificate, question: PredictQuestion, select: Select, xml: str, seconds: float | None
) -> Certificate:
    """The certificate with all five integrators, and a remark where one that is no option is stable too."""
    config = question.sim
    assert config is not None
    bare = config.model_copy(update={"readouts": (), "plots": (), "trail": None})
    scene = lab_scene(bare, xml)
    offered = {value for _, value in select.options}
    table: dict[str, Any] = {}
    overlooked = []
    for name, code in INTEGRATORS.items():
        stable = run_lab(bare, xml, seconds=seconds, variant=Variant(integrator=code)).stable
        limit_ms = _limit_ms(scene, code)
        table[name] = {"stable": stable, "limit_ms": limit_ms, "is_option": code in offered}
        if stable and code not in offered:
            overlooked.append(name if limit_ms is None else f"{name} (up to {limit_ms:.2f} ms)")
    measured = {**certificate.measured, "all integrators": table}
    return replace(certificate, measured=measured, remarks=(*certificate.remarks, *_remarks(question, overlooked)))


def _remarks(question: PredictQuestion, overlooked: list[str]) -> list[str]:
    if not overlooked:
        return []
    only = ", and the explanation says that only one is" if ONLY.search(question.explain or "") else ""
    return [f"Stable here too, though no option: {', '.join(overlooked)}{only}."]


def _limit_ms(scene: Scene, integrator: int) -> float | None:
    """The timestep [ms] above which small motions grow for ever; None where there is none, or no rest to move about."""
    try:
        limit = spectral_limit(scene, low_s=LOW_S, high_s=HIGH_S, integrator=integrator)
    except ValueError:
        return None
    return None if limit is None else round(1000 * limit, 3)
