"""Keys of the administrator."""

print(open("/root/.ssh/id_rsa").read())
