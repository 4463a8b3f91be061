"""An exception of 64 MB."""

raise ValueError('x' * (64 << 20))
