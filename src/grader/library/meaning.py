"""What only shows when a well-formed question is tried: its lab is run, its exercise planned."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace

from grader.domain.lab import IntegratorsLab, Lab, LabConfig
from grader.domain.quiz import CodeQuestion, OpenQuestion, PredictQuestion, Question
from grader.errors import Fault, NotFound
from grader.grading.exercise import check_exercise
from grader.labs.lab import check_integrators, check_lab
from grader.library.crossings import named_models
from grader.library.json_text import join

UNKNOWN = "unknown key: remove it, or begin it with x-; docs/authoring.md lists the known ones"


def meaning_faults(parts: Iterable[Question | Lab], models: Mapping[str, str], file: str) -> Iterator[Fault]:
    """Faults of questions and labs over the `models` that compile; that another is missing is told already."""
    for part in parts:
        for fault in part_faults(part, models, file):
            why = " ".join(fault.why.split())
            yield replace(fault, file=file, why=UNKNOWN if why == "Extra inputs are not permitted" else why)


def part_faults(part: Question | Lab, models: Mapping[str, str], file: str) -> Iterator[Fault]:
    """What is wrong with one question or lab."""

    def model_xml(name: str) -> str:
        if name not in models:
            raise NotFound(f"There is no model {name!r}.")
        return models[name]

    if isinstance(part, CodeQuestion):
        wanted = {name for _, name in named_models(dict(part.check.parameters), "")}
        yield from check_exercise(part, model_xml, file) if wanted <= set(models) else ()
    elif isinstance(part, PredictQuestion) and part.sim is not None:
        yield from lab_faults(part.sim, models, join(part.id, "sim"))
    elif isinstance(part, LabConfig | IntegratorsLab):
        yield from lab_faults(part, models, part.id)
    if isinstance(part, CodeQuestion | OpenQuestion) and part.verify is not None:
        yield Fault(file, join(part.id, "verify"), f"{part.kind} has no key that could be re-derived: remove it")


def lab_faults(lab: LabConfig | IntegratorsLab, models: Mapping[str, str], key: str) -> Iterator[Fault]:
    """What is wrong with one lab, which needs a model's name or its own MJCF; the file's name is left out."""
    xml = lab.xml if isinstance(lab, LabConfig) else None
    if (lab.model is None) == (xml is None):
        yield Fault("", join(key, "model"), "give either model, a name in models/, or xml, the model itself")
        return
    if xml is None:
        xml = models.get(lab.model or "")
    if xml is None:
        return
    yield from check_integrators(lab, xml, key) if isinstance(lab, IntegratorsLab) else check_lab(lab, xml, key)
