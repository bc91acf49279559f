"""What was measured on fmpy 0.3.32 and pythonfmu 0.7.0: each finding reproduced, and its cure on the unit."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import sysconfig
import textwrap
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy import read_model_description, simulate_fmu
from fmpy.validation import validate_fmu
from fmu_unit import DRIVING, Unit
from pythonfmu import FmuBuilder

from fmu_src.packaging import build_unit
from fmu_src.units import UNITS
from scenarios.fmu_client.unpacking import unpack_unit

pytestmark = pytest.mark.e2e

SUPPORT = Path(__file__).parents[1] / "support"

PLAIN_SLAVE = """
from pythonfmu import Fmi2Causality, Fmi2Slave, Integer, Real

class Plain(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.x = 0.0
        self.y = 0.0
        self.hidden = 0.0
        self.register_variable(Real("x", causality=Fmi2Causality.input))
        self.register_variable(Real("y", causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        BODY
        return True
"""


def plain_unit(folder: Path, body: str, **options: bool) -> Path:
    """A unit as pythonfmu builds it, all of the same script name."""
    folder.mkdir()
    script = folder / "plain.py"
    script.write_text(textwrap.dedent(PLAIN_SLAVE).replace("BODY", body))
    for name in [name for name in sys.modules if name == "plain"]:
        del sys.modules[name]
    before = list(sys.path)
    built = FmuBuilder.build_FMU(script, dest=folder, **options)
    sys.path[:] = before
    sys.modules.pop("plain", None)
    return unpack_unit(built, folder / "unpacked")


def in_new_process(code: str, *arguments: object) -> subprocess.CompletedProcess[str]:
    """Run code that may crash, with the tests' helpers importable; the process ends as any other does."""
    header = f"import sys; sys.path.insert(0, {str(SUPPORT)!r})\n"
    command = [sys.executable, "-c", header + textwrap.dedent(code), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)


@pytest.fixture
def clean_path() -> Iterator[None]:
    """Put sys.path back after a unit that grows it."""
    before = list(sys.path)
    yield
    sys.path[:] = before


# 1. Model description


def test_1_finding_pythonfmus_own_description_does_not_validate(tmp_path: Path) -> None:
    assert validate_fmu(str(plain_unit(tmp_path / "a", "self.y = self.x").parent / "Plain.fmu"))


def test_1_cure_the_units_description_validates(unit_file: Path) -> None:
    assert validate_fmu(str(unit_file)) == []


# 2. Two units in one process


def test_2_finding_units_of_one_script_name_run_the_first_ones_code(tmp_path: Path, clean_path: None) -> None:
    folders = [plain_unit(tmp_path / "a", "self.y = 1.0"), plain_unit(tmp_path / "b", "self.y = 2.0")]
    first, second = (Unit(folder) for folder in folders)
    for unit in (first, second):
        unit.initialise()
        unit.step()
    assert (first.get("y"), second.get("y")) == (1.0, 1.0)
    first.free()
    second.free()


def test_2_cure_two_builds_of_the_unit_run_their_own_code(unit_folder: Path, tmp_path: Path) -> None:
    slave = UNITS["TrpacEstimator"]
    other = replace(slave, info=replace(slave.info, description="another build"))
    folder = unpack_unit(build_unit(other, tmp_path / "TrpacEstimator.fmu"), tmp_path / "unpacked")
    script = next((folder / "resources").glob("fmu_src_*/trpac_estimator.py"))
    doubled = "lambda self, vrs: [2.0 * value for value in CameraSlave.get_real(self, vrs)]"
    script.write_text(f"{script.read_text()}\nTrpacEstimator.get_real = {doubled}\n")
    units = [Unit(unit_folder), Unit(folder)]
    for unit in units:
        unit.initialise()
        unit.step(DRIVING)
    ours, theirs = (unit.get("TRPAC") for unit in units)
    assert theirs == 2.0 * ours
    for unit in units:
        unit.free()


# 3. Module body and sys.path


def test_3_finding_each_instance_grows_the_path_and_runs_the_body_again(
    tmp_path: Path, clean_path: None
) -> None:
    folder = plain_unit(tmp_path / "a", "self.y = 1.0")
    script = folder / "resources" / "plain.py"
    script.write_text("import sys\nsys.plain_runs = getattr(sys, 'plain_runs', 0) + 1\n" + script.read_text())
    before = len(sys.path)
    Unit(folder).free()
    assert sys.plain_runs == 2  # type: ignore[attr-defined]
    Unit(folder).free()
    assert len(sys.path) == before + 2


def test_3_cure_the_path_stays_and_networks_load_once(open_unit: Callable[..., Unit]) -> None:
    open_unit()
    before = list(sys.path)
    unit = open_unit()
    slave = sys.modules[f"fmu_src_{unit.description.guid}.trpac_estimator"].TrpacEstimator
    networks = slave._networks
    for _ in range(3):
        open_unit()
    assert sys.path == before
    assert slave._networks is networks


def test_many_instances_one_after_the_other(unit_folder: Path) -> None:
    # The wrapper drops a reference too many to the script's namespace at each instantiation.
    for _ in range(100):
        unit = Unit(unit_folder)
        unit.initialise()
        unit.free()


# 4. Per cent signs in log texts


def test_4_finding_a_per_cent_sign_in_a_log_text_crashes_the_host(tmp_path: Path) -> None:
    folder = plain_unit(tmp_path / "a", "self.log('%s' * 40)")
    done = in_new_process(
        """
        from pathlib import Path
        from fmu_unit import Unit
        unit = Unit(Path(sys.argv[1])); unit.initialise(); unit.step()
        """,
        folder,
    )
    assert done.returncode < 0


def test_4_cure_a_per_cent_sign_arrives_as_it_was_written(
    open_unit: Callable[..., Unit], tmp_path: Path
) -> None:
    path = str(tmp_path / "%s%n%d 100 %.png")
    unit = open_unit()
    unit.step({**DRIVING, "image_path": path})
    assert [path in line.text for line in unit.log] == [True]


# 5. Exceptions in callbacks


@pytest.mark.parametrize(
    ("callback", "act"),
    [
        ("set_real", lambda unit: unit.set({"wheel_speed": 1.0})),
        ("get_real", lambda unit: unit.get("TRPAC")),
        ("set_string", lambda unit: unit.set({"image_path": "x"})),
        ("get_boolean", lambda unit: unit.get("flag")),
        ("terminate", lambda unit: unit.slave.terminate()),
        ("_get_fmu_state", lambda unit: unit.slave.getFMUstate()),
    ],
)
def test_5_cure_a_fault_within_a_callback_is_logged_and_the_unit_goes_on(
    open_unit: Callable[..., Unit],
    monkeypatch: pytest.MonkeyPatch,
    callback: str,
    act: Callable[[Unit], object],
) -> None:
    unit = open_unit()
    base = sys.modules[f"fmu_src_{unit.description.guid}.guarded_slave"]
    slave = sys.modules[f"fmu_src_{unit.description.guid}.trpac_estimator"].TrpacEstimator
    monkeypatch.setattr(
        slave, callback, base.guarded(_fallbacks()[callback])(_broken(callback)), raising=True
    )
    act(unit)
    act(unit)
    monkeypatch.undo()
    unit.step(DRIVING)
    assert [("broken on purpose 100%" in line.text, line.status) for line in unit.log] == [(True, 3)]
    assert np.isfinite(unit.get("TRPAC"))


def _fallbacks() -> dict[str, Callable[..., object]]:
    return {
        "set_real": lambda *_: None,
        "set_string": lambda *_: None,
        "terminate": lambda *_: None,
        "get_real": lambda vrs: [0.0] * len(vrs),
        "get_boolean": lambda vrs: [False] * len(vrs),
        "_get_fmu_state": lambda *_: b"",
    }


def _broken(name: str) -> Callable[..., object]:
    def callback(*_: object) -> object:
        raise RuntimeError("broken on purpose 100%")

    callback.__name__ = name
    return callback


def test_5_cure_a_fault_within_a_step_discards_it_and_the_next_one_works(
    open_unit: Callable[..., Unit], monkeypatch: pytest.MonkeyPatch
) -> None:
    unit = open_unit()
    slave = sys.modules[f"fmu_src_{unit.description.guid}.trpac_estimator"].TrpacEstimator
    monkeypatch.setattr(slave, "step", _broken("step"))
    with pytest.raises(Exception, match=r"fmi2DoStep.*status 2"):
        unit.step(DRIVING)
    monkeypatch.undo()
    unit.step()
    assert "broken on purpose 100%" in unit.log[0].text


def test_5_every_callback_that_the_wrapper_calls_is_guarded() -> None:
    from fmu_src.guarded_slave import GuardedSlave

    called = (
        *(f"{verb}_{kind}" for verb in ("get", "set") for kind in ("real", "integer", "boolean", "string")),
        *(
            "setup_experiment",
            "enter_initialization_mode",
            "exit_initialization_mode",
            "do_step",
            "terminate",
        ),
        *("_get_fmu_state", "_set_fmu_state"),
    )
    unguarded = [name for name in called if not hasattr(getattr(GuardedSlave, name), "__wrapped__")]
    # It is pythonfmu's own and has an empty body.
    assert unguarded == ["setup_experiment"]


def test_ctrl_c_within_a_step_reaches_the_host_and_the_unit_survives(unit_folder: Path) -> None:
    done = in_new_process(
        """
        import signal, threading, time
        from pathlib import Path
        from fmu_unit import DRIVING, Unit
        signal.signal(signal.SIGINT, signal.default_int_handler)  # background jobs begin with it ignored
        unit = Unit(Path(sys.argv[1])); unit.initialise()
        module = sys.modules[f"fmu_src_{unit.description.guid}.trpac_estimator"]
        def interrupted(self, step_s):
            signal.raise_signal(signal.SIGINT)
        step = module.TrpacEstimator.step
        module.TrpacEstimator.step = interrupted
        try:
            try:
                unit.step(DRIVING)
            except Exception as error:
                print("step:", error)
            for _ in range(300):
                time.sleep(0.01)
        except KeyboardInterrupt:
            module.TrpacEstimator.step = step
            unit.step(DRIVING)
            unit.free()
            print("interrupted and alive")
        """,
        unit_folder,
    )
    assert done.stdout.splitlines()[-1] == "interrupted and alive"
    assert done.returncode == 0, done.stderr


# 6. Characters in the unpack path


@pytest.mark.parametrize("name", ["Prüfstand", "a#b", "a+b", "a%b"])
def test_6_finding_some_characters_in_the_path_crash_the_host(
    unit_file: Path, tmp_path: Path, name: str
) -> None:
    with zipfile.ZipFile(unit_file) as archive:
        archive.extractall(tmp_path / name)
    done = in_new_process(
        """
        from pathlib import Path
        from fmu_unit import Unit
        Unit(Path(sys.argv[1]))
        """,
        tmp_path / name,
    )
    assert done.returncode < 0


# 7. A host that is not Python


@pytest.fixture(scope="module")
def c_host(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The host in tests/support/c_host.c, compiled."""
    compiler = shutil.which("cc")
    if compiler is None or not sys.platform.startswith("linux"):
        pytest.skip("needs a C compiler on Linux")
    program = tmp_path_factory.mktemp("c_host") / "c_host"
    headers = Path(fmpy.__file__).parent / "c-code"
    source = SUPPORT / "c_host.c"
    subprocess.run([compiler, "-O1", "-I", headers, "-o", program, source, "-ldl"], check=True)
    return program


def run_in_c(
    program: Path, folder: Path, picture: str, **environment: str
) -> subprocess.CompletedProcess[str]:
    """Run the C host on the unpacked unit."""
    description = read_model_description(str(folder))
    references = {v.name: str(v.valueReference) for v in description.modelVariables}
    names = (*DRIVING, "image_path", "road_class", "TRPAC")
    library = folder / "binaries" / "linux64" / "TrpacEstimator.so"
    resources = (folder / "resources").as_uri()
    arguments = [library, description.guid, resources, picture, *(references[name] for name in names)]
    variables = {"PATH": os.environ["PATH"], **environment}
    return subprocess.run(
        [program, *arguments], capture_output=True, text=True, check=False, timeout=60, env=variables
    )


def shared_libpython() -> str:
    """The interpreter as a shared library."""
    path = Path(str(sysconfig.get_config_var("LIBDIR"))) / str(sysconfig.get_config_var("INSTSONAME"))
    if not path.is_file() or ".so" not in path.name:
        pytest.skip(f"this Python has no shared library ({path})")
    return str(path)


def test_7_finding_a_host_without_python_misses_its_symbols(c_host: Path, unit_folder: Path) -> None:
    done = run_in_c(c_host, unit_folder, "")
    assert done.returncode == 3
    assert "undefined symbol" in done.stderr


def test_7_cure_with_libpython_preloaded_a_c_host_gets_the_same_result(
    c_host: Path, unit_folder: Path, open_unit: Callable[..., Unit]
) -> None:
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    done = run_in_c(c_host, unit_folder, "100 %s %n.png", LD_PRELOAD=shared_libpython(), PATH=path)
    unit = open_unit()
    unit.step({**DRIVING, "image_path": "100 %s %n.png"}, count=500)
    assert done.returncode == 0, done.stderr
    log, result = done.stdout.splitlines()
    assert log == f"log c_host 1: {unit.log[0].text}"
    assert result == f"TRPAC {unit.get('TRPAC'):.17g} status 0"


# 8. State


def test_8_finding_the_default_state_loses_what_is_no_variable(tmp_path: Path, clean_path: None) -> None:
    options = {"canGetAndSetFMUstate": True, "canSerializeFMUstate": True}
    unit = Unit(plain_unit(tmp_path / "a", "self.hidden += 1.0; self.y = self.hidden", **options))
    unit.initialise()
    unit.step()
    state = unit.slave.getFMUstate()
    unit.step(count=2)
    unit.slave.setFMUstate(state)
    unit.step()
    assert unit.get("y") == 4.0
    unit.free()


# 9. Strings


def test_9_string_input_works_beside_simulated_real_signals(unit_file: Path, tmp_path: Path) -> None:
    signals = np.array(
        [(0.0, 52.0, 150.0, 15.0), (0.05, 52.0, 150.0, 15.0)],
        dtype=[(name, float) for name in ("time", "wheel_speed", "wheel_torque", "vehicle_speed")],
    )
    result = simulate_fmu(
        str(unpack_unit(unit_file, tmp_path / "unpacked")),
        stop_time=0.05,
        step_size=0.001,
        output_interval=0.01,
        start_values={"image_path": ""},
        input=signals,
        output=["TRPAC", "slip", "flag"],
    )
    assert len(result) == 6
    assert result["slip"][-1] == pytest.approx(1.0 - 15.0 / (52.0 * 0.29))


def test_9_no_output_is_a_string_since_fmpy_drops_those(unit_folder: Path) -> None:
    unit = Unit(unit_folder)
    assert "String" not in {v.type for v in unit.variables.values() if v.causality == "output"}
    unit.free()


def test_packages_missing_in_the_host_leave_one_clear_message(unit_folder: Path) -> None:
    done = in_new_process(
        """
        from pathlib import Path
        from fmu_unit import Unit
        sys.modules["onnxruntime"] = None
        try:
            Unit(Path(sys.argv[1]))
        except Exception as error:
            print(error)
        """,
        unit_folder,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip().endswith("Failed to instantiate model")
    assert f"{sys.executable} -m pip install onnxruntime" in done.stderr


def test_damaged_network_file_leaves_one_clear_message(unit_file: Path, tmp_path: Path) -> None:
    folder = unpack_unit(unit_file, tmp_path / "unpacked")
    (folder / "resources" / "surface.onnx").write_bytes(b"not a network")
    done = in_new_process(
        """
        from pathlib import Path
        from fmu_unit import Unit
        try:
            Unit(Path(sys.argv[1]))
        except Exception as error:
            print(error)
        """,
        folder,
    )
    assert done.returncode == 0, done.stderr
    assert "surface.onnx" in done.stderr
    assert done.stdout.strip().endswith("Failed to instantiate model")


# 10. The end of the process


@pytest.fixture(scope="module")
def reuse(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The library in tests/support/c_reuse.c, compiled."""
    compiler = shutil.which("cc")
    if compiler is None or not sys.platform.startswith("linux"):
        pytest.skip("needs a C compiler on Linux")
    library = tmp_path_factory.mktemp("reuse") / "reuse.so"
    source = SUPPORT / "c_reuse.c"
    subprocess.run([compiler, "-shared", "-fPIC", "-o", library, source], check=True)
    return library


def end_of_a_process(reuse: Path, *folders: Path, free: bool = True) -> subprocess.CompletedProcess[str]:
    """Instantiate, step and maybe free each of the units; what is freed while the process ends is used again."""
    return in_new_process(
        f"""
        import ctypes
        from pathlib import Path
        from fmu_unit import Unit
        ctypes.CDLL(sys.argv[1]).watch()
        for folder in sys.argv[2:]:
            try:
                unit = Unit(Path(folder))
            except Exception as error:
                print(error)
                continue
            unit.initialise()
            unit.step()
            if {free}:
                unit.free()
        print("ran")
        """,
        reuse,
        *folders,
    )


def test_10_finding_the_wrapper_counts_in_freed_memory_when_the_process_ends(
    reuse: Path, unit_file: Path, tmp_path: Path
) -> None:
    folder = unpack_unit(unit_file, tmp_path / "unpacked")
    (host,) = (folder / "resources").glob("fmu_src_*/host.py")
    host.write_text(f"{host.read_text()}\ndef end_in_order(resources): pass\n")
    done = end_of_a_process(reuse, folder)
    assert (done.returncode, done.stdout.strip()) == (-signal.SIGSEGV, "ran"), done.stderr


@pytest.mark.parametrize("free", [True, False])
def test_10_cure_the_process_ends_in_order(
    reuse: Path, unit_folder: Path, unit_folder_4w: Path, free: bool
) -> None:
    done = end_of_a_process(reuse, unit_folder, unit_folder_4w, unit_folder, free=free)
    assert (done.returncode, done.stdout.strip()) == (0, "ran"), done.stderr


def test_10_cure_holds_after_an_instantiation_that_failed(
    reuse: Path, unit_file: Path, tmp_path: Path
) -> None:
    folder = unpack_unit(unit_file, tmp_path / "unpacked")
    (folder / "resources" / "surface.onnx").write_bytes(b"not a network")
    done = end_of_a_process(reuse, folder)
    assert "Failed to instantiate model" in done.stdout
    assert done.returncode == 0, done.stderr


def test_10_cure_holds_in_a_host_without_python(c_host: Path, unit_folder: Path) -> None:
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    # Freed memory goes straight to the heap's lists, where a count in it that is lowered may be found out.
    environment = {"LD_PRELOAD": shared_libpython(), "GLIBC_TUNABLES": "glibc.malloc.tcache_count=0"}
    done = run_in_c(c_host, unit_folder, "", PATH=path, **environment)
    assert done.returncode == 0, done.stderr
