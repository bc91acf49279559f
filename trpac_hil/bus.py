"""A CAN bus of any python-can interface; a lost bus is reopened in a thread beside the loop."""

from __future__ import annotations

import errno
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import can
from can.interfaces import BACKENDS

from scenarios.errors import suggestion
from trpac_core.files import quoted
from trpac_hil.errors import HilError
from trpac_hil.inputs import ReportEvent
from trpac_hil.message import CLASSIC_BYTES, padded

RETRY_S = 0.5
"""Pause between attempts to reopen a lost bus [s]."""
MOST_AT_ONCE = 512
"""Frames of any kind that one cycle reads at most; the rest waits for the next cycle."""
BUS_ERRORS = (can.CanError, OSError)
"""Exceptions that interfaces raise when a bus fails."""
OPENING_ERRORS = (*BUS_ERRORS, ValueError, TypeError, ImportError, NameError, NotImplementedError)
"""Exceptions that they raise when a bus cannot be opened."""
NOT_INSTALLED = (ImportError, NameError, can.CanInterfaceNotImplementedError)
"""Those of them that python-can raises where what an interface needs is missing."""
FD_PROTOCOLS = (can.CanProtocol.CAN_FD, can.CanProtocol.CAN_FD_NON_ISO)
FD_OPTION = "fd"
"""Option of most interfaces that makes the bus one of CAN FD."""
WHY = {
    errno.ENODEV: "there is no such channel on this machine; `ip link` lists those that there are",
    errno.EAFNOSUPPORT: "this system's kernel has no SocketCAN",
    errno.ENETDOWN: "the channel is down; `ip link set CHANNEL up` takes it up",
    errno.EPERM: "permission is denied",
}
"""What the usual errors of opening mean."""
GARBLED_BY = (
    ValueError,
    TypeError,
    AttributeError,
    LookupError,
    ArithmeticError,
    MemoryError,
    RecursionError,
)
"""Causes of python-can's error where received data are no CAN message; a failing bus has other causes."""
BACKENDS["udp_multicast"] = ("trpac_hil.datagrams", "DatagramBus")


@dataclass(frozen=True)
class BusSettings:
    """How to open the bus: python-can's interface, channel and further options of that interface."""

    interface: str = "virtual"
    channel: str = "trpac"
    options: Mapping[str, Any] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """Interface and channel, as messages name them."""
        return f"{self.interface} {self.channel}"

    def check(self) -> None:
        """Raise HilError where python-can knows no such interface."""
        if self.interface not in can.VALID_INTERFACES:
            hint = suggestion(quoted(self.interface), sorted(can.VALID_INTERFACES))
            raise HilError(f"--interface {quoted(self.interface)}: unknown to python-can; {hint}")

    def open(self) -> can.BusABC:
        """The open bus; raises what the interface raises.

        No filters are set: where python-can filters in software, a read without waiting ends at the first message that
        is filtered out.
        """
        options = dict(self.options)
        if self.interface == "virtual" and options.pop(FD_OPTION, False):
            options["protocol"] = can.CanProtocol.CAN_FD
        return can.Bus(channel=self.channel, interface=self.interface, **options)


def frame(frame_id: int, extended: bool, data: bytes) -> can.Message:
    """A message; one of more than 8 bytes is of CAN FD, filled up to one of its lengths."""
    fd = len(data) > CLASSIC_BYTES
    return can.Message(
        arbitration_id=frame_id,
        is_extended_id=extended,
        data=data.ljust(padded(len(data)), b"\0") if fd else data,
        is_fd=fd,
    )


def no_fd(what: str) -> str:
    """What to say of a message that is too long for a bus without CAN FD."""
    return (
        f"{what}, which is CAN FD, and the bus is classic CAN (8 bytes at most). "
        "Open it with --bus-option fd=true and the bit rates that the interface wants for it."
    )


def bus_options(pairs: Sequence[str]) -> dict[str, Any]:
    """Interface options from NAME=VALUE texts; raises HilError."""
    options: dict[str, Any] = {}
    for pair in pairs:
        name, sign, text = pair.partition("=")
        if not sign or not name:
            raise HilError(f"--bus-option {pair}: expected NAME=VALUE, such as bitrate=1000000.")
        words: dict[str, Any] = {"true": True, "false": False}
        options[name] = words.get(text.lower(), can.util.cast_from_string(text))
    return options


