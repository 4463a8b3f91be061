"""The course's own module: where the models of this exercise are."""

from pathlib import Path

MODELS = Path(__file__).resolve().parent / "models"


def model_path(name: str) -> Path:
    """Path of a model by its name, e.g. model_path("pendulum"). Raises FileNotFoundError."""
    path = MODELS / f"{Path(str(name)).name.removesuffix('.xml')}.xml"
    if not path.is_file():
        known = ", ".join(sorted(path.stem for path in MODELS.glob("*.xml"))) or "none"
        raise FileNotFoundError(f"There is no model {name!r} in this kit; it has: {known}")
    return path
