"""Escapes in the last line of the traceback."""

raise ValueError('\x1b[2J\u202eevil\x00' + 'y' * 5000)
