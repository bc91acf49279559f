"""Hardware in the loop: the estimator's unit in wall-clock time on a CAN bus.

======================  ==================================================================================
trpac.dbc, message.py   the shipped messages; a message's bytes as values by signal name
roles.py, codec.py      the quantities of the rig as sums of signals, of the shipped or of any DBC file
bus.py                  a CAN bus of any python-can interface, reopened after it is lost
inputs.py               the newest value of each quantity, and its age
readiness.py            what comes by the bus before the first cycle
preview_stamps.py       results of the camera, stamped on the road
camera_input.py         which of them is for the road under the wheel now
unit.py                 the unit through fmpy
deadlines.py            when each cycle is due
loop.py                 the cycle: bus, unit, bus
camera.py               pictures, in a process of their own
recorder.py, mdf.py     log, quantiles and terminal, in a process of their own
bus_file.py             the recording of the bus
figures.py, screen.py   quantiles of timing and ages, and how the terminal shows them
summary.py, verdict.py  counts of a run, and the same in words
shared.py               memory that these processes share
bus_relay.py            a bus of the loop's process, reached from another process
driver.py, plant_node.py the reference plant as the car on the bus
settings.py             the settings of a run
rig.py                  puts unit, bus and processes together
======================  ==================================================================================
"""
