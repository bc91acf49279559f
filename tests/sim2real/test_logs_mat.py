"""Reading MAT-files: variables, structs, Simulink's structure with time, MATLAB's objects, and damaged files."""

import struct

import h5py
import numpy as np
import pytest
from log_maker import make_frame
from scipy.io import savemat

from sim2real.logs import LogError, load_mapping, read_log
from sim2real.logs.formats import extraction

NAMES = list(make_frame().columns)


@pytest.fixture
def frame():
    return make_frame()


def assert_same(log, frame):
    assert np.array_equal(log.time_s, frame["time_s"])
    for name in frame.columns.drop("time_s"):
        assert np.array_equal(log.signals[name], frame[name]), name


def columns(frame, form="column"):
    return {name: frame[name].to_numpy().reshape((-1, 1) if form == "column" else (1, -1)) for name in frame}


def save73(path, tree, plain=False):
    """A file of version 7.3 as MATLAB writes it: HDF5 behind 512 bytes, arrays transposed, classes as attributes."""
    with h5py.File(path, "w", userblock_size=0 if plain else 512) as root:
        refs = root.create_group("#refs#")

        def put(group, name, value):
            if isinstance(value, dict):
                made = group.create_group(name)
                made.attrs["MATLAB_class"] = np.bytes_("struct")
                for field, item in value.items():
                    put(made, field, item)
            elif isinstance(value, list) and value and isinstance(value[0], dict):
                made = group.create_group(name)
                made.attrs["MATLAB_class"] = np.bytes_("struct")
                for field in value[0]:
                    made[field] = np.array([[refer(item[field])] for item in value], dtype=h5py.ref_dtype)
            elif isinstance(value, list):
                group[name] = np.array([[refer(item) for item in value]], dtype=h5py.ref_dtype)
                group[name].attrs["MATLAB_class"] = np.bytes_("cell")
            elif isinstance(value, str):
                group[name] = np.array([[ord(c)] for c in value], dtype=np.uint16)
                group[name].attrs["MATLAB_class"] = np.bytes_("char")
            else:
                group.create_dataset(name, data=np.atleast_2d(value).T, compression="gzip")
                if not plain:
                    group[name].attrs["MATLAB_class"] = np.bytes_("double")

        def refer(value):
            put(refs, f"r{len(refs)}", value)
            return refs[f"r{len(refs) - 1}"].ref

        for name, value in tree.items():
            put(root, name, value)
    if not plain:
        with path.open("r+b") as file:
            file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")
    return path


def save5(path, tree):
    def of(value):
        if isinstance(value, dict):
            return {name: of(item) for name, item in value.items()}
        if isinstance(value, list) and value and isinstance(value[0], dict):
            made = np.empty((1, len(value)), dtype=[(name, object) for name in value[0]])
            for k, item in enumerate(value):
                made[0, k] = tuple(of(x) for x in item.values())
            return made
        return np.array(value, dtype=object).reshape(-1, 1) if isinstance(value, list) else value

    savemat(
        path, {name: of(value) for name, value in tree.items()}, do_compression=True, long_field_names=True
    )
    return path


BOTH = pytest.mark.parametrize("save", [save5, save73])


@BOTH
@pytest.mark.parametrize("form", ["column", "row"])
def test_vectors_as_variables(tmp_path, frame, save, form):
    assert_same(read_log(save(tmp_path / "log.mat", columns(frame, form))), frame)


@BOTH
def test_the_fields_of_a_struct(tmp_path, frame, save):
    """Bare names where one struct has them, STRUCT.FIELD in a mapping; the time vector need not be called time_s."""
    fields = columns(frame.rename(columns={"time_s": "Time"}))
    path = save(tmp_path / "log.mat", {"run": fields, "note": "a dry day", "gain": 2.0})
    log = read_log(path)
    assert_same(log, frame)
    fields["v"] = fields.pop("vehicle_speed_m_s")
    path = save(tmp_path / "log.mat", {"run": fields, "old": {"v": np.zeros((301, 1))}})
    with pytest.raises(LogError, match=r"is it '|missing: vehicle_speed_m_s"):
        read_log(path)
    (tmp_path / "bare.yaml").write_text("vehicle_speed_m_s: v\n")
    with pytest.raises(
        LogError, match=r"variable v stands for several: old\.v, run\.v; expected one of these in a mapping"
    ):
        read_log(path, load_mapping(tmp_path / "bare.yaml"))
    (tmp_path / "map.yaml").write_text("vehicle_speed_m_s: run.v\n")
    assert_same(read_log(path, load_mapping(tmp_path / "map.yaml")), frame)