class Link:
    """The bus as the loop uses it: no method waits, and none raises.

    `tap` is called with each message that comes or goes.
    """

    def __init__(
        self,
        open_bus: Callable[[], can.BusABC],
        report: ReportEvent,
        retry_s: float = RETRY_S,
        name: str = "the bus",
    ) -> None:
        """Open the bus; raises HilError, with its `name`, where it cannot be opened at the start."""
        self._open, self._report, self._retry_s = open_bus, report, retry_s
        self.tap: Callable[[can.Message], None] | None = None
        self.losses = self.unsent = self.error_frames = self.garbled = self.backlogs = 0
        self._found: can.BusABC | None = None
        self._closing = threading.Event()
        self._seeker: threading.Thread | None = None
        try:
            self._bus: can.BusABC | None = open_bus()
        except OPENING_ERRORS as error:
            why = f"{type(error).__name__}: {quoted(error)}"
            if isinstance(error, NOT_INSTALLED):
                why = f"the interface's driver or package is not installed ({quoted(error)})"
            why = WHY.get(getattr(error, "errno", None) or 0, why).rstrip(".")
            raise HilError(
                f"{quoted(name)} cannot be opened: {why}. Check --interface, --channel and --bus-option; "
                "docs/guide/bus.md has examples."
            ) from error

    @property
    def up(self) -> bool:
        """Whether there is a bus."""
        return self._bus is not None

    @property
    def fd(self) -> bool:
        """Whether the bus is one of CAN FD."""
        return self._bus is not None and self._bus.protocol in FD_PROTOCOLS

    def receive(self) -> list[can.Message]:
        """Messages received since the last call, from at most `MOST_AT_ONCE` frames; none while the bus is lost."""
        bus = self._bus or self._back()
        messages: list[can.Message] = []
        if bus is None:
            return messages
        for _ in range(MOST_AT_ONCE):
            try:
                message = bus.recv(0.0)
            except BUS_ERRORS as error:
                if isinstance(error, can.CanOperationError) and isinstance(error.__cause__, GARBLED_BY):
                    self._leave_aside(error.__cause__)
                    continue
                self._lose(f"{type(error).__name__}: {quoted(error)}")
                return messages
            if message is None:
                return messages
            if message.is_error_frame:
                self.error_frames += 1
            elif not _sound(message):
                self._leave_aside("identifier or data of a wrong kind")
            elif not message.is_remote_frame:
                messages.append(message)
                if self.tap is not None:
                    self.tap(message)
        self.backlogs += 1
        return messages

    def _leave_aside(self, why: object) -> None:
        self.garbled += 1
        self._report(
            "garbled",
            f"A received packet is not a CAN message and is ignored ({quoted(why)}). "
            "Something else sends to the bus's address; give the bus one of its own.",
        )

    def drain(self, longest_s: float = 1.0) -> None:
        """Discard waiting messages, whose age is unknown."""
        end_s = time.monotonic() + longest_s
        while time.monotonic() < end_s:
            backlogs = self.backlogs
            if not self.receive() and self.backlogs == backlogs:
                return

    def send(self, frame_id: int, extended: bool, data: bytes) -> None:
        """Send a message; one that cannot be sent is counted in `unsent`."""
        if self._bus is None:
            return
        message = frame(frame_id, extended, data)
        try:
            self._bus.send(message)
            if self.tap is not None:
                message.timestamp, message.is_rx = time.time(), False
                self.tap(message)
        except can.CanOperationError as error:
            # The transmit buffer is full: no node acknowledges, or too much is sent. The bus is not lost.
            self.unsent += 1
            self._report("unsent", f"A message could not be sent: {quoted(error)}")
        except BUS_ERRORS as error:
            self.unsent += 1
            self._lose(f"{type(error).__name__}: {quoted(error)}")

    def check(self) -> None:
        """Treat the bus as lost where the interface reports the controller as bus-off."""
        if self._bus is None:
            return
        try:
            if self._bus.state is can.BusState.ERROR:
                self._lose("the controller is bus-off")
        except NotImplementedError:
            return
        except BUS_ERRORS as error:
            self._lose(f"{type(error).__name__}: {quoted(error)}")

    def _lose(self, why: str) -> None:
        self.losses += 1
        self._report(
            "bus lost", f"The bus was lost ({why}). TRPAC is held with flag 0; trying to open it again."
        )
        lost, self._bus = self._bus, None
        # Closing and opening may take seconds, so both run outside the loop's thread.
        self._seeker = threading.Thread(target=self._seek, args=(lost,), name="bus", daemon=True)
        self._seeker.start()

    def _seek(self, lost: can.BusABC | None) -> None:
        if lost is not None:
            _shut(lost)
        while not self._closing.wait(self._retry_s):
            try:
                self._found = self._open()
            except OPENING_ERRORS:
                continue
            return

    def _back(self) -> can.BusABC | None:
        if self._found is not None:
            self._bus, self._found = self._found, None
            self._report("bus back", "The bus is back.")
        return self._bus

    def close(self) -> None:
        """Shut the bus, 20 ms after the last message was handed over."""
        self._closing.set()
        if self._seeker is not None:
            self._seeker.join(2.0)
        for bus in (self._bus, self._found):
            if bus is not None:
                time.sleep(0.02)
                _shut(bus)
        self._bus = self._found = None


def _sound(message: can.Message) -> bool:
    """Whether identifier and data have valid types and ranges, which python-can does not check."""
    number = message.arbitration_id
    return (
        isinstance(number, int)
        and isinstance(message.is_extended_id, int)
        and 0 <= number < (2**29 if message.is_extended_id else 2**11)
        and isinstance(message.data, bytes | bytearray)
    )


def _shut(bus: can.BusABC) -> None:
    try:
        bus.shutdown()
    except BUS_ERRORS:
        return
