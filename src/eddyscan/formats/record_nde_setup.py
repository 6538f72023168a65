"""The Setup and Properties tables of a .nde 4.3 file for a coil moved freely over a part.

Names and rules follow the published schemas Setup-Schema-4.3.0 and
Properties-Schema-4.3.0 of the NDE Open File Format (MIT). Lengths are in metres.
A probe must have a wedge, so the bare coil gets one called "none".
"""

from __future__ import annotations

import math
from datetime import datetime
from typing import Any

import numpy as np

from eddyscan.core.frames import Array, ComplexArray
from eddyscan.core.record import ScanRecord

VERSION = "4.3.0"
SCHEMAS = "https://github.com/Evident-Industrial/NDE_Open_File_Format/blob/main/schemas"
SETUP_SCHEMA = f"{SCHEMAS}/Setup-Schema-{VERSION}.json"
PROPERTIES_SCHEMA = f"{SCHEMAS}/Properties-Schema-{VERSION}.json"
AXES = ("x", "y", "z")
HAS_DATA, SATURATED = 1, 2
STEPS_PER_METRE_UNKNOWN = 1e6


def properties(created: datetime, software_version: str, remark: str) -> dict[str, Any]:
    """Return the Properties table."""
    return {
        "$schema": PROPERTIES_SCHEMA,
        "file": {
            "createdByAppName": "eddyscan",
            "createdByAppVersion": software_version,
            "creationDate": created.isoformat(),
            "creationFormatVersion": VERSION,
            "formatVersion": VERSION,
            "description": remark,
        },
        "methods": ["ET"],
    }


def setup(record: ScanRecord, groups: list[tuple[float, ComplexArray]]) -> dict[str, Any]:
    """Return the Setup table.

    Parameters
    ----------
    record : for devices, probe and rate
    groups : (frequency [Hz], impedances [ohm]) per drive frequency
    """
    entries = [_group(k, frequency, z, drive_peak_v(record)) for k, (frequency, z) in enumerate(groups)]
    positions = 1e-3 * record.stage_mm
    return {
        "$schema": SETUP_SCHEMA,
        "version": VERSION,
        "scenario": "General Mapping",
        "groups": entries,
        "dataMappings": [_mapping(k, len(z), positions) for k, (_, z) in enumerate(groups)],
        "specimens": [{"id": 0, "unspecifiedGeometry": {"surfaces": [{"id": 0}]}}],
        "probes": [_probe(record)],
        "wedges": [{"id": 0, "model": "none", "positioning": _nowhere()}],
        "acquisitionUnits": [_acquisition_unit(record)],
        "motionDevices": [_motion_device(record, k) for k in range(3)],
    }


def dataset_path(group: int, name: str) -> str:
    """Return where a dataset of a group lives in the file."""
    return f"/Public/Groups/{group}/Datasets/{name}"


def _nowhere() -> dict[str, Any]:
    return {"specimenId": 0, "surfaceId": 0, "uCoordinateOffset": 0.0, "vCoordinateOffset": 0.0, "skewAngle": 0.0}


def _span(values: Array, unit: str) -> dict[str, Any]:
    """Return a dataValue that maps stored numbers to themselves."""
    known = values[np.isfinite(values)]
    low, high = (float(known.min()), float(known.max())) if known.size else (0.0, 1.0)
    return {"min": low, "max": high, "unitMin": low, "unitMax": high, "unit": unit}


