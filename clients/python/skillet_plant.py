"""Connects a simulator or a robot to a Skillet controller: one file, standard library only.

A simulated plant is stepped in lockstep:

    with Plant("my simulator", JOINTS, tracks_object=True, cell="kitchen") as plant:
        command = plant.start(q, qd)
        while not command.stop:
            if command.reset:
                ...  # a new world: start posture, at rest
            else:
                ...  # one period with command.tau
            command = plant.send(q, qd, object_position=p, object_quaternion=w_x_y_z, in_contact=True)

A robot samples by its own clock and never waits longer than it chooses to:

    with Plant("my robot", JOINTS, simulated=False, cell="kitchen") as plant:
        command = plant.start(*robot.read())
        while not command.stop:
            if command.hold:
                robot.hold_damped()
            else:
                robot.apply(command.tau)
            if command.reset and robot.person_is_ready():
                plant.reset_done()
            command = plant.exchange(*robot.read_next())

When a `PlantError` ends either loop, the robot must hold itself.

Vectors are lists or NumPy arrays, SI units throughout. Messages and rules: docs/plant-protocol.md.
"""

import hashlib
import os
import select
import socket
import struct
import time
from pathlib import Path
from typing import Any, NamedTuple, Optional

try:
    import numpy
except ImportError:
    numpy = None

VERSION = 1
MAX_JOINTS = 7
MAX_MEASURES = 32
# The controller sends something at least twice a second.
SILENCE_S = 5.0
LOOK_OUT_NS = 100_000
# How often a robot repeats the last torque when no answer comes.
MAX_REPEATS = 2
GONE = "the controller is gone"

_KIND = struct.Struct("<Q")
_HELLO = struct.Struct("<QQ32sQQQ32s224s7d7d")
_WELCOME = struct.Struct("<5Q320s")
_STATE = struct.Struct("<7Q7d7d7d3d4d8d")
_STATE_HEAD = struct.Struct("<7Q")
_COMMAND = struct.Struct("<7Q7d")
_COMMAND_HEAD = struct.Struct("<7Q")
_OUTCOME_HEAD = struct.Struct("<3Q")
_POSITION, _QUATERNION = struct.Struct("<3d"), struct.Struct("<4d")
_HELLO_KIND, _WELCOME_KIND, _STATE_KIND, _COMMAND_KIND, _OUTCOME_KIND = 1, 2, 3, 4, 5
_AT_Q, _AT_QD, _AT_TAU, _AT_POSITION, _AT_QUATERNION, _AT_USER = 56, 112, 168, 224, 248, 280
_LENGTHS = {_WELCOME_KIND: _WELCOME.size, _COMMAND_KIND: _COMMAND.size}
_HOLD, _TRACK, _RESET, _STOP = range(4)


class PlantError(Exception):
    """The connection to the controller cannot be made, was refused, or has ended."""


class Command(NamedTuple):
    """The controller's answer. Exactly one of `hold`, `track`, `reset` and `stop` is true."""

    mode: int
    episode: int
    """The episode the controller wants."""
    tau: Any
    """Joint torques, (n_joints,), N·m. None in `hold` and `stop`."""
    expires_ns: int
    """Plant time until which `tau` is valid, ns."""
    answers_seq: int
    n_lost: int
    """Samples the controller has missed so far."""
    rollout: int
    """The session's number of the rollout: a world that varies draws by it."""

    @property
    def hold(self) -> bool:
        """Hold the arm yourself, damped. A simulated plant never sees this."""
        return self.mode == _HOLD

    @property
    def track(self) -> bool:
        """Apply `tau`."""
        return self.mode == _TRACK

    @property
    def reset(self) -> bool:
        """Begin `episode`. A robot applies `tau` until the world is ready; see `Plant.reset_done`."""
        return self.mode == _RESET

    @property
    def stop(self) -> bool:
        """The controller is shutting down."""
        return self.mode == _STOP

    def __repr__(self):
        name = ("hold", "track", "reset", "stop")[self.mode]
        return f"Command({name}, episode={self.episode}, rollout={self.rollout}, n_lost={self.n_lost})"


def socket_path(cell: Optional[str] = None) -> str:
    """Where the controller of `cell` waits for a plant. SKILLET_PLANT overrides everything."""
    if given := os.environ.get("SKILLET_PLANT"):
        return given
    if own := os.environ.get("SKILLET_RUNTIME_DIR"):
        root = Path(own)
    elif session := os.environ.get("XDG_RUNTIME_DIR"):
        root = Path(session) / "skillet"
    else:
        root = Path(f"/tmp/skillet-{os.getuid()}")
    return str(root / (cell or "skillet") / "plant.sock")


