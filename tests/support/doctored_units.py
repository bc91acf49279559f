"""Copies of a unit that were changed, and what `trpac fmu doctor` finds in one."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Mapping
from pathlib import Path

from typer.testing import CliRunner, Result

from fmu_src.contents import CONTENTS_FILE, sha256_of
from trpac_cli.main import app

RECORD = f"resources/{CONTENTS_FILE}"


def command(*arguments: object) -> Result:
    return CliRunner(env={"COLUMNS": "200"}).invoke(app, ["fmu", "doctor", *map(str, arguments)])


def findings(done: Result) -> dict[str, dict[str, str]]:
    return {finding["what"]: finding for finding in json.loads(done.stdout)["findings"]}


def changed(archive: Path, target: Path, changes: Mapping[str, bytes | None], recorded: bool = False) -> Path:
    """A copy of the archive with other files; None leaves one out, and `recorded` writes the record to match."""
    with zipfile.ZipFile(archive) as old:
        files: dict[str, bytes | None] = {name: old.read(name) for name in old.namelist()}
    files |= changes
    if recorded:
        record = json.loads(files[RECORD] or b"")
        record["files"] |= {name: sha256_of(data) for name, data in changes.items() if data is not None}
        files[RECORD] = json.dumps(record).encode()
    with zipfile.ZipFile(target, "w") as new:
        for name, data in files.items():
            if data is not None:
                new.writestr(name, data)
    return target


def crashing(unit_file: Path, target: Path, code: str) -> Path:
    """A whole unit, by its record, whose entry script does something else first."""
    with zipfile.ZipFile(unit_file) as archive:
        entry = f"resources/{archive.read('resources/slavemodule.txt').decode()}.py"
        script = archive.read(entry)
    return changed(unit_file, target, {entry: code.encode() + b"\n" + script}, recorded=True)
