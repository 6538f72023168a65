"""The written procedure: what `technique.toml` fixes, checked key by key.

A misspelt key is an error. Every field states its unit and limits, so the
reference page can be generated from these models.
"""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

Machine = Literal["xyz", "xyz-tilt", "pose"]
Strategy = Literal["adaptive", "grid", "encircle", "geodesic"]


class Section(BaseModel):
    """A table of a settings file: frozen, unknown keys refused."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Procedure(Section):
    """Who inspects by which document; copied into the report."""

    number: str = "not stated"
    revision: str = "-"
    standard: str = "ISO 15549"
    acceptance_class: str = "not stated"
    customer: str = "not stated"
    operator: str = "not stated"
    operator_level: str = "not stated"
    reviewer: str = "not stated"
    reference_block: str = Field("not stated", description="its number and notches")
    instrument_calibration_due: str = "not stated"
    place: str = "not stated"


class Part(Section):
    """The part under test."""

    name: str = "block-a"
    nominal: str | None = Field(None, description="named part or mesh file to compare with; none: no comparison")
    serial: str = "not stated"
    drawing: str = "not stated"
    material: str = "aluminium alloy"
    heat_treatment: str = "not stated"
    coating: str = "not stated"
    conductivity_ms_m: float = Field(19.0, gt=0.1, le=65.0, description="MS/m; copper is 58")


class Crop(Section):
    """Manual crop and rotation, the study's way; limits [mm] in the aligned part frame."""

    x_mm: tuple[float, float] | None = None
    y_mm: tuple[float, float] | None = None
    z_mm: tuple[float, float] | None = None
    rotate_xyz_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)


class Surface(Section):
    """From views to the surface."""

    method: Literal["auto", "study"] = "auto"
    poisson_depth: int = Field(5, ge=2, le=10)
    grid_mm: float = Field(1.0, gt=0.05, le=20.0, description="edge length of the delivered mesh")
    range_min_mm: float = Field(200.0, ge=0)
    range_max_mm: float = Field(600.0, gt=0)
    crop: Crop | None = None

    @model_validator(mode="after")
    def _ordered(self) -> Surface:
        if self.range_max_mm <= self.range_min_mm:
            raise ValueError(f"range_max_mm {self.range_max_mm} must exceed range_min_mm {self.range_min_mm}")
        return self


class Probe(Section):
    """Coil and tip. The coil face lies in the tip plane (flat) or touches its apex from inside (ball)."""

    name: str = "pencil 3 mm"
    serial: str = "not stated"
    calibration_due: str = "not stated"
    inner_radius_mm: float = Field(0.5, gt=0)
    outer_radius_mm: float = Field(1.5, gt=0)
    length_mm: float = Field(1.0, gt=0)
    turns: int = Field(100, ge=1)
    tip: Literal["flat", "ball"] = "ball"
    tip_radius_mm: float = Field(1.6, gt=0, description="face radius of a flat tip, sphere radius of a ball tip")
    stem_length_mm: float = Field(10.0, ge=0, description="stem of the tip's radius between tip and body")
    body_radius_mm: float = Field(4.0, gt=0, description="cylinder behind the stem")
    body_length_mm: float = Field(40.0, gt=0)

    @model_validator(mode="after")
    def _radii(self) -> Probe:
        if self.inner_radius_mm >= self.outer_radius_mm:
            raise ValueError(
                f"inner_radius_mm {self.inner_radius_mm} must be below outer_radius_mm {self.outer_radius_mm}"
            )
        return self


class Drive(Section):
    """The instrument's operating point."""

    frequency_hz: float = Field(500e3, gt=0, le=20e6)
    level_v: float = Field(1.0, gt=0, le=20.0)


class Plan(Section):
    """Rows and points on the surface."""

    strategy: Strategy = "geodesic"
    machine: Machine = "xyz"
    pitch_mm: float = Field(5.0, gt=0, description="row distance on the surface")
    step_mm: float = Field(5.0, gt=0, description="point distance along a row, on the surface")
    margin_mm: float = Field(3.0, ge=0, description="distance kept from the surface's edge, on the surface")
    density: Literal["constant", "adaptive"] = "constant"
    chord_error_mm: float = Field(0.05, gt=0, description="bound for density = adaptive")
    tilt_max_deg: float = Field(80.0, gt=0, le=85, description="steepest slope for a vertical probe (machine xyz)")
    coverage_min: float = Field(0.95, ge=0, le=1, description="least swept coverage of the region inside the margin")
    regions_mm: tuple[tuple[tuple[float, float], ...], ...] = Field(
        (), description="outlines of what to scan, (x, y) corners in the part frame; none: all"
    )

    @model_validator(mode="after")
    def _outlines(self) -> Plan:
        for number, outline in enumerate(self.regions_mm):
            if len(outline) < 3:
                raise ValueError(f"regions_mm[{number}] has {len(outline)} corners, an outline needs at least 3")
        return self


class Scan(Section):
    """Motion and reading."""

    mode: Literal["step", "row", "pvt"] = "step"
    alignment: Literal["field", "corner"] = Field(
        "field",
        description="field: the coil finds the part from the operator's rough corner; corner: the corner holds",
    )
    passes: Literal[1, 2] = Field(2, description="2: a coarse pass maps the lift-off, the fine one runs corrected")
    coarse_lift_off_mm: float = Field(
        0.2, ge=0, le=5, description="how much higher than the fine pass the coarse one runs"
    )
    coarse_pitch_mm: float = Field(
        5.0, gt=0, description="row and point distance of the coarse pass, not below the plan's"
    )
    lift_off_mm: float = Field(0.5, gt=0, le=10, description="coil to surface, along the normal")
    speed_mm_s: float = Field(25.0, gt=0, le=500, description="probe speed along the surface")
    approach_speed_mm_s: float = Field(5.0, gt=0, le=100)
    clearance_mm: float = Field(5.0, gt=0, description="height above the surface for links")
    settle_s: float = Field(0.05, ge=0, le=10, description="wait between arrival and reading")
    position_tolerance_mm: float = Field(0.05, gt=0)
    watch_rows: int = Field(10, ge=0, description="rows after which a reference point is read again; 0: never")
    watch_limit_mm: float = Field(0.15, gt=0, description="change there, as lift-off, that means the part moved")


class Analysis(Section):
    """Signals and calls."""

    lift_off_max_mm: float = Field(1.5, gt=0, description="beyond this a spot is not covered")
    threshold_mad: float = Field(6.0, gt=0, description="call level in robust standard deviations of the residual")


class Technique(Section):
    """The whole of technique.toml."""

    procedure: Procedure = Procedure()
    part: Part = Part()
    surface: Surface = Surface()
    probe: Probe = Probe()
    drive: Drive = Drive()
    plan: Plan = Plan()
    scan: Scan = Scan()
    analysis: Analysis = Analysis()
