"""ONNX Runtime as a guest in a host's process: without the usage reports that it sends since version 1.29.

On Linux and macOS it decides when it is first imported, by `ORT_DISABLE_TELEMETRY`, whether to keep a device id and a
data base in the user's cache folder and to send events; a value that the host has set stands. On Windows events go
through the system's tracing and are switched off after the import.
"""

import os

os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")

import onnxruntime as ort
from onnxruntime.capi import onnxruntime_pybind11_state as ort_errors

ort.disable_telemetry_events()

__all__ = ["ort", "ort_errors"]
