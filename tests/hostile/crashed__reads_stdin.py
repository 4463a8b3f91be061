"""There is nobody to answer."""

input('password: ')
