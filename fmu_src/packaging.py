"""From sources to the unit's archive: unique module names, fixed bytes."""

from __future__ import annotations

import hashlib
import re
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import distribution, version
from pathlib import Path

import pythonfmu

from scenarios.whole_files import written_whole
from trpac_core.errors import TrpacError
from trpac_core.parameters.variables import Variable

from .contents import CONTENTS_FILE, Contents, sha256_of
from .model_description import UnitInfo, model_description

SLAVE_FILES = ("__init__.py", "contents.py", "guarded_slave.py", "host.py")
"""Files of this package in every unit."""

PYTHONFMU_FILES = (
    "__init__.py",
    "_version.py",
    "default_experiment.py",
    "enums.py",
    "fmi2slave.py",
    "logmsg.py",
    "variables.py",
)
"""Files of pythonfmu in every unit, without its builder and command line."""

ZIP_TIME = (1980, 1, 1, 0, 0, 0)
"""Time of all entries, so that the same content gives the same bytes; the earliest of the zip format."""
HASH_DIGITS = 12
"""Digits of the content's hash in module names."""


@dataclass(frozen=True)
class Slave:
    """One unit that can be built.

    Parameters
    ----------
    info : UnitInfo
        General attributes; the name is that of the slave class.
    files : tuple of str
        Files of this package in the unit besides `SLAVE_FILES`; that of the slave class is the last.
    variables : sequence of Variable
        In the order of their value references.
    modules : mapping
        Folder or file by its path among the unit's modules: code of other packages in the unit.
    packages : mapping
        Modules that the host must have, and their PyPI packages.
    resources : sequence of Path
        Files beside the code.
    compiled : str
        Package among `modules` whose compiled code is kept in the user's cache; empty if none.
    """

    info: UnitInfo
    files: tuple[str, ...]
    variables: Sequence[Variable]
    modules: Mapping[str, Path]
    packages: Mapping[str, str]
    resources: Sequence[Path]
    compiled: str = ""

    @property
    def module(self) -> str:
        """Module of the slave class."""
        return self.files[-1].removesuffix(".py")


class BuildError(TrpacError):
    """The unit cannot be built; the text lists all problems."""


def build_unit(slave: Slave, target: Path, *, flat: bool = False) -> Path:
    """Write the unit's archive; the same sources give the same bytes.

    Returns
    -------
    Path
        `target`.

    Raises
    ------
    BuildError
        Parts of the unit are missing.
    OSError
        The archive cannot be written.
    """
    missing = [str(path) for path in slave.resources if not path.is_file()]
    if missing:
        raise BuildError(f"These files belong into the unit and are not there: {', '.join(missing)}.")
    content = _resources(slave) | _binaries(slave.info.name) | licences("trpac-fmu", "pythonfmu")
    digest = digest_of(model_description(slave.info, slave.variables, "", flat=flat), content)
    content = {_renamed(path, digest): _renamed_imports(path, data, digest) for path, data in content.items()}
    content[f"resources/{slave.info.name}_{digest}.py"] = _entry(slave, digest)
    content["resources/slavemodule.txt"] = f"{slave.info.name}_{digest}".encode()
    content["modelDescription.xml"] = model_description(slave.info, slave.variables, digest, flat=flat)
    files = {path: sha256_of(data) for path, data in content.items()}
    record = Contents(slave.info.name, slave.info.version, digest, dict(slave.packages), files)
    content[f"resources/{CONTENTS_FILE}"] = record.to_bytes()
    return write_archive(target, content)


def write_archive(target: Path, content: Mapping[str, bytes]) -> Path:
    """Write a zip archive, whole or not at all; the same content by path gives the same bytes. Returns its path."""
    # Stored without compression, whose bytes differ between versions of zlib.
    with (
        written_whole(target.parent) as made,
        zipfile.ZipFile(made / target.name, "w", zipfile.ZIP_STORED) as archive,
    ):
        for path in sorted(content):
            entry = zipfile.ZipInfo(path, ZIP_TIME)
            entry.external_attr = 0o644 << 16
            archive.writestr(entry, content[path])
    return target


