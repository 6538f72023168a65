"""Records too large for memory: analysed piece by piece with overlap, by the same `analyse` as small ones.

Every piece is analysed with the nearest rows of its neighbours, and speaks only
for the vertices and indications that its own readings are nearest to. Noise and
slow changes are judged per piece; an indication longer than the overlap may be
counted on both sides of a cut.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from scipy.spatial import KDTree

from eddyscan.analysis import AnalysisResult, analyse
from eddyscan.core.cscan import CScan
from eddyscan.core.errors import InputError
from eddyscan.core.frames import Array, BoolArray, IntArray
from eddyscan.core.indication import Indication
from eddyscan.core.mesh import SurfaceMesh
from eddyscan.core.progress import Progress, silent
from eddyscan.core.record import ScanRecord
from eddyscan.core.rim import edge_zone_mm
from eddyscan.core.technique import Technique

OVERLAP_IN_OUTER_RADII = 8.0  # beyond the crack's footprint (1.6), the local plane (4.4 + a cell) and one lobe
FIT_MM = 8.0  # the surface below a reading is fitted within this
COLUMNS = tuple(column.name for column in fields(ScanRecord) if column.name != "meta")


@dataclass(frozen=True)
class BlockResult:
    """What the pieces of one record say together.

    Attributes
    ----------
    cscan : CScan over the whole mesh, channels as in `analyse`
    indications : strongest first, numbered anew
    readings : how many readings there were
    pieces : how many pieces they came in
    """

    cscan: CScan
    indications: tuple[Indication, ...]
    readings: int
    pieces: int


def analyse_in_blocks(
    pieces: Iterable[ScanRecord], mesh: SurfaceMesh, technique: Technique, *, progress: Progress = silent
) -> BlockResult:
    """Map a record that comes in pieces on the surface; memory holds three pieces and the C-scan.

    Parameters
    ----------
    pieces : ScanRecords of consecutive whole rows, in order
    mesh : SurfaceMesh [mm, part]
    technique : Technique

    Raises
    ------
    InputError
        No piece, or a row cut in two; and what `analyse` raises.
    """
    whole = _Whole(mesh)
    readings = count = 0
    for before, piece, after in _with_neighbours(pieces):
        _analyse_piece(whole, (before, piece, after), technique)
        readings, count = readings + len(piece), count + 1
        progress("pieces", count, count)
    if count == 0:
        raise InputError("there is no piece of a record to analyse. Scan first.")
    return BlockResult(whole.cscan(), whole.numbered(), readings, count)


def in_pieces(record: ScanRecord, *, rows: int) -> Iterator[ScanRecord]:
    """Cut a record into pieces of so many whole rows."""
    starts = np.flatnonzero(np.diff(record.row, prepend=record.row[:1] - 1))[::rows]
    for begin, end in zip(starts, [*starts[1:], len(record)], strict=True):
        yield _part(record, slice(int(begin), int(end)))


def _with_neighbours(
    pieces: Iterable[ScanRecord],
) -> Iterator[tuple[ScanRecord | None, ScanRecord, ScanRecord | None]]:
    before: ScanRecord | None = None
    current: ScanRecord | None = None
    for after in pieces:
        if current is not None:
            if current.row[-1] == after.row[0]:
                raise InputError(f"row {int(after.row[0])} is cut between two pieces. Cut the record between rows.")
            yield before, current, after
        before, current = current, after
    if current is not None:
        yield before, current, None


def _analyse_piece(
    whole: _Whole, three: tuple[ScanRecord | None, ScanRecord, ScanRecord | None], technique: Technique
) -> None:
    before, piece, after = three
    radius = technique.probe.outer_radius_mm
    overlap_mm = OVERLAP_IN_OUTER_RADII * radius
    rows = int(np.ceil(overlap_mm / technique.plan.pitch_mm)) + 1
    head = [] if before is None else [_last_rows(before, rows)]
    tail = [] if after is None else [_first_rows(after, rows)]
    joined = _joined([*head, piece, *tail])
    own = np.zeros(len(joined), dtype=bool)
    own[sum(map(len, head)) :][: len(piece)] = True
    vertices, part = whole.near(joined.part_mm, edge_zone_mm(radius) + FIT_MM)
    whole.take(vertices, analyse(joined, part, technique), own)


class _Whole:
    """The C-scan of all pieces, filled as they come: nearest own reading wins a vertex."""

    def __init__(self, mesh: SurfaceMesh) -> None:
        n = len(mesh.vertices)
        self.mesh = mesh
        self.nearest_mm = np.full(n, np.inf)
        self.covered: BoolArray = np.zeros(n, dtype=bool)
        self.channels: dict[str, Array] = {}
        self.indications: list[Indication] = []

    def near(self, points_mm: Array, margin_mm: float) -> tuple[IntArray, SurfaceMesh]:
        """Return numbers of the vertices around the points, and the mesh they span."""
        low, high = points_mm.min(axis=0) - margin_mm, points_mm.max(axis=0) + margin_mm
        inside = np.ones(len(self.mesh.vertices), dtype=bool)
        for axis in range(3):
            inside &= (self.mesh.vertices[:, axis] >= low[axis]) & (self.mesh.vertices[:, axis] <= high[axis])
        faces = self.mesh.faces[inside[self.mesh.faces].all(axis=1)]
        numbers, faces = np.unique(faces, return_inverse=True)
        uncertainty = self.mesh.uncertainty_mm
        part = SurfaceMesh(
            self.mesh.vertices[numbers],
            faces.reshape(-1, 3),
            self.mesh.normals[numbers],
            None if uncertainty is None else uncertainty[numbers],
        )
        return numbers, part

    def take(self, vertices: IntArray, result: AnalysisResult, own: BoolArray) -> None:
        """Enter what a piece's own readings say."""
        foot = np.asarray(result.foot_mm)
        known = np.isfinite(foot).all(axis=1)
        if not (known & own).any():
            return
        distance = np.asarray(KDTree(foot[known & own]).query(result.cscan.mesh.vertices)[0])
        better = distance < self.nearest_mm[vertices]
        at = vertices[better]
        self.nearest_mm[at] = distance[better]
        self.covered[at] = result.cscan.covered[better]
        for name, values in result.cscan.channels.items():
            self.channels.setdefault(name, np.full(len(self.covered), np.nan))[at] = values[better]
        if result.indications:
            centres = np.array([found.centre_mm for found in result.indications])
            ours = own[known][KDTree(foot[known]).query(centres)[1]]
            self.indications += [found for found, mine in zip(result.indications, ours, strict=True) if mine]

    def cscan(self) -> CScan:
        """Return the values of all pieces."""
        return CScan(self.mesh, self.covered, self.channels)

    def numbered(self) -> tuple[Indication, ...]:
        """Return the indications of all pieces, strongest first."""
        ordered = sorted(self.indications, key=lambda found: -found.snr)
        return tuple(replace(found, number=number) for number, found in enumerate(ordered, start=1))


def _part(record: ScanRecord, which: slice | BoolArray) -> ScanRecord:
    return ScanRecord(**{name: getattr(record, name)[which] for name in COLUMNS}, meta=record.meta)


def _last_rows(record: ScanRecord, rows: int) -> ScanRecord:
    return _part(record, np.isin(record.row, np.unique(record.row)[-rows:]))


def _first_rows(record: ScanRecord, rows: int) -> ScanRecord:
    return _part(record, np.isin(record.row, np.unique(record.row)[:rows]))


def _joined(records: Sequence[ScanRecord]) -> ScanRecord:
    columns = {name: np.concatenate([getattr(record, name) for record in records]) for name in COLUMNS}
    return ScanRecord(**columns, meta=records[0].meta)
