"""Records and C-scans for the tests of record files: numbers by formula and seed."""

from __future__ import annotations

import numpy as np

from eddyscan.core.cscan import CScan
from eddyscan.core.frames import apply, rotation_about_z, transform
from eddyscan.core.mesh import SurfaceMesh
from eddyscan.core.parts import named_part
from eddyscan.core.record import ScanRecord
from eddyscan.core.technique import Technique


def a_record(readings: int = 12, seed: int = 7, frequencies_hz: tuple[float, ...] = (5e5,)) -> ScanRecord:
    rng = np.random.default_rng(seed)
    T_stage_part = transform(rotation_about_z(12.5), (11.0, -3.0, 7.0))
    stage = apply(T_stage_part, rng.uniform(0, 100, (readings, 3)))
    z = np.empty(readings, dtype=np.complex128)
    z.real, z.imag = rng.normal(2, 0.1, readings), rng.normal(40, 0.1, readings)
    return ScanRecord(
        row=np.arange(readings) // 4,
        point=np.arange(readings) % 4,
        time_s=np.sort(rng.uniform(0, 60, readings)),
        stage_mm=stage,
        target_mm=stage + rng.normal(0, 0.002, stage.shape),
        frequency_hz=np.resize(np.array(frequencies_hz), readings),
        impedance_ohm=z,
        flag=rng.integers(0, 3, readings),
        meta={
            "T_stage_part": T_stage_part.tolist(),
            "technique": Technique().model_dump(mode="json"),
            "instrument": {"kind": "instrument", "model": "E4980A", "serial": "MY1", "firmware": "A"},
            "axes": [{"name": name, "resolution": 1e-4} for name in "xyz"],
            "events": [{"what": "pause"}],
        },
    )


def a_cscan(*, uncertain: bool = True) -> CScan:
    top = named_part("block-a").top_mesh(10.0)
    rng = np.random.default_rng(4)
    n = len(top.vertices)
    mesh = SurfaceMesh(top.vertices, top.faces, top.normals, rng.uniform(0, 0.1, n) if uncertain else None)
    covered = rng.uniform(size=n) > 0.2
    lift = np.where(covered, rng.normal(0.5, 0.01, n), np.nan)
    return CScan(mesh, covered, {"lift_off_mm": lift, "residual_ohm": rng.normal(size=n)})


def assert_same_readings(given: ScanRecord, back: ScanRecord) -> None:
    for name in ("row", "point", "time_s", "stage_mm", "frequency_hz", "flag"):
        np.testing.assert_array_equal(getattr(back, name), getattr(given, name), err_msg=name)
    np.testing.assert_array_equal(back.impedance_ohm.real, given.impedance_ohm.real)
    np.testing.assert_array_equal(back.impedance_ohm.imag, given.impedance_ohm.imag)
