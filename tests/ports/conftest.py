"""Clients of the simulated device, and scenes for it."""

import contextlib
import json

import pytest
from websockets.sync.client import connect

import hapticclay as hc
from hapticclay.ports import serve
from tests.waiting import PATIENCE

SCENE = hc.Scenario(operator=hc.Operator(0.25, 2.0, 60.0), force=(0.0, 0.0))


def tick(x=0.0, y=0.0, z=0.0, key="values", device_id="04EA"):
    """The message of nearly every client: a force on the cursor."""
    force = {"set_cursor_force": {key: {"x": x, "y": y, "z": z}}}
    return json.dumps({"inverse3": [{"device_id": device_id, "commands": force}]})


class Client:
    """A client that waits for each answer."""

    def __init__(self, url, **options):
        self.socket = connect(url, compression=None, **options)
        self.first = json.loads(self.socket.recv())

    def send(self, data):
        self.socket.send(data)
        return json.loads(self.socket.recv(timeout=PATIENCE))

    def state(self, data):
        return self.send(data)["inverse3"][0]["state"]


@pytest.fixture
def served():
    """A function that serves a scene, and one that connects a client."""
    with contextlib.ExitStack() as stack:

        def begin(scene=SCENE, **options):
            server = stack.enter_context(serve(scene, **options))

            def client(**more):
                made = Client(server.url, **more)
                stack.callback(made.socket.close)
                return made

            return server, client

        yield begin
