"""One `full` case: a whole inspection in the virtual cell, camera to report."""

from __future__ import annotations

import shutil
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel, ValidationError

from eddyscan.campaign.design import Column
from eddyscan.core.commented_toml import commented_toml
from eddyscan.core.errors import EddyscanError, TechniqueError
from eddyscan.core.technique import Technique
from eddyscan.devices.sim.world_settings import WorldSettings

TECHNIQUE, WORLD = "technique.", "world."
SEEDS = 2**31 - 1


def full_names() -> set[str]:
    """Return every key of technique.toml and of rig.toml's [world] that holds one value."""
    return {TECHNIQUE + name for name in _leaves(Technique())} | {WORLD + name for name in _leaves(WorldSettings())}


def full_cases(columns: Mapping[str, Column], seeds: Sequence[int], n: int) -> list[dict[str, Any]]:
    """Return one checked mapping per case; raises TechniqueError naming the first impossible one."""
    cases = []
    for k in range(n):
        given = {name: _plain(column[k]) for name, column in columns.items()}
        for prefix, base in ((TECHNIQUE, Technique()), (WORLD, WorldSettings())):
            _changed(base, prefix, given, k)
        cases.append({"case": k, "seed": seeds[k], **given})
    return cases


def run_full_cases(shared: tuple[Technique, str], cases: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return one row per case; an inspection that fails gives its error instead of figures."""
    return [_run(shared[0], case) for case in cases]


def _run(base: Technique, case: Mapping[str, Any]) -> dict[str, Any]:
    from eddyscan import pipeline
    from eddyscan.devices.rig import RigSettings, rig_text

    began, folder = time.perf_counter(), Path(tempfile.mkdtemp(prefix="eddyscan-case-"))
    number = int(case["case"])
    world = _changed(WorldSettings(seed=int(case["seed"]) % SEEDS), WORLD, case, number)
    technique = _changed(base, TECHNIQUE, case, number)
    part = technique.part.model_copy(update={"name": world.part, "nominal": world.part})
    try:
        inspection = pipeline.new_inspection(folder / "case", part=world.part)
        technique_text = commented_toml(technique.model_copy(update={"part": part}))
        inspection.technique_file.write_text(technique_text, encoding="utf-8")
        inspection.rig_file.write_text(rig_text(RigSettings(world=world)), encoding="utf-8")
        figures = _figures(pipeline.run(inspection.folder))
    except EddyscanError as error:
        figures = {"error": f"{type(error).__name__}: {error}"}
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    return dict(case) | _EMPTY | figures | {"seconds": round(time.perf_counter() - began, 2)}


_EMPTY: dict[str, Any] = {
    "error": "",
    "coverage": None,
    "surface_rmse_mm": None,
    "surface_own_mean_mm": None,
    "lift_off_mean_mm": None,
    "lift_off_sd_mm": None,
    "found": None,
    "flaws": None,
    "false_calls": None,
}


def _figures(summary: Mapping[str, Any]) -> dict[str, Any]:
    truth = summary["truth"]
    return {
        "coverage": summary["coverage"],
        "surface_rmse_mm": truth["surface"]["fit"]["rmse_mm"],
        "surface_own_mean_mm": truth["surface"]["own"]["mean_abs_mm"],
        "lift_off_mean_mm": truth["path"]["lift_off_mm"]["mean"],
        "lift_off_sd_mm": truth["path"]["lift_off_mm"]["sd"],
        "found": truth["indications"]["found"],
        "flaws": truth["indications"]["flaws"],
        "false_calls": truth["indications"]["false_calls"],
    }


def _changed(base: Any, prefix: str, given: Mapping[str, Any], case: int) -> Any:
    """Return `base` with the values whose names begin with `prefix`."""
    data = base.model_dump()
    for name, value in given.items():
        if name.startswith(prefix):
            *tables, key = name.removeprefix(prefix).split(".")
            place = data
            for table in tables:
                place = place[table]
            place[key] = value
    try:
        return type(base).model_validate(data)
    except ValidationError as error:
        fault = error.errors()[0]
        name = prefix + ".".join(str(part) for part in fault["loc"])
        raise TechniqueError(
            f"case {case} is impossible: {name} = {fault['input']!r}: {fault['msg']}. Narrow vary.{name}."
        ) from None


def _leaves(model: BaseModel, path: str = "") -> set[str]:
    names = set()
    for name in type(model).model_fields:
        value = getattr(model, name)
        if isinstance(value, BaseModel):
            names |= _leaves(value, f"{path}{name}.")
        elif isinstance(value, (str, int, float)):
            names.add(path + name)
    return names


def _plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value
