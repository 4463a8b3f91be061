"""The kinds of exercise that come with the grader. Each is a package with a class `Kind`, which is found through the
entry points of pyproject.toml."""
