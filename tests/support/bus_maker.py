"""A drive of `log_maker` as frames of a bus, and a DBC file that describes them."""

from __future__ import annotations

from pathlib import Path

import can
import cantools

W = ("fl", "fr", "rl", "rr")
NONE = 65535
"""Raw value of a wheel's speed that is not available."""


def _wheels(start: int, step: int, form: str, more: str, name: str) -> str:
    return "\n".join(
        f" SG_ {name.format(w)} : {start + step * i}|16@{form} {more} ECU" for i, w in enumerate(W)
    )


DBC = f"""VERSION ""
NS_ :
BS_:
BU_: ECU

BO_ 256 Wheels: 8 ECU
{_wheels(0, 16, "1+", '(0.01,0) [0|500] "rad/s"', "wheel_speed_{}_rad_s")}

BO_ {0x80000000 | 0x18FF0101} Torque: 8 ECU
{_wheels(7, 16, "0-", '(0.125,0) [-4000|4000] "Nm"', "Trq_{}")}

BO_ 258 Motion: 12 ECU
 SG_ Speed : 0|32@1- (1,0) [0|0] "m/s" ECU
 SG_ Ax : 39|16@0- (0.001,0.02) [-30|30] "m/s^2" ECU
 SG_ Position : 48|32@1+ (0.0001,-100) [0|0] "m" ECU

BO_ 259 Page: 3 ECU
 SG_ Which M : 0|8@1+ (1,0) [0|0] "" ECU
 SG_ Steer m0 : 8|16@1- (0.0001,0) [0|0] "rad" ECU
 SG_ Yaw m1 : 8|16@1- (0.0001,0) [0|0] "rad/s" ECU

BO_ 260 Other: 1 ECU
 SG_ Speed : 0|8@1+ (1,0) [0|0] "m/s" ECU

{"".join(f'VAL_ 256 wheel_speed_{w}_rad_s {NONE} "SNA" ;' + chr(10) for w in W)}
SIG_VALTYPE_ 258 Speed : 1;
"""
"""Wheels: Intel; Torque: Motorola, extended; Motion: CAN FD, with a float; Page: multiplexed."""

MAPPING = """schema: 1
columns:
  wheel_torque_fl_nm: Torque.Trq_fl
  wheel_torque_fr_nm: Torque.Trq_fr
  wheel_torque_rl_nm: Trq_rl
  wheel_torque_rr_nm: Trq_rr
  vehicle_speed_m_s: Motion.Speed
  accel_x_m_s2: Ax
  position_m: Position
"""
QUANTUM = {"wheel_s": 0.01, "wheel_t": 0.125, "vehicle": 2e-6, "accel_x": 0.001, "positio": 1e-4}
"""Step of a signal's raw value, by how its column begins."""

WRITERS = {
    ".blf": can.BLFWriter,
    ".asc": can.ASCWriter,
    ".log": can.CanutilsLogWriter,
    ".trc": can.TRCWriter,
    ".mf4": can.MF4Writer,
}


def frames_of(frame, start_s=1.7e9, channel=1, drop=()) -> list[can.Message]:
    """The drive's frames in the order of their times; Page alternates between its branches."""
    database = cantools.database.load_string(DBC, "dbc")
    made = []
    for i, row in enumerate(frame.to_dict("records")):
        messages = {
            "Wheels": {f"wheel_speed_{w}_rad_s": row[f"wheel_speed_{w}_rad_s"] for w in W},
            "Torque": {f"Trq_{w}": row[f"wheel_torque_{w}_nm"] for w in W},
            "Motion": {
                "Speed": row["vehicle_speed_m_s"],
                "Ax": row["accel_x_m_s2"],
                "Position": row["position_m"],
            },
            "Page": {"Which": i % 2, ("Yaw" if i % 2 else "Steer"): 0.001 * (i % 100)},
        }
        for name, values in messages.items():
            if name not in drop:
                message = database.get_message_by_name(name)
                made.append(
                    can.Message(
                        timestamp=start_s + row["time_s"],
                        arbitration_id=message.frame_id,
                        is_extended_id=message.is_extended_frame,
                        is_fd=message.length > 8,
                        data=message.encode(values),
                        channel=channel,
                    )
                )
    return made


def write(path: Path, messages: list[can.Message], from_0: bool = False) -> Path:
    """The frames as a log of the format that the path's suffix names; an MDF may count their times from 0."""
    with WRITERS[path.suffix](str(path)) as writer:
        if from_0 and path.suffix == ".mf4":
            writer.last_timestamp = writer._start_time = 0.0
        for message in messages:
            if path.suffix == ".trc" and message.is_fd:
                _write_fd(writer, message)
            else:
                writer.on_message_received(message)
    return path


def _write_fd(writer: can.TRCWriter, message: can.Message) -> None:
    """A frame of CAN FD, which python-can's writer of TRC 2.1 leaves out."""
    offset_ms = 1e3 * (message.timestamp - writer.first_timestamp)
    number, dlc = f"{message.arbitration_id:04X}", can.util.len2dlc(len(message.data))
    line = f"1 {offset_ms:.3f} FD {message.channel} {number} Rx - {dlc} {message.data.hex(' ')}"
    writer.log_event(line, message.timestamp)


def described(folder: Path, text: str = DBC) -> Path:
    """The DBC file in a folder."""
    (folder / "car.dbc").write_text(text)
    return folder / "car.dbc"
