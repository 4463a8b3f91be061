"""The kinds of lab that come with the grader; each is found through the entry points of pyproject.toml."""
