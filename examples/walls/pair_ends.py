"""
Programs at both ends of a pair
===============================

One program is the hand at the leader, another the wall that the follower meets, each at 200 Hz
through the port of a haptic device. Law and link, 10 ms late, run between both arms. In the end the
wall takes the 2 N of the hand; the stiffer one is hit with more.
Needs websockets: ``pip install 'hapticclay[device]'``.
"""

import json

import matplotlib.pyplot as plt
from websockets.sync.client import connect

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

REST, WALL = 0.08, 0.005  # m of the cursor at rest, and from there to the wall
arm, law = hc.Device(mass=0.5, damper=4.0), hc.JointPD((800.0,), (20.0,))
pair = hc.Pair(arm, arm, law, hc.Link(delay="10 ms"), Ts="1 ms")


def exchange(device, force):
    push = {"set_cursor_force": {"values": {"x": force, "y": 0.0, "z": 0.0}}}
    device.send(json.dumps({"inverse3": [{"device_id": "04EA", "commands": push}]}))
    return json.loads(device.recv())["inverse3"][0]["state"]["cursor_position"]["x"] - REST


def press(ends: hc.ports.PairServers, K):
    """The hand presses with 2 N, the follower meets a wall of K."""
    y = 0.0
    with connect(ends.leader.url) as hand, connect(ends.follower.url) as tool:
        hand.recv(), tool.recv()
        for _ in range(200):
            exchange(hand, 2.0)
            y = exchange(tool, -K * max(0.0, y - WALL))


fig, (motion, force) = plt.subplots(2, 1, sharex=True, figsize=(6.4, 4.8))
for K, color in ((300.0, "C0"), (1500.0, "C1")):  # N/m
    with hc.ports.serve_pair(pair, period=0.005) as ends:
        press(ends, K)
        record = ends.record()
    motion.plot(record.t, 1e3 * record.leader, "-", color=color, label=f"leader, {K:g} N/m")
    motion.plot(record.t, 1e3 * record.follower, "--", color=color, label="follower")
    force.plot(record.t, record.contact[:, 0], color=color, label=f"{K:g} N/m")
motion.axhline(1e3 * WALL, color="0.6", lw=1.0)
motion.set(ylabel="handle [mm]", ylim=(-0.5, 24.0))
force.set(xlabel="time [s]", ylabel="force on wall [N]")
motion.legend(fontsize=8, ncols=2, loc="upper right")
force.legend(fontsize=8)
plt.show()
