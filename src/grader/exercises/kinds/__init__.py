"""The kinds of exercise that come with the grader. The entry points of pyproject.toml name them."""
