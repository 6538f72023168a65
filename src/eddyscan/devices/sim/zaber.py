"""A simulated Zaber controller: the vendor's ASCII protocol on a loopback TCP port."""

from __future__ import annotations

import contextlib
import socket
import threading
from dataclasses import dataclass

import numpy as np

from eddyscan.core.errors import DeviceError, InputError
from eddyscan.core.frames import Array
from eddyscan.devices.clock import ScaledClock
from eddyscan.devices.protocols import Clock
from eddyscan.devices.sim.zaber_axis import AxisState
from eddyscan.devices.sim.zaber_device import Device
from eddyscan.devices.sim.zaber_faults import Fault, FaultPlan, garbled
from eddyscan.devices.sim.zaber_settings import STUDY_AXES, ZaberSettings
from eddyscan.devices.sim.zaber_wire import alert, parse, reply

__all__ = ["STUDY_AXES", "Fault", "ZaberSimulator", "serve_zaber"]

ALERT_LOOK_S = 0.002
REQUEST_SHARE = 0.4  # of the round trip at 115200 baud: 20 bytes out, 29 bytes back


@dataclass
class _Peer:
    """One connection and the lock that keeps its lines whole."""

    sock: socket.socket
    lock: threading.Lock

    def send(self, data: bytes) -> None:
        with self.lock, contextlib.suppress(OSError):
            self.sock.sendall(data)


