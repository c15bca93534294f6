"""One server of pages for all tests, whose scene and controls begin anew for each."""

import pytest

from ur_pendant.server import PageServer


@pytest.fixture(scope="session")
def one_server():
    server = PageServer("127.0.0.1", 0, None, "test")
    yield server
    server.stop()


@pytest.fixture
def server(one_server):
    yield one_server
    one_server.gui.reset()
    one_server.scene.reset()
    while not one_server.events._queue.empty():
        one_server.events._queue.get()
