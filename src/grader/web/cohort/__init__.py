"""Pages about a whole class at one question: its answers on one axis, its mistakes, scripts side by side, slides."""
