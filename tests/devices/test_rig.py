"""rig.toml: keys, text, drivers by name, and the virtual rig opened on its own wires."""

import logging
import tomllib

import numpy as np
import pytest
from pydantic import ValidationError

from eddyscan.core.errors import DeviceError, InputError, LinkError, TechniqueError
from eddyscan.core.technique import Drive
from eddyscan.devices.clock import VirtualClock, WallClock
from eddyscan.devices.protocols import DepthCamera, EddyInstrument, Identity, Stage
from eddyscan.devices.rig import RigSettings, connect, open_rig, rig_text, virtual_rig


class LabProbe:
    """A lab's own driver: no settings model, plain keywords."""

    def __init__(self, address=None, gain=1.0, *, clock):
        self.address, self.gain, self.clock = address, gain, clock

    def identity(self):
        return Identity("probe", "home-made", "7")

    def close(self):
        pass


HERE = f"{__name__}:LabProbe"


def test_text_of_the_virtual_rig_is_read_back_as_the_same_settings():
    rig = virtual_rig("blade", seed=9)
    assert RigSettings.model_validate(tomllib.loads(rig_text(rig))) == rig


def test_text_says_what_each_key_means():
    text = rig_text(virtual_rig())
    assert "[world.camera]" in text
    assert all("#" in line for line in text.splitlines() if line.startswith("noise"))


def test_misspelt_key_is_an_error():
    with pytest.raises(ValidationError, match="conductivty"):
        RigSettings.model_validate({"world": {"conductivty_ms_m": 19.0}})


def test_unknown_part_is_refused_with_those_there_are():
    with pytest.raises(InputError, match=r"block-z.*block-a"):
        virtual_rig("block-z")


@pytest.mark.parametrize(
    ("driver", "message"),
    [
        ("nowhere.drivers:Stage", r"\[stage\] driver = \"nowhere.drivers:Stage\" cannot be loaded"),
        ("eddyscan.devices.drivers.zaber:Nothing", "cannot be loaded.*Nothing"),
        ("eddyscan", "cannot be loaded"),
    ],
)
def test_driver_that_is_not_there(driver, message):
    with pytest.raises(TechniqueError, match=message):
        connect("stage", driver, None, {}, clock=WallClock())


def test_option_the_driver_does_not_know_names_its_keys():
    with pytest.raises(TechniqueError, match=r"\[instrument\].*apperture.*Its keys are address, aperture"):
        connect(
            "instrument",
            "eddyscan.devices.drivers.keysight_e4980a:KeysightE4980A",
            "TCPIP::127.0.0.1::1::SOCKET",
            {"apperture": "MED"},
            clock=WallClock(),
        )


def test_a_labs_own_driver_needs_no_plugin_machinery(caplog):
    settings = RigSettings.model_validate({"instrument": {"driver": HERE, "address": "COM3", "options": {"gain": 4.0}}})
    with caplog.at_level(logging.WARNING), open_rig(settings) as rig:
        device = rig.instrument
        assert (device.address, device.gain) == ("COM3", 4.0)
        assert isinstance(rig.clock, WallClock)
        assert "unverified" in rig.notes[0]
    assert "unverified" in caplog.text


def test_a_rig_without_camera_says_where_views_go():
    with open_rig(RigSettings()) as rig, pytest.raises(TechniqueError, match="1-views"):
        _ = rig.camera


def test_alignment_from_the_file_and_without_one():
    known = RigSettings.model_validate({"alignment": {"x_mm": 1.0, "y_mm": 2.0, "z_mm": 3.0, "yaw_deg": 90.0}})
    with open_rig(known) as rig:
        T, how = rig.alignment()
        assert pytest.approx([1.0, 12.0, 3.0, 1.0]) == T @ [10.0, 0.0, 0.0, 1.0]
        assert "rig.toml" in how
    with open_rig(RigSettings()) as rig, pytest.raises(TechniqueError, match="eddyscan jog"):
        rig.alignment()


