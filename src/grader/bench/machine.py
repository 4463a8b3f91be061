"""The machine and the versions that a measurement belongs to."""

import hashlib
import os
import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

PACKAGES = ("mujoco", "numpy", "scipy", "pin", "drake")
NOT_MEASURING = ("tables.py", "measured.py", "agree.py", "floors.py", "run.py", "speed.py", "jail.py", "service.py")
ROOT = Path(__file__).parents[1]


def versions() -> dict[str, str]:
    """Versions of Python and of each package; `not installed` where an optional one is missing."""
    found = {"python": platform.python_version()}
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "not installed"
    return found


def processor() -> str:
    """The name of the processor, as the kernel gives it."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def machine() -> dict[str, str | int | float]:
    """Processor, cores, system, and the load when asked: what a reader needs to judge a time."""
    return {
        "processor": processor(),
        "cores": os.cpu_count() or 1,
        "architecture": platform.machine(),
        "system": f"{platform.system()} {platform.release()}",
        "load_1min": round(os.getloadavg()[0], 2),
    }


def code_digest() -> str:
    """A digest of the code and the scenes that measure, not of what draws: other code, other measurement."""
    digest = hashlib.sha256()
    for folder in ("bench", "bench/scenes", "numerics"):
        for path in sorted((ROOT / folder).iterdir()):
            if path.suffix in (".py", ".xml", ".c") and path.name not in NOT_MEASURING:
                digest.update(path.read_bytes())
    return digest.hexdigest()[:16]
