"""The benchmarks' models. Each has a keyframe `start`, at which its runs begin."""

from pathlib import Path

from grader.numerics.scene import Scene


def find_scene(name: str) -> Path:
    """Where the MJCF of a scene lies."""
    return Path(__file__).parent / f"{name}.xml"


def read_scene(name: str) -> str:
    """Returns the MJCF of a scene."""
    return find_scene(name).read_text(encoding="utf-8")


def load_scene(name: str) -> Scene:
    """Returns the scene at its keyframe `start`."""
    return Scene.from_xml(read_scene(name), key="start")


def describe_scene(name: str) -> str:
    """Returns the name of a scene for readers."""
    return name.replace("_", " ")
