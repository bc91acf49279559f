"""One run of a unit in a process of its own: `python -m sim2real.own_model.worker FOLDER`.

FOLDER holds job.json and inputs.npy; outputs.npy, or error.json with text and time, is written there. A unit that
crashes or hangs takes this process with it, and no other.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def main(folder: Path) -> None:
    """Run the stretches of a folder's job, each from its own beginning, and write all outputs behind each other."""
    job = json.loads((folder / "job.json").read_text(encoding="utf-8"))
    values, rows, outputs = np.load(folder / "inputs.npy"), 0, []
    for stretch in job["stretches"]:
        reached = [0.0]
        try:
            part = values[rows : rows + stretch["rows"]]
            outputs.append(_run(job, stretch["start"], part, reached))
        except Exception as error:  # fmpy raises bare Exceptions, too
            text = " ".join(str(error).split()) or type(error).__name__
            told = {"text": text, "row": rows + round(reached[0] / job["step_s"])}
            (folder / "error.json").write_text(json.dumps(told), encoding="utf-8")
            raise SystemExit(1) from error
        rows += stretch["rows"]
    np.save(folder / "outputs.npy", np.concatenate(outputs))


def _run(job: dict[str, Any], start: dict[str, Any], inputs: Array, reached: list[float]) -> Array:
    """Outputs on the rows of the inputs, NaN from where the unit stops by itself; `reached` is the time so far [s]."""
    from fmpy import simulate_fmu

    table = np.zeros(len(inputs), dtype=[(name, np.float64) for name in ("time", *job["inputs"])])
    table["time"] = job["step_s"] * np.arange(len(inputs))
    for i, name in enumerate(job["inputs"]):
        table[name] = inputs[:, i]

    def stepped(time_s: float, _: object) -> bool:
        reached[0] = time_s
        return True

    found = simulate_fmu(
        job["unit"],
        validate=False,
        start_time=0.0,
        stop_time=float(table["time"][-1]),
        output_interval=job["step_s"],
        fmi_type="CoSimulation",
        start_values=dict(start),
        input=table,
        output=job["outputs"],
        step_finished=stepped,
    )
    out = np.full((len(inputs), len(job["outputs"])), np.nan)
    count = min(len(found), len(out))
    out[:count] = np.column_stack([found[name] for name in job["outputs"]])[:count]
    return out


if __name__ == "__main__":
    main(Path(sys.argv[1]))
    sys.stdout.flush()
    os._exit(0)  # libraries of units may crash a process that ends in order
