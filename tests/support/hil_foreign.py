"""A car whose bus was described by others: other names, units and byte orders than the shipped DBC file's."""

from __future__ import annotations

from pathlib import Path

DBC = """VERSION ""

NS_ :

BS_:

BU_: Gateway ABS Tool

BO_ 1001 Motion: 8 Gateway
 SG_ VehSpd : 7|16@0+ (0.01,0) [0|300] "km/h" Tool
 SG_ LongAcc : 23|16@0- (0.001,0) [-4|4] "g" Tool
 SG_ YawRate : 39|16@0- (0.01,0) [-300|300] "deg/s" Tool
 SG_ AliveCnt : 51|4@0+ (1,0) [0|14] "" Tool

BO_ 2566844672 ABS_Wheels: 8 ABS
 SG_ Page M : 0|2@1+ (1,0) [0|3] "" Tool
 SG_ ABS_Cnt : 4|4@1+ (1,0) [0|15] "" Tool
 SG_ WhlSpdFL m0 : 8|16@1+ (0.05,0) [0|3000] "rpm" Tool
 SG_ WhlSpdFR m0 : 24|16@1+ (0.05,0) [0|3000] "rpm" Tool
 SG_ WhlSpdRL m1 : 8|16@1+ (0.01,0) [0|300] "km/h" Tool
 SG_ WhlSpdRR m1 : 24|16@1+ (0.01,0) [0|300] "km/h" Tool
 SG_ Lap_Counter : 40|8@1+ (1,0) [0|255] "" Tool

BO_ 700 Drive: 8 Gateway
 SG_ MotFL : 0|16@1- (1,0) [0|3000] "Nm" Tool
 SG_ MotFR : 16|16@1- (1,0) [0|3000] "Nm" Tool
 SG_ MotR : 32|16@1- (1,0) [0|6000] "Nm" Tool

BO_ 701 Brakes: 8 ABS
 SG_ BrkFL : 0|16@1+ (0.001,0) [0|65] "kNm" Tool
 SG_ BrkFR : 16|16@1+ (0.001,0) [0|65] "kNm" Tool
 SG_ BrkRL : 32|16@1+ (0.001,0) [0|65] "kNm" Tool
 SG_ BrkRR : 48|16@1+ (0.001,0) [0|65] "kNm" Tool

BO_ 900 Health: 2 Gateway
 SG_ Coolant : 0|8@1+ (1,-40) [0|0] "degC" Tool

BA_DEF_ BO_ "GenMsgCycleTime" INT 0 60000;
BA_DEF_DEF_ "GenMsgCycleTime" 0;
BA_ "GenMsgCycleTime" BO_ 1001 10;
BA_ "GenMsgCycleTime" BO_ 2566844672 5;
BA_ "GenMsgCycleTime" BO_ 700 5;
VAL_ 1001 VehSpd 65535 "SNA" 65534 "Init" ;
VAL_ 1001 YawRate 32767 "Signal not available" ;
"""
SIGNALS = """schema: 1
columns:
  vehicle_speed_m_s: Motion.VehSpd
  accel_x_m_s2: {column: Motion.LongAcc}
  yaw_rate_rad_s: {column: Motion.YawRate, sign: -1}
  wheel_speed_fl_rad_s: {column: ABS_Wheels.WhlSpdFL}
  wheel_speed_fr_rad_s: {column: ABS_Wheels.WhlSpdFR, unit: rpm}
  wheel_speed_rl_rad_s: {column: ABS_Wheels.WhlSpdRL, radius_m: 0.29}
  wheel_speed_rr_rad_s: {column: ABS_Wheels.WhlSpdRR, radius_m: 0.29}
  wheel_torque_fl_nm: {sum: [{column: Drive.MotFL}, {column: Brakes.BrkFL, sign: -1}]}
  wheel_torque_fr_nm: {sum: [{column: Drive.MotFR}, {column: Brakes.BrkFR, sign: -1}]}
  wheel_torque_rl_nm: {sum: [{column: Drive.MotR, scale: 0.5}, {column: Brakes.BrkRL, sign: -1}]}
  wheel_torque_rr_nm: {sum: [{column: Drive.MotR, scale: 0.5}, {column: Brakes.BrkRR, sign: -1}]}
  steering_angle_rad: {constant: 0.0}
  position_m: {integrate: {copy: vehicle_speed_m_s}}
counters: {Motion: AliveCnt, ABS_Wheels: ABS_Cnt}
"""


def foreign_car(folder: Path, dbc: str = DBC, signals: str = SIGNALS) -> tuple[Path, Path]:
    """The car's DBC file and its file of signals, written into a folder."""
    files = folder / "car.dbc", folder / "signals.yaml"
    for file, text in zip(files, (dbc, signals), strict=True):
        file.write_text(text, encoding="utf-8")
    return files
