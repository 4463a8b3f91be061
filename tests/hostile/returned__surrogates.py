"""Half a character."""

print('\ud800')
