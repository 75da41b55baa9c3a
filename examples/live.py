"""Reads the live telemetry of a running cell: pip install iceoryx2==0.10.0

    skillet controller --cell kitchen &
    python3 examples/live.py kitchen 5

Lossy, like every observer: the controller does not notice. The layouts below are those of
shm-types/src/telemetry.rs and episode.rs; the type's version is checked when the service is opened.
"""

import ctypes
import fcntl
import os
import sys
import time
from pathlib import Path

import iceoryx2 as iox

DOUBLE, U32, U64 = ctypes.c_double, ctypes.c_uint32, ctypes.c_uint64


class TickRecord(ctypes.Structure):
    _fields_ = [
        ("tick", U64),
        ("phase", U32),  # 0 idle, 1 approach, 2 execute, 3 settle
        ("fault", U32),
        ("t_s", DOUBLE),
        ("q", DOUBLE * 7),
        ("qd", DOUBLE * 7),
        ("tau", DOUBLE * 7),
        ("x", DOUBLE * 6),
        ("xd", DOUBLE * 6),
        ("attractor", DOUBLE * 6),
        ("object_position", DOUBLE * 3),
        ("object_quaternion", DOUBLE * 4),
        ("flags", U32),
        ("reserved", U32),
    ]


class TelemetryTick(ctypes.Structure):
    _fields_ = [
        ("record", TickRecord),
        ("policy_digest", U64),
        ("wakeup_ns", U64),
        ("tick_ns", U64),
        ("missed", U64),
    ]


class Telemetry(ctypes.Structure):
    _fields_ = [
        ("schema", U64),
        ("lost", U64),
        ("n_ticks", U64),
        ("via", ctypes.c_uint8 * 64),
        ("via_hz", U64),
        ("ticks", TelemetryTick * 20),
    ]

    @staticmethod
    def type_name() -> str:
        return "skillet/Telemetry/3"


def runtime_dir() -> Path:
    """Where cells live, as the tool looks for them."""
    if own := os.environ.get("SKILLET_RUNTIME_DIR"):
        return Path(own)
    if session := os.environ.get("XDG_RUNTIME_DIR"):
        return Path(session) / "skillet"
    return Path(f"/tmp/skillet-{os.getuid()}")


def subscribe(cell: Path):
    """A subscriber in the cell's current generation, and what must outlive it."""
    generation = cell / f"g{(cell / 'current').read_text()}"
    in_use = os.open(generation, os.O_RDONLY)
    fcntl.flock(in_use, fcntl.LOCK_SH)  # unused generations are deleted

    digest = 0xCBF29CE484222325  # FNV-1a of the cell's folder: /dev/shm is one folder for all
    for byte in os.fsencode(cell):
        digest = ((digest ^ byte) * 0x100000001B3) & 0xFFFFFFFFFFFFFFFF
    config = iox.config.default()
    config.global_cfg.root_path = iox.Path.new(str(generation))
    config.global_cfg.prefix = iox.FileName.new(f"sk{digest & 0xFFFFFFFF:08x}{generation.name}_")

    iox.set_log_level(iox.LogLevel.Error)
    node = (
        iox.NodeBuilder.new()
        .config(config)
        .signal_handling_mode(iox.SignalHandlingMode.Disabled)
        .create(iox.ServiceType.Ipc)
    )
    service = (
        node.service_builder(iox.ServiceName.new("skillet/telemetry"))
        .publish_subscribe(Telemetry)
        .open()
    )
    return service.subscriber_builder().create(), (node, in_use)


def main() -> None:
    cell = runtime_dir() / (sys.argv[1] if len(sys.argv) > 1 else "skillet")
    seconds = float(sys.argv[2]) if len(sys.argv) > 2 else 5.0
    subscriber, _alive = subscribe(cell)
    end, seen, worst_us = time.monotonic() + seconds, 0, 0.0
    while time.monotonic() < end:
        while (sample := subscriber.receive()) is not None:
            telemetry = sample.payload().contents
            for tick in telemetry.ticks[: telemetry.n_ticks]:
                seen += 1
                worst_us = max(worst_us, tick.wakeup_ns * 1e-3)
            last = tick.record
            print(f"tick {last.tick}  phase {last.phase}  pan at {list(last.x[:3])}", flush=True)
            sample.delete()
        time.sleep(0.01)
    print(f"{seen} ticks seen, longest wake-up {worst_us:.0f} µs")


if __name__ == "__main__":
    main()
