"""Not an Exception."""

raise KeyboardInterrupt
