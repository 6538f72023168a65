"""The options of the virtual cell: the [world] table of rig.toml and its sub-tables."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from eddyscan.core.technique import Section


class WorldCamera(Section):
    """Depth camera of the virtual cell: every term of its sensor model by name."""

    views: int = Field(5, ge=1, le=60)
    frames: int = Field(1, ge=1, le=50, description="frames averaged per view")
    stand_off_mm: tuple[float, float] = Field((260.0, 320.0), description="camera to the middle of the part's top, mm")
    tilt_deg: tuple[float, float] = Field((20.0, 50.0), description="camera axis against the vertical, deg")
    roll_deg: float = Field(20.0, ge=0, le=180, description="camera roll, plus and minus, deg")
    range_mm: tuple[float, float] = Field((200.0, 2500.0), description="no return outside, mm")
    baseline_mm: float = Field(50.0, gt=0, description="distance of the two infrared cameras (assumed), mm")
    noise_white_px: float = Field(0.05, ge=0, description="temporal noise per pixel, px of disparity")
    noise_correlated_px: float = Field(0.07, ge=0, description="temporal noise of the matching window, px")
    noise_static_px: float = Field(0.07, ge=0, description="pattern noise, fixed per view, px")
    bias_map_px: float = Field(0.05, ge=0, description="calibration residual, the same in all views, px")
    pixel_locking_px: float = Field(0.02, ge=0, description="sub-pixel non-linearity, px")
    disparity_step_px: float = Field(0.125, ge=0, description="quantisation; 0 = none, px")
    edge_fattening: float = Field(0.38, ge=0, le=1, description="share of edge pixels taken by the foreground")
    edge_flying: float = Field(0.18, ge=0, le=1, description="share of edge pixels between fore- and background")
    edge_lost: float = Field(0.10, ge=0, le=1, description="share of edge pixels without return")
    occlusion_lost: float = Field(0.84, ge=0, le=1, description="share lost where only one camera sees; rest garbage")
    incidence_deg: tuple[float, float] = Field((60.0, 82.0), description="returns fade out between these angles, deg")
    highlight_deg: float = Field(5.0, ge=0, description="metal facing the lamp this closely glares, deg")
    highlight_lost: float = Field(0.38, ge=0, le=1, description="share lost in the glare")
    holes: float = Field(0.01, ge=0, le=0.5, description="share of random holes")
    depth_scale_error: float = Field(0.0, ge=-0.05, le=0.05, description="relative depth error of a bad calibration")
    fiducials: bool = Field(False, description="a printed fiducial sheet lies on the table, infrared image included")


class WorldCoil(Section):
    """The coil as its maker describes it; the real one differs by the instrument's coil_tolerance."""

    inner_radius_mm: float = Field(0.5, gt=0)
    outer_radius_mm: float = Field(1.5, gt=0)
    length_mm: float = Field(1.0, gt=0)
    turns: int = Field(100, ge=1)


class WorldInstrument(Section):
    """Eddy-current instrument of the virtual cell: every imperfection by name."""

    kind: Literal["E4980A", "SR830", "SR860"] = Field("E4980A", description="which one answers; name its driver too")
    series_ohm: float = Field(1000.0, gt=0, description="resistor before the coil of a lock-in, ohm")
    noise: float = Field(1e-4, ge=0, description="white noise of a short reading, relative to the air reactance")
    flicker: float = Field(3e-5, ge=0, description="1/f noise per decade of time, relative to the air reactance")
    drift_k: float = Field(1.0, ge=0, description="temperature swing over the drift period, K")
    drift_period_s: float = Field(1800.0, gt=0, description="period of the temperature swing, s")
    wire_resistance_ohm: float = Field(1.2, ge=0, description="dc resistance of coil and cable, ohm")
    wire_per_k: float = Field(0.0039, ge=0, description="relative change of the wire resistance per K (copper)")
    coil_tolerance: float = Field(
        0.02, ge=0, le=0.2, description="largest error of each of this coil's sizes, relative"
    )
    null_offset_ohm: float = Field(0.05, ge=0, description="residual of the short correction, ohm")
    digits: int = Field(6, ge=3, le=9, description="significant digits of a reading")
    short_s: float = Field(0.0056, ge=0, description="time of a reading with short aperture, s")
    latency_s: float = Field(0.001, ge=0, description="from the end of a reading to its answer on the wire, s")
    overload_ohm: float = Field(1e5, gt=0, description="impedance above which the reading overloads, ohm")


