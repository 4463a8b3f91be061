"""Calls submit itself: a claim."""

import sys

frame = sys._getframe()
while frame:
    if 'submit' in frame.f_globals:
        frame.f_globals['submit']('mine', [1.0])
        break
    frame = frame.f_back
