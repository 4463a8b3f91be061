"""Builds the image and grades in it, where a container engine answers."""

import json
import shutil
import subprocess

from release.building import ROOT, ReleaseError
from release.checking import read_choice, run

OPTIONS = ("--security-opt=seccomp=unconfined", "--network=none")
"""What the jail needs of every engine; docs/deploy.md says why."""

MORE = {
    "docker": ("--security-opt=apparmor=unconfined", "--security-opt=systempaths=unconfined"),
    "podman": ("--security-opt=label=disable", "--security-opt=unmask=ALL"),
}


def find_engine() -> str | None:
    """Returns the container engine that answers, if one does."""
    for name in MORE:
        path = shutil.which(name)
        if path and not subprocess.run([path, "info"], capture_output=True, check=False).returncode:  # noqa: S603
            return name
    return None


def build_image(engine: str, version: str) -> str:
    """Builds the image, grades a choice in it and a script in its jail. Returns what was done. Raises ReleaseError."""
    tag = f"mujoco-grader:{version}"
    run([engine, "build", "--tag", tag, "--file", str(ROOT / "deploy/Containerfile"), str(ROOT)])
    inside = [engine, "run", "--rm", *OPTIONS, *MORE[engine], tag]
    tools = "import importlib.util as u, sys; sys.exit(any(map(u.find_spec, ('pip', 'setuptools'))))"
    run([*inside, "python3", "-c", tools])
    run([*inside, "python3", "-c", "import authlib, httpx2, joserfc"])
    choice, answer = read_choice()
    script = "from grader.settings import Settings; print(Settings().content)"
    content = run([*inside, "python3", "-c", script]).strip()
    program = f"{content}/reference_solutions/1.3-exercises/servo-threshold/correct__spectral_radius.py"
    for question in (["1.3-check", choice, str(answer)], ["1.3-exercises", "servo-threshold", program]):
        verdict = json.loads(run([*inside, "grader", "grade", *question, "--json"]))
        if verdict["status"] != "correct":
            raise ReleaseError(f"{tag}: graded {question}: {verdict}")
    return f"{tag}, by {engine}: no pip or setuptools in it; graded a choice and a script"
