"""The benchmarks' models, each with a keyframe `start`."""

from pathlib import Path

from grader.numerics.scene import Scene


def scene_path(name: str) -> Path:
    """Where the MJCF of a scene lies."""
    return Path(__file__).parent / f"{name}.xml"


def scene_text(name: str) -> str:
    """The MJCF of a scene."""
    return scene_path(name).read_text(encoding="utf-8")


def load_scene(name: str) -> Scene:
    """The scene at its keyframe `start`."""
    return Scene.from_xml(scene_text(name), key="start")


def words(name: str) -> str:
    """The name of a scene for readers."""
    return name.replace("_", " ")
