"""From text to Python code: the syntax tree, and what each of its nodes becomes."""