class Plant:
    """A connection to the controller of one cell. Not thread-safe.

    name            shown to people, at most 32 bytes
    joint_names     from the base outwards, as the URDF names them; at most 7
    period          time between two samples, s
    simulated       lockstep (`send`); otherwise the plant is the clock (`exchange`)
    can_reset       the plant can start a new world by itself; as `simulated` when None
    tracks_object   samples hold the pose of an object
    deterministic   same torques, same samples, bit for bit
    urdf            path of the URDF the plant was made from; the controller compares its digest
    torque_limits   (n_joints,), N·m; the controller compares them
    cell            name of the cell, "skillet" when None
    timeout         how long to wait for the controller, and for its welcome, s

    What is None is not compared.
    """

    def __init__(self, name, joint_names, period=0.001, *, simulated=True, can_reset=None,
                 tracks_object=False, deterministic=False, urdf=None, torque_limits=None,
                 cell=None, timeout=10.0):
        n = len(joint_names)
        if not 1 <= n <= MAX_JOINTS:
            raise PlantError(f"{n} joints: the protocol has room for 1 to {MAX_JOINTS}")
        self.n_joints, self.simulated = n, simulated
        self.episode = 0
        self.n_unanswered = 0
        """Samples of a robot that had no answer in time, so far."""
        self._name = _field(name, 32)
        self._joint_names = b"".join(_field(joint, 32) for joint in joint_names)
        can_reset = simulated if can_reset is None else can_reset
        self._flags = simulated + 2 * can_reset + 4 * tracks_object + 8 * deterministic
        self._period_ns = round(period * 1e9)
        self._sha256 = hashlib.sha256(Path(urdf).read_bytes()).digest() if urdf else bytes(32)
        self._joints = struct.Struct(f"<{n}d")
        self._tau_max = self._floats(
            "torque_limits", [0.0] * n if torque_limits is None else torque_limits)

        self._tx, self._rx = bytearray(_STATE.size), bytearray(2048)
        _QUATERNION.pack_into(self._tx, _AT_QUATERNION, 1.0, 0.0, 0.0, 0.0)
        self._tau = numpy and numpy.frombuffer(self._rx, "<f8", n, _COMMAND_HEAD.size)
        self._seq, self._t_ns, self._heard_ns = 0, 0, 0
        self._asked_episode, self._misses, self._last = 0, 0, None
        self._measures, self._has_news = {}, False
        self._timeout = timeout
        self._socket = _connect(socket_path(cell), timeout)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def __repr__(self):
        kind = "simulated" if self.simulated else "real"
        return f"<Plant {_text(self._name)}: {self.n_joints} joints, {kind}, episode {self.episode}>"

    def close(self):
        """Ends the connection; the controller holds the arm and latches a fault."""
        self._socket.close()

    def start(self, q, qd, **sample) -> Command:
        """Introduces the plant at rest at `q`, rad, and sends the first sample; see `send`."""
        hello = _HELLO.pack(_HELLO_KIND, VERSION, self._name, self.n_joints, self._flags,
                            self._period_ns, self._sha256, self._joint_names,
                            *self._tau_max, *self._floats("q", q))
        self._transmit(hello)
        if not self._is_readable(self._timeout):
            raise PlantError(f"the controller has not welcomed the plant within {self._timeout:g} s")
        self._receive(expected=_WELCOME_KIND)
        if self.simulated:
            return self.send(q, qd, **sample)
        self._heard_ns = time.monotonic_ns()
        return self.exchange(q, qd, self._timeout, **sample)

    def send(self, q, qd, **sample) -> Command:
        """Sends a sample of a simulated plant and waits for the command to carry out: no `hold`.

        q, qd                joint positions, rad, and speeds, rad/s, (n_joints,)
        tau                  measured joint torques, N·m, (n_joints,)
        object_position      centre of the object in the world, m, (3,)
        object_quaternion    its orientation there, (w, x, y, z)
        in_contact           the object touches the tip
        t_ns                 the plant's own time, ns; counted in periods when absent
        user                 up to 8 numbers of your own
        fault                the plant has a fault of its own
        """
        if not self.simulated:
            raise PlantError("send() may wait for seconds: a real plant uses exchange()")
        self._send_sample(q, qd, **sample)
        while True:
            if not self._await():
                raise PlantError(f"nothing from the controller for {SILENCE_S:g} s: it hangs or "
                                 "was suspended")
            command = self._command()
            if command.stop:
                return command
            if not command.hold and command.answers_seq == self._seq:
                if command.reset:
                    self._begin(command.episode)
                return command

    def exchange(self, q, qd, timeout=0.0, **sample) -> Command:
        """Sends a sample of a real plant, see `send`, and returns the command in force now.

        Waits at most `timeout` seconds for the answer. With 0 it takes the answer to the sample
        before, one period old. If none has come, the last command is repeated at most twice while it
        is valid; then `hold` is true.
        """
        if self.simulated:
            raise PlantError("exchange() skips late answers: a simulated plant uses send()")
        t_ns = self._send_sample(q, qd, flags=socket.MSG_DONTWAIT, **sample)
        command = self._newest(t_ns, timeout)
        if command is not None:
            self._last, self._misses = command, 0
            self._asked_episode = command.episode if command.reset else self._asked_episode
            return command
        if time.monotonic_ns() - self._heard_ns > SILENCE_S * 1e9:
            raise PlantError(f"nothing from the controller for {SILENCE_S:g} s")
        self._misses += 1
        self.n_unanswered += 1
        if self._last and self._misses <= MAX_REPEATS and _is_valid(self._last, t_ns):
            return self._last
        return Command(_HOLD, self.episode, None, 0, self._seq, 0, 0)

    def reset_done(self):
        """A real plant's world is ready: the samples from now on belong to the new episode."""
        self._begin(self._asked_episode)

    def measure(self, name, value, unit="1"):
        """Adds a measure of this episode that only the plant knows; sent with the next sample.

        `unit` is SI, "1" without one, "bool" for a truth value. A name measured twice keeps the
        later value.
        """
        _field(name, 32), _field(unit, 8)
        self._measures[name] = (unit, float(value))
        self._has_news = True
        if len(self._measures) > MAX_MEASURES:
            raise PlantError(f"more than {MAX_MEASURES} measures in one episode")

    def _begin(self, episode):
        self.episode = episode
        self._measures.clear()
        self._has_news = False

    def _send_sample(self, q, qd, tau=None, object_position=None, object_quaternion=None,
                     in_contact=False, t_ns=None, user=(), fault=False, flags=0):
        """Sends one State, and before it what was measured; returns its plant time."""
        if self._has_news:
            self._has_news = not self._transmit(self._outcome(), flags)
        tx = self._tx
        wall_ns = time.monotonic_ns()
        self._seq += 1
        self._t_ns += self._period_ns
        if t_ns is not None:
            self._t_ns = int(t_ns)
        elif not self.simulated:
            self._t_ns = wall_ns
        is_seen = object_position is not None
        _STATE_HEAD.pack_into(tx, 0, _STATE_KIND, self._seq, self.episode, self._t_ns, wall_ns,
                              bool(in_contact) + 2 * is_seen + 4 * bool(fault), self.n_unanswered)
        try:
            self._joints.pack_into(tx, _AT_Q, *q)
            self._joints.pack_into(tx, _AT_QD, *qd)
            if tau is not None:
                self._joints.pack_into(tx, _AT_TAU, *tau)
            if is_seen:
                _POSITION.pack_into(tx, _AT_POSITION, *object_position)
            if object_quaternion is not None:
                _QUATERNION.pack_into(tx, _AT_QUATERNION, *object_quaternion)
            if len(user):
                struct.pack_into(f"<{len(user)}d", tx, _AT_USER, *user)
        except struct.error as error:
            raise PlantError(f"q, qd and tau take {self.n_joints} numbers, object_position 3, "
                             f"object_quaternion 4, user at most 8: {error}") from None
        if not self._transmit(tx, flags) and not flags:
            raise PlantError(f"the controller has read nothing for {SILENCE_S:g} s")
        return self._t_ns

    def _transmit(self, message, flags=0):
        """Sends one message; False when there is no room for it in time."""
        try:
            self._socket.send(message, flags)
            return True
        except BlockingIOError:
            return False
        except OSError:
            # If the controller said why it hung up, that can still be read.
            while self._receive(socket.MSG_DONTWAIT):
                pass
            raise PlantError(GONE) from None

    def _await(self):
        """Receives one message; False when none came for `SILENCE_S`.

        In lockstep one end works while the other waits: it looks out for a moment before it sleeps,
        which halves the time of a step.
        """
        until = time.perf_counter_ns() + LOOK_OUT_NS
        while time.perf_counter_ns() < until:
            if self._receive(socket.MSG_DONTWAIT):
                return True
        # The socket's own time-out: the controller lets time stand still, but not in silence.
        return self._receive()

    def _receive(self, flags=0, expected=_COMMAND_KIND):
        """Receives one message; False when none came in time."""
        try:
            length = self._socket.recv_into(self._rx, 0, flags)
        except BlockingIOError:
            return False
        except ConnectionResetError:
            # The kernel reports the reset once, ahead of what the controller said before it.
            if self._receive(socket.MSG_DONTWAIT, expected):
                return True
            raise PlantError(GONE) from None
        except OSError as error:
            raise PlantError(f"{GONE}: {error}") from None
        if length == 0:
            raise PlantError(GONE)
        kind = _KIND.unpack_from(self._rx)[0] if length >= _KIND.size else 0
        if kind == _WELCOME_KIND and length == _WELCOME.size:
            _, version, is_accepted, _, _, reason = _WELCOME.unpack_from(self._rx)
            if not is_accepted:
                raise PlantError(f"the controller refused this plant: {_text(reason)}")
            if version != VERSION:
                raise PlantError(f"the controller speaks version {version} of the protocol, this "
                                 f"module version {VERSION}: update the older one")
        if kind != expected or length != _LENGTHS[kind]:
            raise PlantError(f"unexpected message of kind {kind} with {length} bytes from the "
                             f"controller: are both of version {VERSION} of the protocol?")
        return True

    def _command(self):
        """The Command received last."""
        _, answers_seq, episode, rollout, mode, expires_ns, n_lost = _COMMAND_HEAD.unpack_from(self._rx)
        tau = None
        if mode in (_TRACK, _RESET):
            tau = (list(self._joints.unpack_from(self._rx, _COMMAND_HEAD.size))
                   if self._tau is None else self._tau.copy())
        elif mode not in (_HOLD, _STOP):
            raise PlantError(f"the controller sent a command of mode {mode}, which does not exist")
        return Command(mode, episode, tau, expires_ns, answers_seq, n_lost, rollout)

    def _newest(self, t_ns, timeout):
        """The newest valid command that arrives within `timeout`, or None."""
        newest, until = None, time.monotonic() + timeout
        while newest is None or newest.answers_seq < self._seq:
            if self._receive(socket.MSG_DONTWAIT):
                self._heard_ns = time.monotonic_ns()
                command = self._command()
                if command.stop:
                    return command
                newest = command if _is_valid(command, t_ns) else newest
            elif not self._is_readable(until - time.monotonic()):
                break
        return newest

    def _is_readable(self, timeout):
        return timeout > 0 and bool(select.select([self._socket], [], [], timeout)[0])

    def _floats(self, name, values):
        """One float a joint, filled up to the length of the field."""
        values = [float(value) for value in values]
        if len(values) != self.n_joints:
            raise PlantError(f"{name} has {len(values)} numbers for {self.n_joints} joints")
        return values + [0.0] * (MAX_JOINTS - self.n_joints)

    def _outcome(self):
        n, rest = len(self._measures), MAX_MEASURES - len(self._measures)
        names = b"".join(_field(name, 32) for name in self._measures)
        units = b"".join(_field(unit, 8) for unit, _ in self._measures.values())
        values = [value for _, value in self._measures.values()]
        return (_OUTCOME_HEAD.pack(_OUTCOME_KIND, self.episode, n) + names + bytes(32 * rest)
                + units + bytes(8 * rest) + struct.pack(f"<{MAX_MEASURES}d", *values, *[0.0] * rest))