class WorldStage(Section):
    """The Zaber stage of the virtual cell."""

    layout: Literal["chain", "mcc"] = Field("chain", description="one device per axis, or one controller with all axes")
    firmware: Literal["7.38", "6.28"] = "7.38"
    tilt_axis: Literal["none", "a", "b"] = Field(
        "none", description="a turns the probe about the stage's x, b about y; the coil face stays where x, y, z say"
    )
    reply_delay_s: float = Field(0.001, ge=0, description="time of one answer; a serial line has 0.0043, s")


class WorldPlacement(Section):
    """How the part lies in the cell and how well the operator finds it."""

    yaw_deg: float = Field(0.8, ge=0, le=5, description="largest yaw of the part on the stage, deg")
    lean_deg: float = Field(0.15, ge=0, le=2, description="largest lean of the part on the stage, deg")
    probe_tilt_deg: float = Field(0.2, ge=0, le=5, description="largest mounting tilt of the probe, deg")
    alignment: Literal["corner", "rough", "exact"] = Field("corner", description="what the operator's jog leaves")
    corner_error_mm: float = Field(0.2, ge=0, description="jog to the corner: standard deviation, mm")
    corner_error_deg: float = Field(0.1, ge=0, description="jog to the corner: standard deviation, deg")
    rough_error_mm: float = Field(3.0, ge=0, description="rough placing by eye: largest error per axis, mm")
    rough_error_deg: float = Field(3.0, ge=0, description="rough placing by eye: largest yaw error, deg")


class WorldReference(Section):
    """Reference block beside the part: flat, of the part's metal, eroded notches across it."""

    present: bool = True
    corner_mm: tuple[float, float, float] = Field((30.0, 3.0, 12.0), description="corner of its top [mm, stage]")
    size_mm: tuple[float, float] = Field((80.0, 16.0), description="along x, along y, mm")
    notch_depths_mm: tuple[float, ...] = Field((0.2, 0.5, 1.0), description="evenly spread along x, mm")
    notch_length_mm: float = Field(5.0, gt=0, description="across the block, mm")
    notch_opening_mm: float = Field(0.1, gt=0)
    place_error_mm: float = Field(0.03, ge=0, description="standard deviation of where it is screwed down, mm")


class WorldFlaw(Section):
    """One surface slot at a place of the part's own frame."""

    x_mm: float
    y_mm: float
    angle_deg: float = Field(0.0, description="long axis against the part's x, in the surface, deg")
    length_mm: float = Field(gt=0)
    depth_mm: float = Field(gt=0)
    opening_mm: float = Field(0.1, gt=0)
    profile: Literal["rectangular", "semi-elliptic"] = "rectangular"


class WorldFaults(Section):
    """Things that go wrong on purpose; a count or time of 0 means never."""

    lcr_link_lost_after: int = Field(0, ge=0, description="instrument closes its link after this many readings")
    lcr_silent_after: int = Field(0, ge=0, description="instrument stops answering after this many readings")
    lcr_overload_every: int = Field(0, ge=0, description="every so many readings one overloads")
    stage_fault: Literal["none", "drop-link", "delay", "garble", "silence", "stall", "driver-off", "power-cycle"] = (
        Field("none", description="what the stage controller does once")
    )
    stage_fault_after: int = Field(0, ge=0, description="after this many commands")
    stage_fault_axis: Literal["x", "y", "z"] = "x"
    part_shift_after: int = Field(0, ge=0, description="the part is knocked after this many readings")
    part_shift_mm: tuple[float, float, float] = Field((0.8, -0.5, 0.0), description="by how much, mm")


class WorldSettings(Section):
    """The virtual cell: what it holds and how honest its devices are."""

    part: str = "block-a"
    seed: int = Field(1, ge=0, description="draws poses, flaws and noise")
    time_factor: float = Field(
        0.0,
        ge=0,
        le=1000,
        description="the cell's clock against the wall's, 0: as fast as it computes; row and pvt need 0, or 5 or less",
    )
    conductivity_ms_m: float = Field(19.0, gt=0.1, le=65.0, description="of the part, MS/m")
    clutter: int = Field(4, ge=0, le=12, description="other objects on the table")
    mesh_edge_mm: float = Field(0.5, gt=0.05, le=5, description="facets the camera sees, mm")
    flaws: Literal["default", "none", "listed"] = Field("default", description="listed: [[world.slots]] only")
    slots: tuple[WorldFlaw, ...] = ()
    camera: WorldCamera = WorldCamera()
    coil: WorldCoil = WorldCoil()
    instrument: WorldInstrument = WorldInstrument()
    stage: WorldStage = WorldStage()
    placement: WorldPlacement = WorldPlacement()
    reference: WorldReference = WorldReference()
    faults: WorldFaults = WorldFaults()
