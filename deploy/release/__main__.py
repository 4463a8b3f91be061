"""`python -m release`: builds, checks and describes the release of this commit, in dist/."""

import shutil
import sys
import tomllib
from pathlib import Path

from release.building import ROOT, ReleaseError, build, list_uncommitted
from release.checking import check_client, check_files, check_grader, check_metadata, run
from release.images import build_image, find_engine
from release.notes import read_changes, write_notes

LOCKS = ("requirements-all.lock",)
PROJECTS = {".": check_grader, "client": check_client}


def main() -> None:
    """Makes the release. Raises ReleaseError with what is wrong."""
    if uncommitted := list_uncommitted():
        raise ReleaseError("A release is made of a commit. Commit or remove first:\n" + "\n".join(uncommitted))
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    read_changes(version)
    out = ROOT / "dist"
    shutil.rmtree(out, ignore_errors=True)
    files, checks = [], []
    for project, check in PROJECTS.items():
        if (ROOT / project / "pyproject.toml").exists():
            built = build(project, out)
            for path in built:
                check_metadata(path, version)
                check_files(path)
            files += built
            checks.append(f"{built[-1].name}: built twice, the same bytes; {check(built[-1])}")
            print(checks[-1], flush=True)
    engine = find_engine()
    checks.append(build_image(engine, version) if engine else "No container engine answers: the image was not built")
    print(checks[-1], flush=True)
    if promtool := shutil.which("promtool"):
        run([promtool, "check", "rules", str(ROOT / "deploy/alerts.yml")])
        checks.append("deploy/alerts.yml: promtool accepts the rules")
    files += [Path(shutil.copy(ROOT / name, out / name)) for name in LOCKS]
    write_notes(version, files, checks, out)
    print(f"dist/NOTES.md has the notes. To publish, tag the commit: git tag v{version}")


if __name__ == "__main__":
    try:
        main()
    except ReleaseError as error:
        sys.exit(f"release: {error}")