def _connect(path, timeout):
    """A connected socket none of whose calls waits longer than `SILENCE_S`."""
    until = time.monotonic() + timeout
    while True:
        sock = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        # Time-outs of the kernel's: Python's own cost a system call a message.
        limit = struct.pack("@ll", int(SILENCE_S), int(SILENCE_S % 1 * 1e6))
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, limit)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, limit)
        try:
            sock.connect(path)
            return sock
        except (FileNotFoundError, ConnectionRefusedError, BlockingIOError):
            sock.close()
        except OSError as error:
            sock.close()
            raise PlantError(f"cannot connect to {path}: {error}") from None
        if time.monotonic() >= until:
            raise PlantError(f"no controller waits for a plant at {path} after {timeout:g} s: start "
                             "one with `skillet controller --plant external`")
        time.sleep(0.02)


def _is_valid(command, t_ns):
    """Holds have no torque that could be too old."""
    return command.tau is None or t_ns <= command.expires_ns


def _field(text, length):
    """`text` for a field of `length` bytes."""
    field = text.encode()
    if len(field) > length:
        raise PlantError(f"'{text}' has {len(field)} bytes: at most {length} fit")
    return field.ljust(length, b"\0")


def _text(field):
    """The text of a field, without what a terminal would obey."""
    text = field.split(b"\0")[0].decode(errors="replace")
    return "".join(c if c.isprintable() else " " for c in text)