class ZaberSimulator:
    """A chain of single-axis devices, or one multi-axis controller.

    Parameters
    ----------
    settings : ZaberSettings
    clock : Clock
        Motion runs in this clock's time; every answer takes `reply_delay_s` of it.
    """

    def __init__(self, settings: ZaberSettings, clock: Clock) -> None:
        self.settings, self.clock = settings, clock
        rng = np.random.default_rng(settings.seed)
        self.axes = [AxisState(model, settings.guessed, rng) for model in settings.axes]
        if settings.layout == "chain":
            self.devices = [Device(number, [axis], settings) for number, axis in enumerate(self.axes, 1)]
        else:
            self.devices = [Device(1, self.axes, settings)]
        self.faults = FaultPlan()
        self.commands_seen = 0
        self._lock = threading.RLock()
        self._peers: list[_Peer] = []
        self._server: socket.socket | None = None
        self._closing = threading.Event()

    # -- what the world asks -------------------------------------------------

    def true_position(self) -> Array:
        """Return the hidden true axis readings (n_axes,) [mm or deg, stage] at this moment."""
        with self._lock:
            now = self.clock.now()
            self._update(now)
            return np.array([axis.true_reading(now) for axis in self.axes])

    def moving(self) -> bool:
        """Return whether any axis moves at this moment."""
        with self._lock:
            now = self.clock.now()
            self._update(now)
            return any(axis.busy for axis in self.axes)

    def inject(self, fault: Fault) -> None:
        """Arm a fault; it acts once, after `fault.after` more commands."""
        names = [axis.model.name for axis in self.axes]
        if fault.axis not in names:
            raise InputError(f"the simulated stage has no axis {fault.axis!r}; it has {', '.join(names)}.")
        with self._lock:
            self.faults.add(fault)

    # -- the wire --------------------------------------------------------------

    def start(self, port: int = 0) -> tuple[str, int]:
        """Listen on `port` (0: any free one); return (host, port)."""
        try:
            server = socket.create_server((self.settings.host, port))
        except OSError as fault:
            raise DeviceError(
                f"the simulated stage cannot listen on {self.settings.host}:{port}: {fault}. Give another port."
            ) from fault
        self._server = server
        threading.Thread(target=self._accept, args=(server,), name="zaber-simulator", daemon=True).start()
        threading.Thread(target=self._watch_for_rest, name="zaber-alerts", daemon=True).start()
        host, bound = server.getsockname()[:2]
        return str(host), int(bound)

    def close(self) -> None:
        """Stop listening and drop every connection."""
        self._closing.set()
        if self._server is not None:
            with contextlib.suppress(OSError):
                self._server.shutdown(socket.SHUT_RDWR)  # wakes the thread that accepts
            self._server.close()
        self._drop_link()

    def answer(self, line: bytes) -> list[bytes]:
        """Return the answers to one line as it arrives now; without delay, without faults."""
        command = parse(line)
        if command is None:
            return []
        with self._lock:
            now = self.clock.now()
            self._update(now)
            self.commands_seen += 1
            out = []
            for device in self.devices:
                if command.device not in (0, device.number):
                    continue
                said = device.handle(command, now)
                device.update(now)
                busy, warning = device.busy(command.axis), device.warning(command.axis)
                out.append(reply(command, device.number, answer=said, busy=busy, warning=warning))
            return out

    def _accept(self, server: socket.socket) -> None:
        while not self._closing.is_set():
            try:
                sock, _ = server.accept()
            except OSError:
                return
            sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            peer = _Peer(sock, threading.Lock())
            self._peers.append(peer)
            threading.Thread(target=self._serve, args=(peer,), name="zaber-link", daemon=True).start()

    def _serve(self, peer: _Peer) -> None:
        with contextlib.suppress(OSError), peer.sock.makefile("rb") as lines:
            for line in lines:
                self._respond(peer, line)
        with contextlib.suppress(OSError):
            peer.sock.close()
        if peer in self._peers:
            self._peers.remove(peer)

    def _respond(self, peer: _Peer, line: bytes) -> None:
        delay = self.settings.reply_delay_s
        self.clock.sleep(delay * REQUEST_SHARE)
        with self._lock:
            faults = self.faults.due()
            for fault in faults:
                self._happen(fault)
            answers = self.answer(line)
        kinds = {fault.kind for fault in faults}
        self.clock.sleep(delay * (1 - REQUEST_SHARE) + sum(f.delay_s for f in faults if f.kind == "delay"))
        if "drop-link" in kinds:
            self._drop_link()
        elif "silence" not in kinds:
            peer.send(b"".join(garbled(a) if "garble" in kinds else a for a in answers))

    def _happen(self, fault: Fault) -> None:
        now = self.clock.now()
        axis = next(a for a in self.axes if a.model.name == fault.axis)
        if fault.kind == "stall":
            axis.stall_at(now, fault.at)
        elif fault.kind == "driver-off":
            axis.halt(now)
            axis.driver_on = False
        elif fault.kind == "power-cycle":
            for device in self.devices:
                device.power_cycle(now)

    def _update(self, now: float) -> None:
        for device in self.devices:
            for axis in device.update(now):
                if device.alerts_on:
                    line = alert(device.number, axis, busy=device.busy(axis), warning=device.warning(axis))
                    for peer in list(self._peers):
                        peer.send(line)

    def _watch_for_rest(self) -> None:
        while not self._closing.wait(ALERT_LOOK_S if any(d.alerts_on for d in self.devices) else 0.1):
            if any(device.alerts_on and device.busy(0) for device in self.devices):
                with self._lock:
                    self._update(self.clock.now())

    def _drop_link(self) -> None:
        for peer in list(self._peers):
            with contextlib.suppress(OSError):
                peer.sock.shutdown(socket.SHUT_RDWR)
            with contextlib.suppress(OSError):
                peer.sock.close()
        self._peers.clear()


def serve_zaber(port: int, *, settings: ZaberSettings | None = None, speed_factor: float = 1.0) -> None:
    """Run a simulated Zaber controller until Ctrl-C; prints where it listens."""
    simulator = ZaberSimulator(settings or ZaberSettings(), ScaledClock(speed_factor))
    host, bound = simulator.start(port)
    layout, firmware = simulator.settings.layout, simulator.settings.firmware
    print(f"simulated Zaber {layout}, firmware {firmware}, on {host}:{bound} - Ctrl-C ends it", flush=True)
    try:
        threading.Event().wait()
    except KeyboardInterrupt:
        print("stopped", flush=True)
    finally:
        simulator.close()
