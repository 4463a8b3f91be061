"""A verdict on pages: its card, and its evidence as pictures with tables. Evidence of an unknown shape is left out,
never an error."""
