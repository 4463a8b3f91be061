"""`make docs`: the documentation site, made of docs/, the pages beside it, docstrings and OpenAPI."""
