"""Files of others are opened in one place each: what reads otherwise is listed here, with whose file it is."""

from __future__ import annotations

import ast
import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGES = ("trpac", "trpac_core", "fmu_src", "scenarios", "sim2real", "trpac_hil", "trpac_cli")

READS = re.compile(
    r".+\.(read_text|read_bytes)|(.+\.)?(open|fdopen|imdecode|imread|VideoCapture|ZipFile|is_zipfile|ParquetFile|read_schema"
    r"|XMLParser|MDF|loadmat)|json\.loads?|np\.load|h5py\.File|pickle\.\w+|(\w+\.)*(etree|ElementTree|ast)\.(parse|fromstring)"
    r"|cantools\..+|eval|exec|compile"
)
"""Calls that read a file or a text, or run one."""
MODULES = {"yaml", "pickle", "numexpr", "sympy", "shelve", "marshal", "dill"}
"""What unpacks or runs what it reads."""

OPENED = {
    "trpac_core/files.py": {"open", "fdopen", "loads"},  # the guard of paths and sizes
    "trpac_core/vision/images.py": {"imdecode"},  # the reader of pictures
    "scenarios/yaml_text.py": {"yaml"},  # the reader of YAML
    "scenarios/vision_runs.py": {"VideoCapture"},  # of videos, behind the guard
    "scenarios/fmu_client/archives.py": {"open", "ZipFile"},  # of archives
    "fmu_src/ssp_parameters.py": {"XMLParser", "fromstring"},  # of what the reader of archives hands on
    "fmu_src/trial.py": {
        "parse"
    },  # in a process that may die, of a unit that the reader of archives has unpacked
    "sim2real/logs/formats/parquet_file.py": {"ParquetFile", "read_schema"},  # behind the guard
    "sim2real/logs/formats/extractor.py": {
        "load",
        "fdopen",
        "read_text",
    },  # orders, answers and sizes of that process
    "sim2real/logs/formats/extraction.py": {"load", "loads"},  # the answer of the process that may die
    "sim2real/logs/formats/mdf_channels.py": {"open", "MDF"},  # in it
    "sim2real/logs/formats/bus_frames.py": {"open"},  # in it
    "sim2real/logs/formats/mat_variables.py": {"open", "loadmat", "File"},  # in it
    "sim2real/logs/formats/formula.py": {"parse"},  # to a syntax tree, of which arithmetic alone is evaluated
    "sim2real/logs/formats/dbc.py": {"load_string"},  # of the text that the guard has read
}
"""What reads files of others, and by which calls."""
OWN = {
    "fmu_src/native/build.py": {"read_bytes", "read_text"},  # sources into a unit
    "fmu_src/native/translator/source.py": {"parse", "read_text"},  # likewise
    "fmu_src/packaging.py": {"ZipFile", "read_bytes"},  # sources into a unit
    "fmu_src/ssp.py": {"read_bytes"},  # units into a package
    "scenarios/overlay_video.py": {"VideoCapture"},  # the video that it has written
    "scenarios/report.py": {"read_bytes"},  # a figure into a report
    "scenarios/sweep/execute.py": {"open"},  # `Parts.open`
    "scenarios/sweep/store.py": {"loads", "read_bytes"},  # sources for their hash
    "scenarios/whole_files.py": {"open"},  # a file, to write
    "sim2real/demo.py": {"read_bytes"},  # a shipped vehicle, to copy it
    "sim2real/logs/write.py": {"MDF"},
    "sim2real/discrepancy/prior.py": {"loads", "read_text"},  # what was learnt of other builds
    "sim2real/own_model/runs.py": {
        "load",
        "loads",
        "read_text",
    },  # the answer of the process that runs a unit
    "sim2real/own_model/worker.py": {"load", "loads", "read_text"},  # that process' job
    "trpac/scenarios.py": {"read_bytes"},  # a figure that it has drawn
    "trpac_hil/delays.py": {"open"},  # /proc
    "trpac_hil/realtime.py": {"read_text"},  # /proc
    "trpac_hil/helper.py": {"loads", "pickle"},  # from the process that started this one
    "trpac_hil/mdf.py": {"MDF"},
}
"""What reads this project's own files and nobody else's, or writes."""


def used(path: Path) -> set[str]:
    """The calls and modules of a file that read, by their last name."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        match node:
            case ast.Call(func=func) if READS.fullmatch(called := ast.unparse(func)):
                names.add(called.rpartition(".")[2])
            case ast.Import(names=aliases):
                names.update({alias.name.partition(".")[0] for alias in aliases} & MODULES)
            case ast.ImportFrom(module=str() as module):
                names.update({module.partition(".")[0]} & MODULES)
    return names


def test_files_of_others_are_opened_by_their_readers_alone() -> None:
    found = {
        path.relative_to(ROOT).as_posix(): names
        for package in PACKAGES
        for path in sorted((ROOT / package).rglob("*.py"))
        if (names := used(path))
    }
    allowed = {path: OPENED.get(path, set()) | OWN.get(path, set()) for path in {*found, *OPENED, *OWN}}
    strange = {path: names - allowed[path] for path, names in found.items() if names - allowed[path]}
    assert not strange
    listed = {path: allowed[path] - found.get(path, set()) for path in allowed}
    assert not {path: names for path, names in listed.items() if names}, "no longer used there"
