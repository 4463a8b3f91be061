"""Pulls the floor away."""

import builtins

for name in list(vars(builtins)):
    if name not in ('__import__', 'list', 'vars', 'delattr', 'BaseException', 'Exception'):
        delattr(builtins, name)
undefined
