"""Not Python."""

def f(:
