"""Not an Exception either."""

raise GeneratorExit
