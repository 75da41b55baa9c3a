"""Tests examples/plant_franka.py with a stand-in for pylibfranka and a fake controller.

    python3 -m unittest discover clients/python

The stand-in has the names and signatures of pylibfranka 0.21.3; one test compares them with the real package
where it is installed.
"""

import contextlib
import gc
import importlib.util
import inspect
import os
import signal
import sys
import tempfile
import time
import types
import unittest
from pathlib import Path
from unittest import mock

import test_skillet_plant
from skillet_plant import Plant, PlantError
from test_skillet_plant import HOLD, RESET, STOP, TRACK

EXAMPLE = Path(__file__).resolve().parents[2] / "examples/plant_franka.py"
JOINTS = [f"panda_joint{i}" for i in range(1, 8)]
GRAVITY = [0.0, -30.0, 1.0, 20.0, 0.5, 2.0, 0.0]
SLOW = [0.1, -0.1, 0.1, -0.1, 0.1, -0.1, 0.1]


class Duration:
    def __init__(self, ms):
        self._ms = ms

    def to_sec(self):
        return self._ms * 1e-3


class RobotState:
    q, dq, tau_J, tau_J_d = [0.1] * 7, [0.0] * 7, GRAVITY, [0.0] * 7
    time = Duration(0)


class Torques:
    motion_finished = False
    tau_J = [0.0] * 7

    def __init__(self, tau_J):
        assert len(tau_J) == 7
        self.tau_J = list(tau_J)


class Model:
    def gravity(self, robot_state):
        assert isinstance(robot_state, RobotState)
        return GRAVITY


class RealtimeConfig:
    kEnforce, kIgnore = "enforce", "ignore"


class ActiveControlBase:
    def readOnce(self):
        raise NotImplementedError

    def writeOnce(self, command):
        raise NotImplementedError


class Robot:
    def __init__(self, robot_ip_address, realtime_config=RealtimeConfig.kEnforce):
        self.control = None

    def load_model(self):
        return Model()

    def set_collision_behavior(self, lower_torque_thresholds, upper_torque_thresholds,
                               lower_force_thresholds, upper_force_thresholds):
        assert [len(lower_torque_thresholds), len(upper_torque_thresholds)] == [7, 7]
        assert [len(lower_force_thresholds), len(upper_force_thresholds)] == [6, 6]

    def start_torque_control(self):
        return self.control


class FrankaException(Exception):
    pass


STAND_INS = [ActiveControlBase, Duration, FrankaException, Model, RealtimeConfig, Robot, RobotState, Torques]


def load_example():
    pylibfranka = types.ModuleType("pylibfranka")
    for stand_in in STAND_INS:
        setattr(pylibfranka, stand_in.__name__, stand_in)
    spec = importlib.util.spec_from_file_location("plant_franka", EXAMPLE)
    example = importlib.util.module_from_spec(spec)
    with mock.patch.dict(sys.modules, pylibfranka=pylibfranka):
        spec.loader.exec_module(example)
    return example


example = load_example()


class Control(ActiveControlBase):
    """The robot's end of the loop. Each read is one millisecond; before it, the controller answers what it received."""

    def __init__(self, answer):
        self.answer, self.ms, self.written = answer, 0, []
        self.qd = [0.0] * 7
        self.error_at_ms = None

    def readOnce(self):
        self.ms += 1
        self.answer()
        assert self.ms < 20_000, "the loop does not end"
        if self.error_at_ms is not None and self.ms >= self.error_at_ms:
            raise RuntimeError("libfranka: the robot has stopped")
        state = RobotState()
        state.dq, state.time = self.qd, Duration(self.ms)
        state.tau_J_d = self.written[-1].tau_J if self.written else [0.0] * 7
        return state, Duration(1)

    def writeOnce(self, command):
        assert not (self.written and self.written[-1].motion_finished), "control has ended"
        self.written.append(command)

    def torques(self):
        return [command.tau_J for command in self.written]


class Person:
    is_there, n_asked = True, 0

    def is_ready(self):
        self.n_asked += 1
        return self.is_there


