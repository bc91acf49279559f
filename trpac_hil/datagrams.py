"""python-can's udp_multicast with checks on datagrams, which any host on the network can send."""

from __future__ import annotations

import can
import msgpack  # type: ignore[import-untyped]
from can.interfaces.udp_multicast import UdpMulticastBus


def can_message(datagram: bytes, timestamp_s: float, fd: bool) -> can.Message:
    """The CAN message of a datagram; ValueError or TypeError where it is none, or one of CAN FD unasked for.

    python-can takes a number in place of the data for a length and allocates so many bytes: that is refused.
    """
    fields = msgpack.unpackb(datagram, raw=False)
    if not isinstance(fields, dict) or not isinstance(fields.get("data"), bytes | None):
        raise TypeError("no fields of a message, or data that is no bytes")
    message = can.Message(check=True, **(fields | {"timestamp": timestamp_s}))
    if message.is_fd and not fd:
        raise ValueError("a CAN FD message on a bus without CAN FD")
    return message


class DatagramBus(UdpMulticastBus):
    """The bus; raises CanOperationError, caused by ValueError or TypeError, where a datagram is no message."""

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        received = self._multicast.recv(timeout)
        if received is None:
            return None, False
        datagram, _, timestamp_s = received
        try:
            message = can_message(datagram, timestamp_s, self.protocol is can.CanProtocol.CAN_FD)
        except (ValueError, TypeError) as error:
            raise can.CanOperationError("could not unpack received message") from error
        return message, False
