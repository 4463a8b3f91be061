"""Markup, which the pages must escape."""

print('<script>alert(1)</script>')
