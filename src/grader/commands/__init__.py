"""The command line, `grader ...`: one module a group of commands.

A command reads its options, calls a room below, and prints; it imports what it needs when it runs.
"""
