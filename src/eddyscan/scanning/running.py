"""Run a plan: whatever happens, the axes end stopped, the probe lifted and the record whole."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass

from eddyscan.core.frames import Array, checked_transform
from eddyscan.core.mesh import SurfaceMesh
from eddyscan.core.plan import ScanPlan
from eddyscan.core.progress import Progress, silent
from eddyscan.core.technique import Technique
from eddyscan.devices.protocols import Clock, EddyInstrument, RecordSink, Stage
from eddyscan.scanning.checking import check
from eddyscan.scanning.keep_out import KeepOut
from eddyscan.scanning.part_watch import PartWatch
from eddyscan.scanning.rows import scan_in_rows
from eddyscan.scanning.signals import ended_by_signals
from eddyscan.scanning.stepping import scan_in_steps
from eddyscan.scanning.targets import travel_height_mm, with_z
from eddyscan.scanning.tilt import TiltHead, axis_targets


@dataclass
class Scan:
    """One run of one plan: the values and devices every mode of scanning needs.

    `targets` are the axis readings (N, n_axes) [mm or deg, stage] of the plan's
    poses, `faces` their coil faces (N, 3) [mm, stage], `height_mm` the z reading
    at which the probe crosses over the part, `at` the pose where the probe stands
    (None: elsewhere), `row` the row under way.
    """

    plan: ScanPlan
    stage: Stage
    instrument: EddyInstrument
    clock: Clock
    sink: RecordSink
    technique: Technique
    targets: Array
    faces: Array
    height_mm: float
    began_s: float
    progress: Progress = silent
    head: TiltHead | None = None
    at: int | None = None
    row: int | None = None
    watch: PartWatch | None = None
    rows_since_watch: int = 0

    def face_of(self, position: Array) -> Array:
        """Return the coil face (3,) [mm, stage] at axis readings (n_axes,)."""
        return position[:3] if self.head is None else self.head.face(position)


def run(
    plan: ScanPlan,
    *,
    stage: Stage,
    instrument: EddyInstrument,
    clock: Clock,
    sink: RecordSink,
    technique: Technique,
    T_stage_part: Array,
    progress: Progress = silent,
    mesh: SurfaceMesh | None = None,
    keep_out: Sequence[KeepOut] = (),
    head: TiltHead | None = None,
) -> None:
    """Take every reading of the plan that the sink does not hold yet.

    Parameters
    ----------
    plan : ScanPlan
        Poses in the part frame.
    T_stage_part : (4, 4)
        Pose of the part on the stage.
    sink : RecordSink
        Readings are durable when its `write` returns; it is left open.
    clock : Clock
        The rig's clock, shared by the stage and the instrument.
    mesh, keep_out, head : as for `check`

    Raises
    ------
    TravelError
        Before anything moves.
    DeviceError, ScanAborted, KeyboardInterrupt, ...
        After the axes were stopped and the probe lifted; what was read is kept.
    """
    check(plan, stage.axes(), T_stage_part, technique, mesh=mesh, keep_out=keep_out, head=head)
    T = checked_transform(T_stage_part, "the part's pose on the stage")
    targets, faces = axis_targets(plan, T, len(stage.axes()), head)
    height = travel_height_mm(targets, stage.axes(), technique)
    scan = Scan(plan, stage, instrument, clock, sink, technique, targets, faces, height, clock.now(), progress, head)
    _note_settings(scan, T_stage_part)
    with _always_safe(scan):
        if not stage.is_homed():
            stage.home()
        instrument.configure(technique.drive)
        if technique.scan.mode == "step":
            scan_in_steps(scan)
        else:
            scan_in_rows(scan, technique.scan.mode)


def _note_settings(scan: Scan, T_stage_part: Array) -> None:
    scan.sink.note("T_stage_part", checked_transform(T_stage_part, "the part's pose").tolist())
    scan.sink.note("stage", asdict(scan.stage.identity()))
    scan.sink.note("axes", [asdict(axis) for axis in scan.stage.axes()])
    scan.sink.note("instrument", asdict(scan.instrument.identity()))
    scan.sink.note("scan", scan.technique.scan.model_dump())


@contextlib.contextmanager
def _always_safe(scan: Scan) -> Iterator[None]:
    """Stop the axes and lift the probe whatever ends the scan; the first fault is the one that is told."""
    with ended_by_signals():
        try:
            yield
            lift(scan)
        except BaseException as fault:
            _make_safe(scan, fault)
            raise


def _make_safe(scan: Scan, fault: BaseException) -> None:
    """Stop, lift, and note the end; a second Ctrl-C stops the lifting too."""
    try:
        with contextlib.suppress(Exception):
            scan.stage.stop()
        try:
            lift(scan)
        except Exception:  # the line may have been lost only now: stop opens it again
            with contextlib.suppress(Exception):
                scan.stage.stop()
            try:
                lift(scan)
            except Exception as unlifted:
                fault.add_note(f"The probe could not be lifted: {unlifted} Lift it by hand before anything else moves.")
        with contextlib.suppress(Exception):
            scan.sink.note("event", {"event": "ended early", "why": f"{type(fault).__name__}: {fault}"})
    except BaseException:
        with contextlib.suppress(Exception):
            scan.stage.stop()


def lift(scan: Scan) -> None:
    """Raise the probe to the travelling height, straight up from wherever it is."""
    here = scan.stage.position()
    if here[2] < scan.height_mm:
        scan.stage.move(with_z(here, scan.height_mm))
