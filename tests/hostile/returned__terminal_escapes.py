"""Clears the instructor's screen, sets the title, hides text."""

print('\x1b[2J\x1b]0;owned\x07\x1b[8mhidden\x1b[0m\x9b31mred')