class FrankaTest(unittest.TestCase):
    def setUp(self):
        stack = contextlib.ExitStack()
        self.addCleanup(stack.close)
        self.controller = test_skillet_plant.FakeController(
            stack.enter_context(tempfile.TemporaryDirectory()))
        stack.callback(self.controller.listener.close)
        stack.enter_context(mock.patch.dict(os.environ, {"SKILLET_PLANT": self.controller.path}))
        # A machine under load is slow to answer; that is not what is tested.
        stack.enter_context(mock.patch.object(example, "PATIENCE_S", 0.0))
        self.stack, self.person = stack, Person()
        self.samples, self.script = [], {}
        self.control = Control(self.answer)

    def answer(self):
        """Reads the samples that have come and answers each: `self.script` by number, 'rest' otherwise."""
        with contextlib.suppress(OSError):
            while message := self.controller.line.recv(4096):
                if len(message) == 344:
                    _, seq, episode = test_skillet_plant.words(message[:24], "Q")
                    self.samples.append((seq, episode))
                    self.script.get(seq, self.script.get("rest", lambda seq: None))(seq)

    def answers(self, mode, tau=(0.0,) * 7, episode=0):
        return lambda seq: self.controller.command(seq, mode, episode, tau)

    def welcome(self):
        self.controller.accept()
        self.controller.line.setblocking(False)
        self.stack.callback(self.controller.line.close)
        self.controller.welcome()
        # What the plant is started with must not end it.
        self.controller.command(1, HOLD)

    def serve(self, look=lambda: {}):
        robot = Robot("robot")
        robot.control = self.control
        with Plant("franka", JOINTS, simulated=False, timeout=5.0) as plant:
            self.welcome()
            self.plant = plant
            example.serve(robot, plant, self.person, look)

    def assertTorque(self, found, expected):
        for one, other in zip(found, expected, strict=True):
            self.assertAlmostEqual(one, other)

    def holds_damped(self, tau):
        self.assertTorque(tau, [-8.7 * speed for speed in self.control.qd[:4]]
                          + [-1.2 * speed for speed in self.control.qd[4:]])


class Torque(FrankaTest):
    def test_gravity_is_subtracted(self):
        more = [0.5, -0.5, 0.25, 0.0, 0.1, -0.1, 0.2]
        tau = [gravity + extra for gravity, extra in zip(GRAVITY, more)]
        self.script = {"rest": self.answers(TRACK, tau), 50: self.answers(STOP)}
        self.serve()
        near = [tau for tau in self.control.torques() if abs(tau[0] - more[0]) < 1e-9]
        self.assertGreater(len(near), 20)
        self.assertTorque(near[0], more)

    def test_no_torque_changes_faster_than_the_robot_accepts(self):
        self.script = {"rest": self.answers(TRACK, [gravity + 60.0 for gravity in GRAVITY]),
                       100: self.answers(TRACK, GRAVITY), 101: self.answers(STOP)}
        self.serve()
        torques = [[0.0] * 7, *self.control.torques()]
        steps = [abs(new - last) for before, after in zip(torques, torques[1:])
                 for last, new in zip(before, after)]
        self.assertLess(max(steps), 1.0)
        self.assertAlmostEqual(max(steps), example.STEP)
        self.assertAlmostEqual(max(tau[0] for tau in torques), 60.0)

    def test_what_is_no_number_is_not_applied(self):
        self.control.qd = SLOW
        self.script = {"rest": self.answers(TRACK, [float("nan")] + GRAVITY[1:]), 30: self.answers(STOP)}
        self.serve()
        self.holds_damped(self.control.torques()[25])

    def test_the_own_hold_is_clipped(self):
        state = RobotState()
        state.dq = [9.0, -9.0, 0.0, 0.0, 9.0, 0.0, 0.0]
        self.assertTorque(example.damped(state), [-20.0, 20.0, 0.0, 0.0, -5.0, 0.0, 0.0])


