"""Virtual environments with a few of the installed packages alone, made without a network."""

import subprocess
import sys
import sysconfig
from importlib.metadata import distribution
from pathlib import Path

from packaging.requirements import Requirement


def list_needed(*names: str) -> set[str]:
    """Returns these distributions and all that they require here."""
    needed, waiting = set[str](), [Requirement(name) for name in names]
    while waiting:
        wanted = waiting.pop()
        for text in distribution(wanted.name).requires or []:
            one = Requirement(text)
            if one.marker is None or any(one.marker.evaluate({"extra": extra}) for extra in ("", *wanted.extras)):
                waiting += [one] if one.name not in needed or one.extras else []
        needed.add(wanted.name)
    return needed


def make_environment(folder: Path, *names: str) -> Path:
    """Makes a virtual environment that has these distributions, with what they require, and nothing else. Returns its
    Python."""
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", folder], check=True)
    python = folder / "bin" / "python"
    packages = Path(sysconfig.get_path("purelib", vars={"base": str(folder)}))
    for name in list_needed(*names):
        for top in {file.parts[0] for file in distribution(name).files or [] if file.parts[0] not in ("..", ".")}:
            source = Path(str(distribution(name).locate_file(top)))
            if source.exists() and not (packages / top).exists():
                (packages / top).symlink_to(source)
    return python
