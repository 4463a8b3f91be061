"""Imports a lesson written in Markdown as quiz JSON. A lab with faults is left out and listed; everything else is
written."""
