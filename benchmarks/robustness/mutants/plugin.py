"""What pytest does more here: say which test runs, and run chosen tests in a chosen order."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest


class Watch:
    """Tells the record which test runs, and writes how each ended and how long it took.

    What a fixture of many tests runs counts for each of them: it is recorded as the fixture's.
    """

    def __init__(self, told: Path) -> None:
        self._told = told
        self._took: dict[str, float] = {}
        self._failed: set[str] = set()
        self._fixtures: dict[str, list[str]] = {}

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        shared = getattr(item, "_fixtureinfo", None)
        names = shared.name2fixturedefs.values() if shared else ()
        self._fixtures[item.nodeid] = [_fixture(f) for many in names for f in many if f.scope != "function"]
        _lines().begin(item.nodeid)
        return (yield)

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(self, fixturedef: Any) -> Iterator[None]:
        if fixturedef.scope == "function":
            return (yield)
        outer = _lines().test
        _lines().begin(_fixture(fixturedef))
        try:
            return (yield)
        finally:
            _lines().begin(outer)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        self._took[report.nodeid] = self._took.get(report.nodeid, 0.0) + report.duration
        if not report.passed:
            self._failed.add(report.nodeid)

    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        passed = {test: took for test, took in self._took.items() if test not in self._failed}
        modules = [name for name, module in sys.modules.items() if "site-packages" in str(_file(module))]
        told = {
            "took": passed,
            "failed": sorted(self._failed),
            "fixtures": self._fixtures,
            "modules": modules,
        }
        self._told.write_text(json.dumps(told), encoding="utf-8")


class Chosen:
    """Runs only these tests, in this order, and writes the first that fails."""

    def __init__(self, tests: Sequence[str], told: Path) -> None:
        self._rank = {test: i for i, test in enumerate(tests)}
        self._told = told

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        items[:] = sorted(
            (i for i in items if i.nodeid in self._rank), key=lambda item: self._rank[item.nodeid]
        )

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed:
            with self._told.open("a", encoding="utf-8") as told:
                told.write(f"{report.nodeid}\n")


def _lines() -> Any:
    return sys.modules["sitecustomize"].lines  # the copy of lines.py


def _fixture(definition: Any) -> str:
    return f"fixture {definition.baseid} {definition.argname}"


def _file(module: object) -> object:
    return getattr(module, "__file__", None)


def pytest_configure(config: pytest.Config) -> None:
    """As `-p` names this file: watch."""
    import os

    config.pluginmanager.register(Watch(Path(os.environ["MUTANTS_TOLD"])))
