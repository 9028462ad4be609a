"""
A program's wall
================

A program renders a wall at 200 Hz on the simulated device. From its messages alone the loop report
finds the rendered stiffness, and the stiffness that its rate and the hand allow.
Needs websockets: ``pip install 'hapticclay[device]'``.
"""

import json

import matplotlib.pyplot as plt
from websockets.sync.client import connect

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

scenario = hc.Scenario(operator=hc.Operator(0.25, 2.0, 60.0), force=(0.0, 0.0))  # kg, N.s/m, N/m
hand = hc.ports.Trajectory.to((0.03, 0.0))  # wants to be 30 mm ahead
shown = hc.ports.Inverse3(device_id="05DA")


def render(url, K):
    with connect(url) as device:
        x = json.loads(device.recv())["inverse3"][0]["state"]["cursor_position"]["x"]
        for _ in range(300):
            push = {"x": -K * max(0.0, x - 0.085), "y": 0.0, "z": 0.0}
            command = {"set_cursor_force": {"values": push}}
            device.send(json.dumps({"inverse3": [{"device_id": "05DA", "commands": command}]}))
            x = json.loads(device.recv())["inverse3"][0]["state"]["cursor_position"]["x"]


fig, ax = plt.subplots()
for K, look in ((400.0, "-"), (1600.0, ":")):  # N/m
    with hc.ports.serve(scenario, period=0.005, hand=hand, inverse3=shown) as server:
        render(server.url, K)
        exchanges: hc.ports.Exchanges = server.exchanges[0]
    print(hc.ports.loop_report(exchanges, scenario).headline())
    ax.plot(exchanges.sampled, 1e3 * exchanges.position[:, 0], look, label=f"{K:g} N/m")
ax.axhline(5.0, color="0.6", lw=1.0)
ax.set(xlabel="time [s]", ylabel="handle x [mm]")
ax.legend()
plt.show()