def _group(k: int, frequency_hz: float, impedance_ohm: ComplexArray, drive_v: float) -> dict[str, Any]:
    dimensions = [{"axis": "Channel", "quantity": 1}, {"axis": "AcquisitionCycle", "quantity": len(impedance_ohm)}]
    parts = np.concatenate([impedance_ohm.real, impedance_ohm.imag])
    outputs = [
        {"id": 0, "datasetId": 0, "dataClass": "Impedance"},
        {"id": 1, "datasetId": 1, "dataClass": "ImpedanceStatus"},
    ]
    return {
        "id": k,
        "name": f"{frequency_hz:g} Hz",
        "datasets": [
            {
                "id": 0,
                "name": "impedance as read",
                "dataClass": "Impedance",
                "dataValue": _span(parts, "Ohm"),
                "path": dataset_path(k, "0-Impedance"),
                "dimensions": dimensions,
            },
            {
                "id": 1,
                "name": "status",
                "dataClass": "ImpedanceStatus",
                "dataValue": {"unit": "Bitfield", "hasData": HAS_DATA, "saturated": SATURATED},
                "path": dataset_path(k, "1-ImpedanceStatus"),
                "dimensions": dimensions,
            },
        ],
        "processes": [
            {
                "id": 0,
                "inputs": [],
                "outputs": outputs,
                "dataMappingId": k,
                "implementation": "Hardware",
                "eddyCurrent": {
                    "probeId": 0,
                    "sensorGroupId": 0,
                    "driveAmplitude": drive_v,
                    "frequency": frequency_hz,
                    "channels": [{"id": 0, "sensorId": 0, "inputId": 0, "timeslot": 0}],
                },
            }
        ],
    }


def _mapping(k: int, cycles: int, positions_m: Array) -> dict[str, Any]:
    datasets = [
        {
            "id": axis,
            "name": f"{AXES[axis]} axis reading",
            "dataClass": "Encoder",
            "dataValue": _span(positions_m[:, axis], "Meter"),
            "path": dataset_path(k, f"{2 + axis}-Encoder"),
            "dimensions": [{"axis": "AcquisitionCycle", "quantity": cycles, "motionDeviceId": axis}],
        }
        for axis in range(3)
    ]
    return {"id": k, "specimenId": 0, "surfaceId": 0, "allCycle": {"datasets": datasets}}


def _probe(record: ScanRecord) -> dict[str, Any]:
    probe = _technique(record, "probe")
    sensor = {"id": 0, "primaryOffset": 0.0, "secondaryOffset": 0.0, "acquisitionUnitId": 0}
    entry: dict[str, Any] = {
        "id": 0,
        "model": str(probe.get("name") or "not stated"),
        "eddyCurrentProbe": {"sensorGroups": [{"id": 0, "name": "coil", "sensors": [sensor]}]},
        "wedgeAssociation": {"wedgeId": 0, "orientation": "Normal"},
    }
    if probe.get("serial"):
        entry["serialNumber"] = str(probe["serial"])
    return entry


def _acquisition_unit(record: ScanRecord) -> dict[str, Any]:
    instrument = record.meta.get("instrument") or {}
    duration = float(np.ptp(record.time_s)) if len(record) > 1 else 0.0
    entry: dict[str, Any] = {
        "id": 0,
        "platform": str(instrument.get("kind") or "not stated"),
        "model": str(instrument.get("model") or "not stated"),
        "acquisitionRate": (len(record) - 1) / duration if duration > 0 else 1.0,
    }
    if instrument.get("serial"):
        entry["serialNumber"] = str(instrument["serial"])
    return entry


def _motion_device(record: ScanRecord, axis: int) -> dict[str, Any]:
    axes = record.meta.get("axes") or []
    resolution_mm = float(axes[axis].get("resolution", 0.0)) if axis < len(axes) else 0.0
    steps_per_metre = 1000.0 / resolution_mm if resolution_mm > 0 else STEPS_PER_METRE_UNKNOWN
    encoder = {"mode": "Quadrature", "stepResolution": steps_per_metre, "unit": "StepPerMeter"}
    return {"id": axis, "name": f"{AXES[axis]} axis", "encoder": encoder}


def drive_peak_v(record: ScanRecord) -> float:
    """Return the drive's peak voltage as the format wants it, 0 when the record does not state it.

    Impedance meters state rms: peak = sqrt(2) rms.
    """
    return math.sqrt(2.0) * float(_technique(record, "drive").get("level_v", 0.0))


def _technique(record: ScanRecord, table: str) -> dict[str, Any]:
    return dict((record.meta.get("technique") or {}).get(table) or {})
