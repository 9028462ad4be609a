"""
An arm from a file as a device
==============================

A program renders a floor under the handle of an arm of three joints, at 200 Hz through the port of
a haptic device. The loop report has the stiffness that all joints together carry at this rate.
Needs websockets: ``pip install 'hapticclay[device]'``.
"""

import json

import matplotlib.pyplot as plt
from websockets.sync.client import connect

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

FLOOR = 0.135  # m of the cursor, which rests at 0.14 m
scenario = hc.Scenario(
    arm=hc.MjcfArm("haptic_3"),
    controller=hc.JointPD((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),  # programs alone drive the joints
    operator=hc.Operator(0.25, 5.0, 200.0),  # kg, N.s/m, N/m
    Ts=1e-3,
    dt=1e-3,
)
hand = hc.ports.Trajectory((0.0, 0.3), ((0.0, 0.0, 0.0), (0.01, 0.005, -0.01)))  # presses down


def render(url, K):
    with connect(url) as device:
        z = json.loads(device.recv())["inverse3"][0]["state"]["cursor_position"]["z"]
        for _ in range(240):
            push = {"x": 0.0, "y": 0.0, "z": K * max(0.0, FLOOR - z)}
            command = {"set_cursor_force": {"values": push}}
            device.send(json.dumps({"inverse3": [{"device_id": "04EA", "commands": command}]}))
            z = json.loads(device.recv())["inverse3"][0]["state"]["cursor_position"]["z"]


fig, ax = plt.subplots()
for K, look in ((700.0, "-"), (2200.0, ":")):  # N/m
    with hc.ports.serve(scenario, period=0.005, hand=hand) as server:
        render(server.url, K)
        exchanges: hc.ports.Exchanges = server.exchanges[0]
    print(hc.ports.loop_report(exchanges, scenario).headline())
    ax.plot(exchanges.sampled, 1e3 * exchanges.position[:, 2], look, label=f"{K:g} N/m")
ax.axhline(-5.0, color="0.6", lw=1.0)
ax.set(xlabel="time [s]", ylabel="handle z [mm]")
ax.legend()
plt.show()