class Loop(FrankaTest):
    def test_the_arm_is_held_where_answers_are_missing(self):
        self.control.qd = SLOW
        tau = [gravity + 0.5 for gravity in GRAVITY]
        self.script = {seq: self.answers(TRACK, tau) for seq in range(1, 21)}
        self.script[80] = self.answers(STOP)
        self.serve()
        torques = self.control.torques()
        applied = [i for i, tau in enumerate(torques) if abs(tau[0] - 0.5) < 1e-9]
        self.assertTrue(applied)
        self.holds_damped(torques[applied[-1] + 5])
        # 2 repeats, and then as many holds as there were samples without an answer.
        self.assertGreaterEqual(self.plant.n_unanswered, 55)

    def test_a_reset_is_the_persons(self):
        self.person.is_there = False
        self.script = {"rest": self.answers(RESET, GRAVITY, episode=1), 60: self.answers(STOP)}

        def look():
            self.person.is_there = self.control.ms > 40
            return {}

        self.serve(look)
        self.assertGreater(self.person.n_asked, 10)
        first = next(seq for seq, episode in self.samples if episode == 1)
        self.assertGreater(first, 20)
        # Asked no more, though the controller says reset until it has seen the new episode.
        n_asked = self.person.n_asked
        self.assertLess(n_asked, 45)
        self.assertEqual(self.plant.episode, 1)
        self.assertTrue(all(abs(tau[1]) < 1e-9 for tau in self.control.torques()), "held meanwhile")

    def test_stop_ends_control_with_the_arm_at_rest(self):
        self.script = {"rest": self.answers(TRACK, [gravity + 5.0 for gravity in GRAVITY]),
                       30: self.answers(STOP)}
        self.serve()
        *before, last = self.control.written
        self.assertTrue(last.motion_finished)
        self.assertFalse(any(command.motion_finished for command in before))
        self.assertLess(max(map(abs, last.tau_J)), example.REST_TORQUE)

    def test_an_arm_that_does_not_come_to_rest_is_let_go_damped(self):
        self.control.qd = SLOW
        self.script = {"rest": self.answers(STOP)}
        self.serve()
        self.assertGreaterEqual(len(self.control.written), example.REST_CYCLES)
        self.assertTrue(self.control.written[-1].motion_finished)
        self.holds_damped(self.control.written[-1].tau_J)

    def test_a_dead_controller_ends_control_damped(self):
        self.control.qd = [0.04] * 7
        self.script = {"rest": self.answers(TRACK, GRAVITY),
                       30: lambda seq: self.controller.line.close()}
        with self.assertRaises(PlantError):
            self.serve()
        self.assertTrue(self.control.written[-1].motion_finished)
        self.holds_damped(self.control.written[-1].tau_J)

    def test_a_controller_that_refuses_ends_control_damped(self):
        self.controller.welcome = lambda welcome=self.controller.welcome: welcome("wrong arm")
        with self.assertRaisesRegex(PlantError, "wrong arm"):
            self.serve()
        self.assertTrue(self.control.written[-1].motion_finished)

    def test_a_robot_that_has_stopped_ends_the_loop(self):
        self.script = {"rest": self.answers(TRACK, GRAVITY)}
        self.control.error_at_ms = 50
        with self.assertRaisesRegex(RuntimeError, "has stopped"):
            self.serve()
        self.assertFalse(any(command.motion_finished for command in self.control.written))

    def test_a_camera_fills_the_samples(self):
        seen = []
        exchange = Plant.exchange

        def watched(plant, *arguments, **sample):
            seen.append(sample)
            return exchange(plant, *arguments, **sample)

        self.script = {"rest": self.answers(TRACK, GRAVITY), 20: self.answers(STOP)}
        with mock.patch.object(Plant, "exchange", watched):
            self.serve(lambda: {"object_position": [1.0, 2.0, 3.0], "in_contact": True})
        self.assertEqual(seen[-1]["object_position"], [1.0, 2.0, 3.0])
        times = [sample["t_ns"] for sample in seen]
        self.assertEqual(times, sorted(set(times)))
        self.assertEqual(times[-1] % 1_000_000, 0)


