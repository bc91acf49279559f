"""What the unit draws into its host: numpy, onnxruntime and OpenCV, and what those need themselves."""

import json
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

ALLOWED = ("numpy", "onnxruntime", "cv2")

PROBE = """
import importlib, json, sys
{before}
known = set(sys.modules)
sys.path.insert(0, {resources!r})
{action}
print(json.dumps(sorted({{name.split(".")[0] for name in set(sys.modules) - known}})))
"""

STEP = """
entry = importlib.import_module({entry!r})
slave = entry.TrpacEstimator(instance_name="a", guid="", resources={resources!r}, visible=False)
slave.exit_initialization_mode()
references = {{v.name: i for i, v in enumerate(slave.variables)}}
slave.set_string([references["image_path"]], [{picture!r}])
slave.set_real([references[n] for n in ("wheel_speed", "vehicle_speed")], [35.0, 10.0])
assert slave.do_step(0.0, 0.001)
"""


def loaded(before: str, action: str, resources: Path) -> set[str]:
    """Top-level modules that an action loads in a bare interpreter."""
    code = PROBE.format(before=before, action=action, resources=str(resources))
    done = subprocess.run([sys.executable, "-I", "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return set(json.loads(done.stdout.splitlines()[-1]))


@pytest.mark.e2e
def test_the_unit_imports_nothing_beyond_its_three_packages(unit_folder: Path, tmp_path: Path) -> None:
    picture = tmp_path / "frame.png"
    noise = np.random.default_rng(1).integers(0, 255, (300, 480, 3), dtype=np.uint8)
    cv2.imwrite(str(picture), noise)
    resources = unit_folder / "resources"
    entry = (resources / "slavemodule.txt").read_text()
    step = STEP.format(entry=entry, resources=str(resources), picture=str(picture))
    packages = loaded("", f"import numpy.random, {', '.join(ALLOWED)}", resources)
    with_unit = loaded("", step, resources)
    carried = {name for name in with_unit if (resources / name).exists() or name == entry}
    beyond = with_unit - packages - carried - set(sys.stdlib_module_names)
    assert set(ALLOWED) <= with_unit
    assert beyond == set()
