"""An exception of 48 MB."""

raise ValueError('x' * (48 << 20))
