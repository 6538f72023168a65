"""Rows are Parquet parts: complete or absent, never of two campaigns."""

from pathlib import Path

import pytest

from eddyscan.campaign.store import RowStore
from eddyscan.core.errors import FileError


def test_rows_read_back_in_the_order_of_their_cases(tmp_path: Path) -> None:
    store = RowStore(tmp_path / "rows", {"campaign_sha256": "a"})
    store.add([{"case": 3, "found": True}])
    store.add([{"case": 1, "found": False}, {"case": 2, "found": True}])
    store.add([])
    again = RowStore(tmp_path / "rows", {"campaign_sha256": "a"})
    assert again.done() == {1, 2, 3}
    assert [row["case"] for row in again.rows()] == [1, 2, 3]


def test_a_half_written_part_does_not_count(tmp_path: Path) -> None:
    store = RowStore(tmp_path, {"campaign_sha256": "a"})
    (tmp_path / "rows-00000000-dead.tmp").write_bytes(b"PAR1 half")
    assert store.done() == set()


def test_rows_of_another_campaign_are_not_mixed_in(tmp_path: Path) -> None:
    RowStore(tmp_path, {"campaign_sha256": "a"})
    with pytest.raises(FileError, match="rows of another campaign"):
        RowStore(tmp_path, {"campaign_sha256": "b"})
