import os
from pathlib import Path

import numpy as np
import pytest

from eddyscan.analysis.foreign import edges_along_path, flat_map, foreign_record, over_air
from eddyscan.core.errors import FileError

DATA = Path(os.environ.get("EDDYSCAN_DATA", Path(__file__).resolve().parents[2] / ".." / "shared" / "data"))
REAL = DATA / "ect_cscan_brisect" / "CoarseScanMultiFreq.csv"


def table(lines):
    return "\n".join(["x (mm),y (mm),Spec 1e6Hz,Spec 2000000.0Hz", *lines])


def test_a_plate_with_a_hole_shows_its_edges():
    rng = np.random.default_rng(1)
    lines = []
    for y in np.arange(0, 10, 0.5):
        for x in np.arange(0, 20, 0.5):
            metal = 3 < x < 17 and not (8 < x < 12 and 3 < y < 7)
            z = (5 + 2j + 0.3 * rng.standard_normal()) * metal + 0.01 * rng.standard_normal()
            lines.append(f"{x},{y},({z.real:.5f}{z.imag:+.5f}j),(1+0j)")
    record = foreign_record(table(lines))[1e6]
    assert record.row.max() == 19
    x, y = record.part_mm[:, 0], record.part_mm[:, 1]
    hole = (x > 8) & (x < 12) & (y > 3) & (y < 7)
    assert np.array_equal(over_air(record), hole | (x <= 3) | (x >= 17))
    edges = edges_along_path(record)
    assert edges.sum() == 2 * 20 + 2 * 7
    cscan = flat_map(record)
    assert cscan.covered.all()
    assert (
        cscan.channels["air"][np.argmin(np.hypot(cscan.mesh.vertices[:, 0] - 10, cscan.mesh.vertices[:, 1] - 5))] == 1
    )


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("", "holds 0 readings"),
        ("x,y,signal\n1,2,3", "no column with a frequency; its headings are x, y, signal"),
        (table(["1,2,(1+2j),(1j)", "1,oops,(1+2j),(1j)"]), "line 3 of the table is not x, y and 2 complex readings"),
        (table(["1,2,(1+2j)"]), "line 2 of the table"),
    ],
)
def test_a_table_that_cannot_be_read_names_its_line(text, fault):
    with pytest.raises(FileError, match=fault):
        foreign_record(text)


@pytest.mark.skipif(not REAL.is_file(), reason=f"real scan {REAL} is not there; set EDDYSCAN_DATA")
def test_a_real_scan_shows_where_the_plate_ends():
    records = foreign_record(REAL.read_text(), name=REAL.name)
    assert sorted(records) == [11e6, 12e6, 13e6]
    record = records[12e6]
    assert len(record) == 3623
    x, y = record.part_mm[:, 0], record.part_mm[:, 1]
    outside = (x < 82) | (x > 136) | (y < 39) | (y > 94)
    inside = (x > 87) & (x < 130) & (y > 45) & (y < 88)
    air = over_air(record)
    assert air[outside].all()
    assert not air[inside].any()
    # the three frequencies agree on where the metal ends
    others = [over_air(records[f]) for f in (11e6, 13e6)]
    assert all((other != air).mean() < 0.02 for other in others)
    edges = edges_along_path(record)
    assert 10 <= edges.sum() <= 14
    left = edges & (np.abs(x - 84) < 2)
    assert np.ptp(x[left]) < 0.5
    cscan = flat_map(record)
    assert 0.1 < cscan.covered.mean() < 0.4
