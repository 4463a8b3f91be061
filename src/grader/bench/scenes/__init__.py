"""The benchmarks' models, each with a keyframe `start`."""

from pathlib import Path

from grader.numerics.scene import Scene

HERE = Path(__file__).parent


def scene_path(name: str) -> Path:
    """Where the MJCF of a scene lies."""
    return HERE / f"{name}.xml"


def scene_text(name: str) -> str:
    """The MJCF of a scene."""
    return scene_path(name).read_text(encoding="utf-8")


def load_scene(name: str) -> Scene:
    """The scene at its keyframe `start`."""
    return Scene.from_xml(scene_text(name), key="start")
