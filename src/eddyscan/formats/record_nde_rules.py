"""The rules of .nde 4.3 for eddy-current files, as a JSON schema of our own words.

A file that keeps these keeps the published Setup and Properties schemas: required
tables, no unknown keys, ids >= 0, two dimensions [Channel, AcquisitionCycle] for
impedances, one encoder dataset or more per mapping, a wedge for every probe.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

ID = {"type": "integer", "minimum": 0}
NAME = {"type": "string", "minLength": 1}
NUMBER = {"type": "number"}
COUNT = {"type": "integer", "minimum": 1}
POSITIVE = {"type": "number", "exclusiveMinimum": 0}
VERSIONS = {"enum": ["4.0.0", "4.1.0", "4.2.0", "4.3.0"]}


def table(required: Mapping[str, Any], optional: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Return the schema of an object that has these keys and no others."""
    return {
        "type": "object",
        "properties": {**required, **(optional or {})},
        "required": list(required),
        "additionalProperties": False,
    }


def many(items: Mapping[str, Any], least: int = 1) -> dict[str, Any]:
    """Return the schema of a list."""
    return {"type": "array", "items": dict(items), "minItems": least}


def exactly(*items: Mapping[str, Any]) -> dict[str, Any]:
    """Return the schema of a list with these entries in this order."""
    return {"type": "array", "items": list(items), "minItems": len(items), "maxItems": len(items)}


SPAN = table({"min": NUMBER, "max": NUMBER, "unitMin": NUMBER, "unitMax": NUMBER, "unit": {"type": "string"}})
CYCLES = table({"axis": {"const": "AcquisitionCycle"}, "quantity": COUNT}, {"lastCellRewrited": ID})
CHANNEL_AND_CYCLES = exactly(table({"axis": {"const": "Channel"}, "quantity": COUNT}), CYCLES)
COMMON = {"id": ID, "name": NAME, "path": {"type": "string"}}
IMPEDANCE = table(
    {"dimensions": CHANNEL_AND_CYCLES, "dataValue": SPAN}, {**COMMON, "dataClass": {"const": "Impedance"}}
)
STATUS_VALUE = table({"unit": {"const": "Bitfield"}}, {"hasData": COUNT, "saturated": COUNT})
STATUS = table(
    {"dimensions": CHANNEL_AND_CYCLES, "dataValue": STATUS_VALUE}, {**COMMON, "dataClass": {"const": "ImpedanceStatus"}}
)
ENCODER_CYCLES = table(
    {"axis": {"const": "AcquisitionCycle"}, "quantity": COUNT, "motionDeviceId": ID}, {"lastCellRewrited": ID}
)
ENCODER = table(
    {"dimensions": exactly(ENCODER_CYCLES), "dataValue": SPAN}, {**COMMON, "dataClass": {"const": "Encoder"}}
)
CHANNELS = many(table({"id": ID, "sensorId": ID}, {"inputId": ID, "timeslot": ID}))
EDDY_CURRENT = table(
    {
        "channels": CHANNELS,
        "probeId": ID,
        "sensorGroupId": ID,
        "driveAmplitude": {"type": "number", "minimum": 0},
        "frequency": {"type": "number", "minimum": 0},
    },
    {"gain": NUMBER},
)
OUTPUT = table({"id": ID}, {"datasetId": ID, "dataClass": {"enum": ["Impedance", "ImpedanceStatus"]}})
PROCESS = table(
    {
        "id": ID,
        "inputs": {"type": "array", "maxItems": 0},
        "outputs": many(OUTPUT, 0),
        "dataMappingId": ID,
        "implementation": {"const": "Hardware"},
        "eddyCurrent": EDDY_CURRENT,
    }
)
GROUP = table(
    {"id": ID},
    {"name": NAME, "usage": NAME, "datasets": many({"anyOf": [IMPEDANCE, STATUS]}, 0), "processes": many(PROCESS, 0)},
)
MAPPING = table(
    {"id": ID, "specimenId": ID, "surfaceId": ID, "allCycle": table({}, {"datasets": many(ENCODER)})},
)
SENSOR = {
    "type": "object",
    "properties": {"id": ID, "primaryOffset": NUMBER, "secondaryOffset": NUMBER, "acquisitionUnitId": ID},
    "required": ["id", "primaryOffset", "secondaryOffset", "acquisitionUnitId"],
}
ORIENTATION = {"enum": ["Normal", "Reverse", "FlipPrimary", "FlipSecondary"]}
PROBE = table(
    {
        "id": ID,
        "eddyCurrentProbe": table({"sensorGroups": many(table({"id": ID, "name": NAME, "sensors": many(SENSOR)}))}),
        "wedgeAssociation": table({"wedgeId": ID, "orientation": ORIENTATION}),
    },
    {"model": NAME, "serialNumber": NAME},
)
PLACE = table(
    {"specimenId": ID, "surfaceId": ID, "uCoordinateOffset": NUMBER, "vCoordinateOffset": NUMBER, "skewAngle": NUMBER}
)
WEDGE = table({"id": ID, "model": NAME, "positioning": PLACE}, {"serie": NAME, "serialNumber": NAME})
SPECIMEN = table({"id": ID, "unspecifiedGeometry": table({"surfaces": exactly(table({"id": ID}))})})
UNIT = table(
    {"id": ID, "platform": NAME, "model": NAME, "acquisitionRate": POSITIVE}, {"serialNumber": NAME, "name": NAME}
)
ENCODER_DEVICE = table(
    {"mode": {"enum": ["Quadrature", "ClockDir", "PulseUp", "PulseDown", "Tach", "Index"]}, "stepResolution": POSITIVE},
    {"serialNumber": NAME, "preset": NUMBER, "inverted": {"type": "boolean"}, "unit": {"enum": ["StepPerMeter"]}},
)
MOTION = table({"id": ID, "encoder": ENCODER_DEVICE}, {"name": NAME})
SETUP = table(
    {
        "$schema": NAME,
        "version": VERSIONS,
        "scenario": {"enum": ["General Weld", "General Mapping"]},
        "groups": many(GROUP),
    },
    {
        "dataMappings": many(MAPPING),
        "specimens": many(SPECIMEN),
        "probes": many(PROBE),
        "wedges": many(WEDGE),
        "acquisitionUnits": many(UNIT),
        "motionDevices": many(MOTION),
    },
)
FILE = table(
    {"creationDate": {"type": "string", "pattern": r"^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d"}, "formatVersion": VERSIONS},
    dict.fromkeys(
        ("createdByAppName", "createdByAppVersion", "createdByAppCompany", "creationFormatVersion", "description"), NAME
    ),
)
PROPERTIES = {
    **table({"$schema": NAME, "file": FILE, "methods": many({"enum": ["ET", "UT"]})}),
    "additionalProperties": True,
}
RULES = {"/Setup": SETUP, "/Public/Setup": SETUP, "/Properties": PROPERTIES}


def broken_rules(name: str, value: Mapping[str, Any]) -> list[str]:
    """Return what a table breaks, each as "place: what"; empty when it keeps every rule."""
    from jsonschema import Draft7Validator

    faults = Draft7Validator(RULES[name]).iter_errors(dict(value))
    return [
        f"{'/'.join(str(step) for step in fault.absolute_path) or 'top'}: {fault.message[:200]}" for fault in faults
    ]
