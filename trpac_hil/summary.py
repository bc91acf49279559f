"""summary.json: counts and measurements of a run."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.metadata import version
from typing import Any

import numpy as np

from trpac_core.files import file_sha256
from trpac_hil.bus import Link
from trpac_hil.camera_input import CameraInput
from trpac_hil.codec import Codec
from trpac_hil.events import Events
from trpac_hil.inputs import Inputs
from trpac_hil.loop import Counts
from trpac_hil.readiness import sent
from trpac_hil.settings import HilSettings
from trpac_hil.unit import Unit

PACKAGES = ("trpac-fmu", "fmpy", "python-can", "cantools", "asammdf", "numpy", "onnxruntime")


def summarise(
    settings: HilSettings,
    unit: Unit,
    counts: Counts,
    events: Events,
    codec: Codec,
    inputs: Inputs,
    link: Link,
    camera_input: CameraInput,
    messages: Mapping[str, Any],
    system: Mapping[str, Any],
    ended: str,
) -> dict[str, Any]:
    """The content of summary.json; docs/guide/bus.md has its fields."""
    done = messages.get("done")
    return {
        "unit": unit.name,
        "unit_sha256": file_sha256(unit.archive),
        "wheel": settings.wheel if len(unit.wiring.wheels) == 1 else "all",
        "rate_hz": settings.rate_hz,
        "ended": ended,
        "cycles": counts.cycles,
        "overruns": {
            "count": counts.overruns,
            "ended_late": counts.late_ends,
            "left_out": counts.left_out,
            "beyond_5_ms": counts.long_overruns,
            "beyond_5_ms_by": counts.long_causes,
            "overworked": counts.overworked,
            "worst_ms": round(counts.worst_ns * 1e-6, 4),
        },
        "timing": done["figures"] if done else None,
        "held_cycles": counts.held,
        "starting_cycles": counts.starting,
        "discarded_steps": counts.discarded,
        "clock_jumps": counts.clock_jumps,
        "signals_lost": counts.lost | ({"camera": camera_input.losses} if camera_input.losses else {}),
        "bus": _bus(settings, unit, codec, inputs, link),
        "camera": _camera(settings, camera_input),
        "events": events.summary(),
        "system": dict(system),
        "versions": {package: version(package) for package in PACKAGES},
    }


def _bus(settings: HilSettings, unit: Unit, codec: Codec, inputs: Inputs, link: Link) -> dict[str, Any]:
    return {
        "interface": settings.bus.interface,
        "channel": settings.bus.channel,
        "dbc": settings.dbc.name,
        "mapping": settings.signals.name if settings.signals else None,
        "signals": {name: role.text for name, role in codec.roles.items()},
        "required": sorted(
            {
                s.message
                for s in codec.supplies_of(codec.roles[role] for role in unit.wiring.required.values())
            }
        ),
        "sent": list(sent(codec, unit.wiring)),
        "losses": link.losses,
        "unsent": link.unsent,
        "error_frames": link.error_frames,
        "garbled": link.garbled,
        "backlogs": link.backlogs,
        "messages": {
            name: {
                "received": h.received,
                "lost": h.lost,
                "frozen": h.frozen,
                "broken": h.broken,
                "two_senders": h.senders.noticed,
                "out_of_range": h.outside,
            }
            for name, h in inputs.heard.items()
        },
    }


def _camera(settings: HilSettings, camera_input: CameraInput) -> dict[str, Any]:
    counts, work_ms = camera_input.stamps.counts, camera_input.work_ms
    source = "bus" if settings.frames is None else f"pictures at {settings.fps:g} 1/s"
    return {
        "source": source,
        "results": counts.results,
        "failed": counts.failed,
        "late": counts.late,
        "in_vain": counts.in_vain,
        "unplaced": counts.unplaced,
        "left_out": camera_input.left_out,
        "work_ms": {
            "median": round(float(np.median(work_ms)), 2),
            "p99": round(float(np.percentile(work_ms, 99.0)), 2),
            "max": round(max(work_ms), 2),
        }
        if work_ms
        else None,
    }
