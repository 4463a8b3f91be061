"""Text that reads otherwise than it is."""

print('\u202egnp.exe\u202c \u2066x\u2069 \u200f')
