"""A small campaign: a few cases on a coarse field, crack tables of few nodes kept for the whole run."""

from __future__ import annotations

from pathlib import Path

import pytest

from eddyscan.campaign import library

SMALL = """
[campaign]
cases = {cases}
seed = 3
[vary]
"flaw.length_mm" = {{ uniform = [0.8, 2.0], log = true }}
"flaw.depth_mm" = {{ of = "flaw.length_mm", times = 0.33 }}
"flaw.opening_mm" = 0.05
pitch_mm = 1.0
step_mm = 1.0
field_mm = 20.0
"""


@pytest.fixture(scope="session")
def table_cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder that keeps crack tables from test to test."""
    return tmp_path_factory.mktemp("tables")


@pytest.fixture(autouse=True)
def _own_cache(monkeypatch: pytest.MonkeyPatch, table_cache: Path) -> None:
    monkeypatch.setenv("EDDYSCAN_CACHE", str(table_cache))


@pytest.fixture
def small_tables(monkeypatch: pytest.MonkeyPatch) -> None:
    """Crack tables too coarse to trust and quick to build."""
    for name, count in (("ALONG", 9), ("ACROSS", 9), ("HEIGHTS", 4)):
        monkeypatch.setattr(library, name, count)
    return


@pytest.fixture
def small_campaign(tmp_path: Path) -> Path:
    """Return a campaign file of eight small cases."""
    return written(tmp_path, cases=8)


def written(folder: Path, *, cases: int) -> Path:
    """Write the small campaign's file and return its path."""
    path = folder / "campaign.toml"
    path.write_text(SMALL.format(cases=cases))
    return path
