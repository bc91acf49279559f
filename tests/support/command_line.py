"""The commands in this process, and their text without frames."""

import re

from typer.testing import CliRunner

from trpac_cli.main import app


def run(*arguments):
    """The command in this process; wide, so that nothing wraps."""
    return CliRunner(env={"COLUMNS": "250", "TERM": "dumb"}).invoke(app, [str(a) for a in arguments])


def words(text):
    return " ".join(re.sub(r"[│─╭╮╰╯┃┏┓┗┛━┡┩┳┻╇┴┬]", " ", text).split())
