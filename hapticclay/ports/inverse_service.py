"""The dialogue of a Haply Inverse service: an inventory, then one state frame per message."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from . import inverse

if TYPE_CHECKING:
    from .sessions import Host, Session


class InverseProtocol:
    """The protocol of the Inverse service, versions 3.1 to 3.5."""

    name, pushes = "inverse", False

    def greet(self, service: Host, session: Session) -> list[str]:
        """The inventory."""
        return [inverse.frame_text(frame_of(service, session, full=True))]

    def answer(self, service: Host, session: Session, data: str | bytes) -> list[str]:
        """Returns one frame for any message."""
        message, shown = inverse.read_message(data), service.inverse3
        others = {x for x in message.devices if x not in (shown.device_id, shown.grip_id)}
        for notice in message.notices:
            service.count(notice)
        for name in sorted(others):
            service.count(f"a client drives {name}, this device is {shown.device_id}")
        session.profile = message.profile or session.profile
        service.apply(session, message.command(shown.device_id))
        return [inverse.frame_text(frame_of(service, session, message.full))]

    def due(self, service: Host, session: Session) -> list[str]:
        """Nothing: the service only answers messages."""
        return []

    def inventory(self, service: Host) -> dict[str, Any]:
        """The devices of each kind, as plain data."""
        found = inverse.frame_data(frame_of(service, None, full=True))
        return {kind: found[kind] for kind in inverse.DEVICES}


def frame_of(service: Host, session: Session | None, full: bool) -> inverse.Frame:
    """The state of the device."""
    mode, number = (session.command.mode, session.number) if session else ("idle", 0)
    shown = service.inverse3
    return inverse.Frame(
        shown.device_id,
        service.cursor(mode),
        shown.grip_id,
        service.pressed,
        number,
        full,
    )
