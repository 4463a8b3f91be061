"""A small file that becomes a large one on a small disk."""
# limits: memory_mb=256

import zlib

data = zlib.compress(bytes(1 << 25))
with open('bomb', 'wb') as file:
    file.write(zlib.decompress(data))
    file.write(zlib.decompress(data))
