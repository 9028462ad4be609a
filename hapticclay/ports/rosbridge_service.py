"""The dialogue of a rosbridge server with a haptic device: topics in and out, few services."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from . import rosbridge
from .commands import IDLE
from .rosbridge import LEVELS, PUBLISHED, TAKEN, Operation

if TYPE_CHECKING:
    from .sessions import Host, Session

MOST_TOPICS = 100  # topics that a client may subscribe to
MOST_SUBSCRIPTIONS = 500  # subscriptions of a client, which differ in topic or id


@dataclass
class Subscriptions:
    """Subscriptions of a client."""

    topics: dict[str, str] = field(default_factory=dict)  # their kinds, by name
    # least time between two messages [s], by topic and id of the subscription
    throttles: dict[str, dict[str | int | None, float]] = field(default_factory=dict)
    # simulated time of the newest state sent [s], by topic
    sent: dict[str, float] = field(default_factory=dict)
    level: str = "error"  # least severe of the status messages that the client wants
    # those pressed in the last message, by topic of buttons
    buttons: dict[str, frozenset[str]] = field(default_factory=dict)

    def add(self, operation: Operation, kind: str) -> None:
        self.topics[operation.topic] = kind
        self.throttles.setdefault(operation.topic, {})[operation.id] = operation.throttle

    def refusal(self, operation: Operation) -> str:
        """Why a subscription would be one too many; "" if it would not."""
        known = self.throttles.get(operation.topic)
        if known is None and len(self.topics) >= MOST_TOPICS:
            return f"more than {MOST_TOPICS} topics"
        count = sum(map(len, self.throttles.values()))
        if operation.id not in (known or {}) and count >= MOST_SUBSCRIPTIONS:
            return f"more than {MOST_SUBSCRIPTIONS} subscriptions"
        return ""

    def remove(self, operation: Operation) -> None:
        """Ends one subscription; without an id, all subscriptions to a topic."""
        left = self.throttles.get(operation.topic, {})
        if operation.id is None:
            left.clear()
        left.pop(operation.id, None)
        if not left:
            for table in (self.topics, self.throttles, self.sent, self.buttons):
                table.pop(operation.topic, None)


class RosbridgeProtocol:
    """The protocol of rosbridge v2, with topics of CRTK and of the drivers of the Touch."""

    name, pushes = "rosbridge", True

    def __init__(self):
        self._epoch = time.time()

    def greet(self, service: Host, session: Session) -> list[str]:
        """Nothing: a client subscribes first."""
        session.memory = Subscriptions()
        return []

    def answer(self, service: Host, session: Session, data: str | bytes) -> list[str]:
        """Status messages, service responses, and the topics that are due after a command."""
        operation = rosbridge.read_operation(data)
        if operation.error:
            return self._status(service, session, "error", operation.error, operation)
        act = OPERATIONS.get(operation.op)
        if act is None:
            text = f"unknown operation: {operation.op}"
            return self._status(service, session, "error", text, operation)
        return act(self, service, session, operation)

    def due(self, service: Host, session: Session) -> list[str]:
        """Subscribed topics with a state newer than the last one sent."""
        kept, t, out = session.memory, service.device.sensed.t, []
        cursor, joints, pressed = service.cursor(), service.joints, service.pressed
        epoch = self._epoch if service.clock == "wall" else 0.0
        for topic, kind in kept.topics.items():
            if kind == "phantom/button" and kept.buttons.get(topic) == pressed:
                continue
            before = kept.sent.get(topic)
            wait = min(kept.throttles[topic].values())
            if before is not None and 0.0 <= t - before < max(wait, 1e-9):
                continue
            kept.sent[topic] = t
            if kind == "phantom/button":
                kept.buttons[topic] = pressed
            msg = rosbridge.ros_message(kind, cursor, joints, pressed, epoch + t)
            out.append(rosbridge.publish_text(topic, msg))
        return out

    def inventory(self, service: Host) -> dict[str, Any]:
        """Topics and their types, as plain data."""
        return {"published": dict(PUBLISHED), "taken": dict(TAKEN)}

    # ---- operations

    def _subscribe(self, service: Host, session: Session, x: Operation) -> list[str]:
        kind, kept = rosbridge.kind_of(x.topic, PUBLISHED), session.memory
        wrong = _wrong_type(x, PUBLISHED.get(kind, ""))
        if x.compression not in ("none", "None"):
            wrong = f"compression {x.compression} is not simulated"
        if wrong := wrong or (kept.refusal(x) if kind else ""):
            return self._status(service, session, "error", wrong, x)
        if not kind:
            text = f"nothing is published on {x.topic}"
            return self._status(service, session, "warning", text, x)
        kept.add(x, kind)
        kept.sent.pop(x.topic, None)
        return self.due(service, session)

    def _unsubscribe(self, service: Host, session: Session, x: Operation) -> list[str]:
        session.memory.remove(x)
        return []

    def _advertise(self, service: Host, session: Session, x: Operation) -> list[str]:
        kind = rosbridge.kind_of(x.topic, TAKEN)
        if wrong := _wrong_type(x, TAKEN.get(kind, "")):
            return self._status(service, session, "error", wrong, x)
        if not kind:
            text = f"nobody listens to {x.topic}"
            return self._status(service, session, "warning", text, x)
        return []

    def _unadvertise(self, service: Host, session: Session, x: Operation) -> list[str]:
        """Removes the command of a client that stops publishing it."""
        if rosbridge.kind_of(x.topic, TAKEN) and session.command != IDLE:
            session.command = IDLE
        return []

    def _publish(self, service: Host, session: Session, x: Operation) -> list[str]:
        kind = rosbridge.kind_of(x.topic, TAKEN)
        if not kind:
            text = f"nobody listens to {x.topic}"
            return self._status(service, session, "warning", text, x)
        command, left_out = rosbridge.command_of(kind, x.msg)
        statuses = self._status(service, session, "error", left_out, x) if left_out else []
        service.apply(session, command)
        return [*statuses, *self.due(service, session)]

    def _call_service(self, service: Host, session: Session, x: Operation) -> list[str]:
        values = self._called(service, x)
        if values is None:
            text = f"Service {x.topic} does not exist"
            service.count(text)
            return [rosbridge.response_text(x, text, False)]
        return [rosbridge.response_text(x, values, True)]

    def _called(self, service: Host, x: Operation) -> dict[str, Any] | None:
        """Result of a service; None for an unknown service."""
        both = PUBLISHED | TAKEN
        if x.topic == "/rosapi/topics":
            return {"topics": [f"/{name}" for name in both], "types": list(both.values())}
        if x.topic == "/rosapi/topic_type":
            return {"type": both.get(rosbridge.kind_of(str(x.msg.get("topic", "")), both), "")}
        if x.topic == "/rosapi/get_time":
            return {"time": rosbridge.ros_time(self._epoch + service.device.t)}
        return None

    def _set_level(self, service: Host, session: Session, x: Operation) -> list[str]:
        if x.topic not in LEVELS:
            return self._status(service, session, "error", f"no level {x.topic}", x)
        session.memory.level = x.topic
        return []

    def _status(
        self, service: Host, session: Session, level: str, text: str, to: Operation
    ) -> list[str]:
        """A status message, if the client wants messages of its level."""
        service.count(text)
        if LEVELS.index(level) > LEVELS.index(session.memory.level):
            return []
        return [rosbridge.status_text(level, text, to)]


OPERATIONS = {
    "subscribe": RosbridgeProtocol._subscribe,
    "unsubscribe": RosbridgeProtocol._unsubscribe,
    "advertise": RosbridgeProtocol._advertise,
    "unadvertise": RosbridgeProtocol._unadvertise,
    "publish": RosbridgeProtocol._publish,
    "call_service": RosbridgeProtocol._call_service,
    "set_level": RosbridgeProtocol._set_level,  # the name in rosbridge_library
    "set_status_level": RosbridgeProtocol._set_level,  # and in its specification
}


def _wrong_type(x: Operation, known: str) -> str:
    """Why the type that a client gives a topic is wrong; "" if it is right."""
    if not known or not x.type or x.type == known:
        return ""
    return f"{x.topic} is of type {known}, not {x.type}"