class Program(FrankaTest):
    def run_main(self, *arguments, **keywords):
        made = []

        class Connected(Robot):
            def __init__(robot, *arguments):
                super().__init__(*arguments)
                made.append(arguments)
                robot.control = self.control

            def start_torque_control(robot):
                self.welcome()
                return super().start_torque_control()

        handler, interval = signal.getsignal(signal.SIGTERM), sys.getswitchinterval()
        try:
            with mock.patch.object(example, "Robot", Connected), \
                    mock.patch.object(example, "Person", lambda: self.person):
                example.main(["10.0.0.1", *arguments], **keywords)
        finally:
            signal.signal(signal.SIGTERM, handler)
            sys.setswitchinterval(interval)
            gc.enable()
        return made

    def test_it_runs_as_a_program(self):
        self.script = {"rest": self.answers(STOP)}
        self.assertEqual(self.run_main(), [("10.0.0.1", RealtimeConfig.kEnforce)])
        self.control = Control(self.answer)
        self.assertEqual(self.run_main("--any-kernel"), [("10.0.0.1", RealtimeConfig.kIgnore)])

    def test_an_error_is_its_exit_message(self):
        self.script = {"rest": lambda seq: self.controller.line.close()}
        with self.assertRaisesRegex(SystemExit, "plant_franka: the controller is gone"):
            self.run_main()
        self.assertTrue(self.control.written[-1].motion_finished)

    def test_a_request_to_end_brings_the_arm_to_rest(self):
        self.script = {"rest": self.answers(TRACK, GRAVITY),
                       30: lambda seq: os.kill(os.getpid(), signal.SIGTERM)}
        self.run_main()
        self.assertTrue(self.control.written[-1].motion_finished)


class Enter(unittest.TestCase):
    def person(self):
        reading, self.writing = os.pipe()
        self.stdin = os.fdopen(reading)
        self.addCleanup(self.stdin.close)
        patches = mock.patch.object(sys, "stdin", self.stdin), mock.patch("builtins.print")
        _, self.printed = [patch.start() for patch in patches]
        for patch in patches:
            self.addCleanup(patch.stop)
        self.wrote = lambda what: os.write(self.writing, what)
        return example.Person()

    def becomes_ready(self, person, patience_s=5.0):
        until = time.monotonic() + patience_s
        while time.monotonic() < until:
            if person.is_ready():
                return True
            time.sleep(0.001)
        return False

    def test_enter_is_awaited_and_counts_once(self):
        person = self.person()
        self.assertFalse(self.becomes_ready(person, 0.05))
        self.wrote(b"\n")
        self.assertTrue(self.becomes_ready(person))
        self.assertFalse(self.becomes_ready(person, 0.05))
        os.close(self.writing)

    def test_a_closed_terminal_is_no_person(self):
        person = self.person()
        os.close(self.writing)
        self.assertFalse(self.becomes_ready(person, 0.1))
        self.assertIn("stdin is closed", str(self.printed.call_args))


class RealPackage(unittest.TestCase):
    def test_the_stand_in_has_the_names_of_the_package(self):
        try:
            import pylibfranka
        except ImportError:
            self.skipTest("pylibfranka is not installed")
        for stand_in in STAND_INS:
            real = getattr(pylibfranka, stand_in.__name__)
            names = [name for name in vars(stand_in) if not name.startswith("_")]
            for name in names:
                self.assertTrue(hasattr(real, name), f"{stand_in.__name__}.{name}")
        torques = pylibfranka.Torques([1.0] * 7)
        self.assertEqual((torques.tau_J, torques.motion_finished), ([1.0] * 7, False))
        torques.motion_finished = True
        said = pylibfranka.Robot.set_collision_behavior.__doc__
        for name in inspect.signature(Robot.set_collision_behavior).parameters:
            self.assertIn(name, said)
        said = pylibfranka.Robot.__init__.__doc__
        for name in inspect.signature(Robot.__init__).parameters:
            self.assertIn(name, said)
        self.assertIn("tuple[", pylibfranka.ActiveControlBase.readOnce.__doc__)


if __name__ == "__main__":
    unittest.main()
