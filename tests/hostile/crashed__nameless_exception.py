"""An exception whose name cannot be found."""

class Evil(Exception):
    def __str__(self):
        raise RuntimeError


Evil.__module__ = Evil.__qualname__ = 'x'
raise Evil