def test_virtual_rig_homes_moves_and_reads_through_the_real_libraries():
    settings = virtual_rig("plate", seed=2)
    settings = settings.model_copy(update={"world": settings.world.model_copy(update={"flaws": "none"})})
    with open_rig(settings) as rig:
        assert isinstance(rig.clock, VirtualClock)
        assert isinstance(rig.stage, Stage)
        assert isinstance(rig.instrument, EddyInstrument)
        assert isinstance(rig.camera, DepthCamera)
        assert rig.notes == []
        rig.stage.home()
        rig.instrument.configure(Drive())
        air = rig.instrument.read().impedance_ohm
        T, _ = rig.alignment()
        over = T @ [100.0, 50.0, 30.5, 1.0]
        rig.stage.move(np.array([over[0], over[1], 38.0]))
        rig.stage.move(over[:3])
        metal = rig.instrument.read().impedance_ohm
        assert air.imag - metal.imag > 2.0
        assert metal.real - air.real > 0.2
        log = rig.cell.truth_log()
        assert log["lift_off_mm"][-1] == pytest.approx(0.5, abs=0.9)
        assert len(log["time_s"]) == 2


def quick_world(**changes):
    return RigSettings.model_validate(
        {"world": {"part": "plate", "seed": 2, "flaws": "none", **changes.pop("world", {})}, **changes}
    )


@pytest.mark.parametrize("kind", ["SR830", "SR860"])
def test_a_lock_in_can_stand_in_the_cell(kind):
    driver = {"driver": f"eddyscan.devices.drivers.sr830:{kind}"}
    with open_rig(quick_world(world={"instrument": {"kind": kind}}, instrument=driver)) as rig:
        rig.instrument.configure(Drive(frequency_hz=100e3))
        z = rig.instrument.read().impedance_ohm
        assert rig.instrument.identity().model.endswith(kind)
        assert 6.0 < z.imag < 9.0
        log = rig.cell.truth_log()
        assert log["reactance_ohm"][-1] == pytest.approx(z.imag, rel=1e-6)


def go_along_x(stage):
    for place in 1.0 + 149.0 * (np.arange(2000) % 7) / 6:
        stage.move(np.array([place, 50.0, 38.0]))


def test_a_stall_of_the_world_stops_the_stage_with_a_message():
    faults = {"stage_fault": "stall", "stage_fault_after": 300, "stage_fault_axis": "x"}
    with open_rig(quick_world(world={"faults": faults})) as rig:
        rig.stage.home()
        with pytest.raises(DeviceError, match="axis x reports a stall"):
            go_along_x(rig.stage)


def test_a_lost_instrument_is_a_link_error():
    patience = {"options": {"timeout_s": 1.0}}
    with open_rig(quick_world(world={"faults": {"lcr_link_lost_after": 1}}, instrument=patience)) as rig:
        rig.instrument.configure(Drive())
        rig.instrument.read()
        with pytest.raises(LinkError, match="failed to read"):
            rig.instrument.read()


def test_a_tilt_axis_turns_the_probe_about_its_face():
    settings = virtual_rig("plate", seed=2, tilt_axis="b")
    assert RigSettings.model_validate(tomllib.loads(rig_text(settings))) == settings
    with open_rig(settings) as rig:
        assert [axis.name for axis in rig.stage.axes()] == ["x", "y", "z", "b"]
        rig.stage.home()
        rig.instrument.configure(Drive())
        for angle in (0.0, 12.0):
            rig.stage.move(np.array([100.0, 100.0, 38.0, angle]))
            rig.instrument.read()
        log = rig.cell.truth_log()
        assert log["tilt_deg"][1] - log["tilt_deg"][0] == pytest.approx(12.0, abs=0.8)
        assert log["lift_off_mm"][1] == pytest.approx(log["lift_off_mm"][0], abs=0.2)
