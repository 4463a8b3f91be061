"""Rosters: read from CSV and OneRoster files, compared with the members of a course, and brought in line."""
