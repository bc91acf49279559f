"""How fast estimator, four wheels and plant are: one command, one line of JSON in benchmarks/history/speed.jsonl.

`make bench` on a machine that does nothing else. Figures compare within a line: each holds its own reference loop.
"""

from __future__ import annotations

import json
import os
import platform
import subprocess
from datetime import UTC, datetime
from pathlib import Path

from benchmarks import bench_estimator, bench_four_wheels, bench_plant

HISTORY = Path(__file__).parent / "history" / "speed.jsonl"


def main() -> None:
    asked = subprocess.run(["git", "rev-parse", "HEAD"], capture_output=True, text=True, check=False)
    line = {
        "written": datetime.now(UTC).isoformat(timespec="seconds"),
        "commit": asked.stdout.strip() or None,
        "machine": {
            "cpus": os.cpu_count(),
            "processor": platform.machine(),
            "load_1min": os.getloadavg()[0],
            "python": platform.python_version(),
        },
        "one_wheel": bench_estimator.measure(),
        "four_wheels": bench_four_wheels.measure(),
        "plant": bench_plant.measure_all(),
    }
    HISTORY.parent.mkdir(exist_ok=True)
    with HISTORY.open("a", encoding="utf-8") as history:
        history.write(json.dumps(line) + "\n")
    print(json.dumps(line, indent=2))


if __name__ == "__main__":
    main()
