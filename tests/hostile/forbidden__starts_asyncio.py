"""An event loop wants epoll and sockets."""

import asyncio

asyncio.run(asyncio.sleep(0))
