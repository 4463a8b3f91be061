"""One file per change of the tables, in order.

Each has an upgrade and a downgrade.
"""