def _module_files(target: str, path: Path) -> dict[str, bytes]:
    if path.is_file():
        return {target: path.read_bytes()}
    return {
        f"{target}/{file.relative_to(path).as_posix()}": file.read_bytes()
        for file in path.rglob("*.py")
        if "__pycache__" not in file.parts
    }


def _resources(slave: Slave) -> dict[str, bytes]:
    here, wrapper = Path(__file__).parent, _folder(pythonfmu)
    files: dict[str, bytes] = {}
    for target, path in slave.modules.items():
        files |= {f"resources/{name}": data for name, data in _module_files(target, path).items()}
    for name in (*SLAVE_FILES, *slave.files):
        files[f"resources/fmu_src/{name}"] = (here / name).read_bytes()
    for name in PYTHONFMU_FILES:
        files[f"resources/pythonfmu/{name}"] = (wrapper / name).read_bytes()
    # The package's own __init__ imports its builder, which a host does not need.
    files["resources/pythonfmu/__init__.py"] = b'"""The slave side of PythonFMU."""\n'
    for path in slave.resources:
        files[f"resources/{path.name}"] = path.read_bytes()
    return files


def _binaries(name: str) -> dict[str, bytes]:
    binaries = _folder(pythonfmu) / "resources" / "binaries"
    files = {
        f"binaries/{path.parent.name}/{name}{path.suffix}": path.read_bytes()
        for path in binaries.rglob("*")
        if path.suffix in (".so", ".dll", ".dylib")
    }
    if not files:
        raise BuildError(
            f"{binaries}: pythonfmu {version('pythonfmu')} brings no wrapper library. Install it again."
        )
    return files


def licences(*packages: str) -> dict[str, bytes]:
    """The licences of packages that a unit contains, by path."""
    names = {"trpac-fmu": "license.txt", "pythonfmu": "pythonfmu.txt"}
    return {
        f"documentation/licenses/{name}": Path(str(path.locate())).read_bytes()
        for package, name in names.items()
        if package in packages
        for path in distribution(package).files or []
        if path.name == "LICENSE"
    }


def digest_of(description: bytes, content: dict[str, bytes]) -> str:
    """Hash of the unit's content and of its description without a hash."""
    total = hashlib.sha256(description)
    for path in sorted(content):
        total.update(f"{path}\0{len(content[path])}\0".encode() + content[path])
    return total.hexdigest()[:HASH_DIGITS]


_CARRIED = re.compile(rb"^(\s*(?:from|import) )(trpac_core|scenarios|fmu_src|pythonfmu)\b", re.MULTILINE)


def _renamed(path: str, digest: str) -> str:
    return re.sub(r"^resources/(trpac_core|scenarios|fmu_src|pythonfmu)/", rf"resources/\1_{digest}/", path)


def _renamed_imports(path: str, data: bytes, digest: str) -> bytes:
    return _CARRIED.sub(rb"\1\2_" + digest.encode(), data) if path.endswith(".py") else data


def _entry(slave: Slave, digest: str) -> bytes:
    """The script that the wrapper runs at each instantiation."""
    lines = [
        f'"""Entry of the unit {slave.info.name}."""',
        f"from fmu_src_{digest}.host import import_kept, keep, require_packages",
        "keep(globals())",
        f"require_packages({slave.info.name!r}, {dict(slave.packages)!r})",
    ]
    if slave.compiled:
        lines.append(f"import_kept({f'{slave.compiled}_{digest}'!r})")
    lines.append(f"from fmu_src_{digest}.{slave.module} import {slave.info.name}")
    return "\n".join(lines).encode() + b"\n"


def _folder(package: object) -> Path:
    return Path(str(package.__file__)).parent  # type: ignore[attr-defined]