@BOTH
def test_a_time_of_any_name_and_unit(tmp_path, frame, save):
    fields = columns(frame)
    fields["Zeit"] = 1e3 * fields.pop("time_s")
    (tmp_path / "map.yaml").write_text("time_s: {column: Zeit, unit: ms}\n")
    log = read_log(save(tmp_path / "log.mat", fields), load_mapping(tmp_path / "map.yaml"))
    assert log.time_s == pytest.approx(frame["time_s"], abs=1e-12)


@BOTH
def test_a_struct_for_each_signal_has_its_own_times(tmp_path, frame, save):
    """As a Dataset or timeseries is exported; units where they are stated."""
    tree = {
        name: {"Time": frame[["time_s"]].to_numpy(), "Data": frame[[name]].to_numpy()} for name in NAMES[1:]
    }
    slow_s = np.arange(31)[:, None] / 10.0
    tree["vehicle_speed_m_s"] = {"time": slow_s, "values": 15.0 + 0.3 * slow_s, "unit": "m/s"}
    tree["accel_x_m_s2"]["DataInfo"] = {"Units": "m/s^2"}
    log = read_log(save(tmp_path / "log.mat", tree if save is save73 else {"S": tree}))
    assert np.array_equal(log.time_s, frame["time_s"])
    assert log.signals["vehicle_speed_m_s"] == pytest.approx(15.0 + 0.3 * log.time_s, abs=1e-9)
    assert log.warnings == ("channel vehicle_speed_m_s comes at 10 Hz and was interpolated onto 100 Hz.",)
    assert np.array_equal(log.signals["accel_x_m_s2"], frame["accel_x_m_s2"])


@BOTH
def test_a_structure_with_time_of_simulink(tmp_path, frame, save):
    signals = [
        {"values": frame[[name]].to_numpy(), "dimensions": 1.0, "label": name, "blockName": f"car/{name}"}
        for name in NAMES[1:]
    ]
    path = save(tmp_path / "log.mat", {"out": {"time": frame[["time_s"]].to_numpy(), "signals": signals}})
    assert_same(read_log(path), frame)


@BOTH
def test_texts_in_a_cell_array(tmp_path, save):
    frame = make_frame(camera=True)
    tree = columns(frame.drop(columns="image_path"))
    tree["image_path"] = frame["image_path"].tolist()
    log = read_log(save(tmp_path / "log.mat", tree))
    assert log.image_path.tolist() == frame["image_path"].tolist()


def test_integers_and_what_is_no_vector(tmp_path, frame):
    fields = columns(frame)
    fields["image_class"] = np.zeros((301, 1), np.int8)
    assert read_log(save5(tmp_path / "log.mat", fields)).signals["image_class"].tolist() == [0.0] * 301
    fields["position_m"] = np.zeros((301, 3))
    with pytest.raises(LogError, match="variable position_m is an array of 301x3; expected a vector"):
        read_log(save5(tmp_path / "log.mat", fields))
    fields["position_m"] = 3.0
    with pytest.raises(LogError, match="variable position_m is a single number; expected a vector"):
        read_log(save5(tmp_path / "log.mat", fields))
    fields["position_m"] = np.ones((301, 1)) * 1j
    with pytest.raises(LogError, match="variable position_m is complex numbers"):
        read_log(save5(tmp_path / "log.mat", fields))
    fields["position_m"] = np.zeros((7, 1))
    with pytest.raises(
        LogError, match="variable position_m has 7 values, and no vector `time` of this length"
    ):
        read_log(save5(tmp_path / "log.mat", fields))


def test_version_4(tmp_path, frame):
    savemat(
        tmp_path / "log.mat", {f"v{i}": frame[[name]].to_numpy() for i, name in enumerate(NAMES)}, format="4"
    )
    (tmp_path / "map.yaml").write_text("\n".join(f"{name}: v{i}" for i, name in enumerate(NAMES)))
    assert_same(read_log(tmp_path / "log.mat", load_mapping(tmp_path / "map.yaml")), frame)


def element(kind, data):
    return struct.pack("<II", kind, len(data)) + data + bytes(-len(data) % 8)


def with_object5(path, name, matlab):
    """A file of version 5 with a further variable that is an object of MATLAB's."""
    flags = element(6, struct.pack("<II", 17, 0))
    inner = element(6, struct.pack("<II", 13, 0)) + element(5, struct.pack("<ii", 1, 1)) + element(1, b"")
    inner = element(14, inner + element(6, struct.pack("<I", 0xDD000000)))
    body = flags + b"".join(element(1, text.encode()) for text in (name, "MCOS", matlab)) + inner
    path.write_bytes(path.read_bytes() + element(14, body))
    return path


def with_object73(path, name, matlab):
    with h5py.File(path, "r+") as root:
        root[name] = np.array([[0xDD000000]], dtype=np.uint32)
        root[name].attrs["MATLAB_class"] = np.bytes_(matlab)
        root[name].attrs["MATLAB_object_decode"] = np.int32(3)
    return path


@pytest.mark.parametrize(("save", "add"), [(save5, with_object5), (save73, with_object73)])
@pytest.mark.parametrize(
    ("matlab", "line"),
    [
        ("timetable", r"S = table2struct\(timetable2table\(drive, "),
        ("Simulink.SimulationData.Dataset", r"for k = 1:drive\.numElements, e = drive\{k\}; S\.\("),
        ("timeseries", r"S\.drive = struct\('time', drive\.Time, "),
        ("table", r"S = table2struct\(drive, 'ToScalar', true\)"),
    ],
)
def test_an_object_of_matlab_is_named_with_the_line_that_saves_it(tmp_path, frame, save, add, matlab, line):
    path = add(save(tmp_path / "log.mat", {"gain": 2.0}), "drive", matlab)
    with pytest.raises(LogError, match=rf"variable drive is an object of MATLAB's class {matlab}, .*{line}"):
        read_log(path)
    path = add(save(tmp_path / "log.mat", columns(frame)), "drive", matlab)
    log = read_log(path)
    assert_same(log, frame)
    assert any(f"class {matlab}" in text for text in log.warnings)


def test_what_lies_in_another_file_is_not_read(tmp_path, frame):
    secret = save73(tmp_path / "secret.mat", columns(frame))
    names = ["time_s", "position_m"]
    for make in (
        lambda root: root.__setitem__("position_m", h5py.ExternalLink(str(secret), "position_m")),
        lambda root: root.create_dataset("position_m", (301,), "f8", external=str(secret)),
    ):
        path = save73(tmp_path / "log.mat", columns(frame[[n for n in NAMES if n != names[1]]]))
        with h5py.File(path, "r+") as root:
            make(root)
        with pytest.raises(
            LogError, match=r"cannot be read as MAT-file \(.*position_m (is a link|lies in another)"
        ):
            read_log(path)


def test_a_circle_of_groups_ends(tmp_path, frame):
    path = save73(tmp_path / "log.mat", columns(frame))
    with h5py.File(path, "r+") as root:
        group = root.create_group("a")
        group["b"] = group
    with pytest.raises(LogError, match=r"cannot be read as MAT-file .*20 deep"):
        read_log(path)


def test_a_variable_that_unfolds_is_refused(tmp_path, frame):
    path = save73(tmp_path / "log.mat", columns(frame.drop(columns="position_m")))
    with h5py.File(path, "r+") as root:
        root.create_dataset("position_m", (10**9,), "f8", chunks=(10**6,), compression="gzip")
    with pytest.raises(LogError, match="samples in the variables that are read; expected at most"):
        read_log(path)


def test_plain_hdf5_and_wrong_names(tmp_path, frame):
    path = save73(tmp_path / "log.mat", columns(frame), plain=True)
    assert_same(read_log(path), frame)
    (tmp_path / "log.csv").write_bytes(path.read_bytes())
    with pytest.raises(LogError, match="is named like CSV and does not start like it"):
        read_log(tmp_path / "log.csv")
    frame.to_csv(tmp_path / "table.mat", index=False)
    with pytest.raises(LogError, match="is named like MAT and does not start like it"):
        read_log(tmp_path / "table.mat")


@BOTH
@pytest.mark.parametrize("seeds", [range(10), pytest.param(range(10, 100), marks=pytest.mark.long)])
def test_damage_is_a_clean_error_or_a_log(tmp_path, monkeypatch, capfd, save, seeds):
    """200 files: cut, or with changed bytes."""
    monkeypatch.setattr(extraction, "LEAST_LIMIT_S", 15.0)
    good = save(
        tmp_path / "good.mat", {"run": columns(make_frame(rate_hz=50.0, duration_s=2.2))}
    ).read_bytes()
    refused = 0
    for seed in seeds:
        rng = np.random.default_rng(seed)
        raw = bytearray(good)
        if seed % 3:
            for at in rng.integers(len(raw), size=rng.integers(1, 9)):
                raw[at] = rng.integers(256)
        else:
            raw = raw[: rng.integers(len(raw))]
        (tmp_path / "log.mat").write_bytes(raw)
        try:
            read_log(tmp_path / "log.mat")
        except LogError as error:
            refused += 1
            text = str(error)
            if "within 15 s" in text:
                pytest.fail(text)
    assert refused > len(seeds) // 10
    assert capfd.readouterr().err == ""
