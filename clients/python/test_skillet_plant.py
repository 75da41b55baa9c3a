"""What skillet_plant does when a controller behaves, misbehaves, or is gone.

    python3 -m unittest discover clients/python

The controller is faked on a real socket. Its messages are queued before the plant reads them, so that
no test needs a thread or depends on speed.
"""

import contextlib
import os
import socket
import struct
import tempfile
import time
import unittest
from unittest import mock

import skillet_plant
from skillet_plant import Plant, PlantError, socket_path

JOINTS = ["j1", "j2", "j3"]
Q = [0.1, 0.2, 0.3]
QD = [1.0, 2.0, 3.0]
HOLD, TRACK, RESET, STOP = range(4)
FOREVER = 2**63


def words(values, field):
    return struct.unpack(f"<{len(values) // 8}{field}", values)


class FakeController:
    """The other end of the socket."""

    def __init__(self, folder):
        self.path = os.path.join(folder, "plant.sock")
        self.listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.listener.bind(self.path)
        self.listener.listen(1)

    def accept(self):
        self.line, _ = self.listener.accept()
        self.line.settimeout(5)

    def welcome(self, reason="", version=1):
        text = reason.encode()
        self.line.send(struct.pack("<5Q320s", 2, version, reason == "", 1, 1_000_000, text))

    def command(self, seq, mode=TRACK, episode=0, tau=(4.0, 5.0, 6.0), expires_ns=FOREVER):
        tau = list(tau) + [0.0] * (7 - len(tau))
        self.line.send(struct.pack("<7Q7d", 4, seq, episode, episode, mode, expires_ns, 0, *tau))

    def receive(self):
        return self.line.recv(4096)

    def state(self):
        """The next sample: seq, episode, t_ns, wall_ns, flags and n_unanswered."""
        message = self.receive()
        kind, *head = words(message[:56], "Q")
        assert (kind, len(message)) == (3, 344), (kind, len(message))
        return head


class PlantTest(unittest.TestCase):
    def setUp(self):
        stack = contextlib.ExitStack()
        self.addCleanup(stack.close)
        folder = stack.enter_context(tempfile.TemporaryDirectory())
        self.controller = FakeController(folder)
        stack.callback(self.controller.listener.close)
        environment = {"SKILLET_PLANT": self.controller.path}
        stack.enter_context(mock.patch.dict(os.environ, environment))
        self.stack = stack

    def plant(self, **options):
        plant = self.stack.enter_context(Plant("test", JOINTS, timeout=1.0, **options))
        self.controller.accept()
        self.stack.callback(self.controller.line.close)
        return plant

    def started(self, **options):
        """A plant whose first sample was answered; Hello and that sample are read."""
        plant = self.plant(**options)
        self.controller.welcome()
        self.controller.command(1)
        plant.start(Q, QD)
        self.controller.receive()
        self.controller.state()
        return plant

    def fails(self, words, call, *arguments, **keywords):
        with self.assertRaises(PlantError) as caught:
            call(*arguments, **keywords)
        self.assertIn(words, str(caught.exception))


class Start(PlantTest):
    def test_the_hello_says_what_was_given(self):
        plant = self.plant(tracks_object=True, torque_limits=(9, 8, 7), urdf=__file__)
        self.controller.welcome()
        self.controller.command(1)
        plant.start(Q, QD)
        hello = self.controller.receive()
        self.assertEqual(len(hello), 440)
        self.assertEqual(words(hello[:16], "Q"), (1, 1))
        self.assertEqual(hello[16:48].rstrip(b"\0"), b"test")
        self.assertEqual(words(hello[48:72], "Q"), (3, 1 + 2 + 4, 1_000_000))
        self.assertNotEqual(hello[72:104], bytes(32))
        self.assertEqual(hello[104:200].replace(b"\0", b""), b"j1j2j3")
        self.assertEqual(words(hello[328:], "d"), (9, 8, 7, *[0] * 4, *Q, *[0] * 4))

    def test_nobody_there_is_an_error_with_the_path(self):
        self.controller.listener.close()
        self.fails(self.controller.path, Plant, "test", JOINTS, timeout=0.05)
        os.remove(self.controller.path)
        self.fails("skillet controller", Plant, "test", JOINTS, timeout=0.05)

    def test_no_welcome_is_an_error(self):
        plant = Plant("test", JOINTS, timeout=0.05)
        self.stack.callback(plant.close)
        self.fails("within 0.05 s", plant.start, Q, QD)

    def test_a_refusal_tells_its_reason(self):
        plant = self.plant()
        self.controller.welcome("its period is 2 ms\x1b, mine 1 ms")
        self.controller.line.close()
        self.fails("refused this plant: its period is 2 ms , mine 1 ms", plant.start, Q, QD)

    def test_another_version_is_an_error(self):
        plant = self.plant()
        self.controller.welcome(version=2)
        self.fails("version 2", plant.start, Q, QD)

    def test_what_does_not_fit_is_an_error(self):
        self.fails("8 joints", Plant, "test", ["j"] * 8)
        self.fails("at most 32", Plant, "x" * 33, JOINTS)
        self.fails("2 numbers for 3 joints", Plant, "test", JOINTS, torque_limits=[1, 2])
        self.fails("q has 2 numbers", self.plant().start, Q[:2], QD)

    def test_the_prompt_shows_no_torques(self):
        plant = self.plant()
        self.controller.welcome()
        self.controller.command(1, TRACK, episode=3)
        command = plant.start(Q, QD)
        self.assertEqual(repr(command), "Command(track, episode=3, rollout=3, n_lost=0)")
        self.assertEqual(repr(plant), "<Plant test: 3 joints, simulated, episode 0>")

    def test_the_path_follows_the_environment(self):
        environment = {"SKILLET_RUNTIME_DIR": "/run/own", "XDG_RUNTIME_DIR": "/run/user/7"}
        with mock.patch.dict(os.environ, environment, clear=True):
            self.assertEqual(socket_path("kitchen"), "/run/own/kitchen/plant.sock")
            del os.environ["SKILLET_RUNTIME_DIR"]
            self.assertEqual(socket_path(), "/run/user/7/skillet/skillet/plant.sock")
            del os.environ["XDG_RUNTIME_DIR"]
            self.assertEqual(socket_path("a"), f"/tmp/skillet-{os.getuid()}/a/plant.sock")


class Lockstep(PlantTest):
    def test_a_sample_and_its_answer(self):
        plant = self.started(tracks_object=True)
        self.controller.command(2, tau=(1.0, 2.0, 3.0))
        command = plant.send(Q, QD, tau=[7, 8, 9], object_position=(1, 2, 3),
                             object_quaternion=(0, 1, 0, 0), in_contact=True, user=[5.0])
        self.assertTrue(command.track)
        self.assertEqual(list(command.tau), [1.0, 2.0, 3.0])
        message = self.controller.receive()
        seq, episode, t_ns, wall_ns, flags, n_unanswered = words(message[8:56], "Q")
        self.assertEqual((seq, episode, t_ns, flags, n_unanswered), (2, 0, 2_000_000, 3, 0))
        self.assertGreater(wall_ns, 0)
        none = [0.0] * 4
        self.assertEqual(words(message[56:224], "d"), (*Q, *none, *QD, *none, 7, 8, 9, *none))
        self.assertEqual(words(message[224:], "d"), (1, 2, 3, 0, 1, 0, 0, 5, *[0.0] * 7))

    def test_arrays_and_lists_are_the_same(self):
        if skillet_plant.numpy is None:
            self.skipTest("NumPy is not installed")
        plant = self.started()
        self.controller.command(2)
        tau = plant.send(skillet_plant.numpy.array(Q), skillet_plant.numpy.array(QD)).tau
        self.controller.command(3, tau=(0.0, 0.0, 0.0))
        plant.send(Q, QD)
        self.assertEqual(tau.tolist(), [4.0, 5.0, 6.0], "a later command changed an earlier one")
        first, second = self.controller.receive(), self.controller.receive()
        self.assertEqual(first[56:], second[56:])

    def test_lists_come_back_without_numpy(self):
        with mock.patch.object(skillet_plant, "numpy", None):
            plant = self.started()
        self.controller.command(2)
        self.assertEqual(plant.send(Q, QD).tau, [4.0, 5.0, 6.0])

    def test_holds_and_old_answers_are_waited_out(self):
        plant = self.started()
        for seq, mode in [(2, HOLD), (1, TRACK), (2, HOLD)]:
            self.controller.command(seq, mode, tau=(9.0, 9.0, 9.0))
        self.controller.command(2)
        self.assertEqual(list(plant.send(Q, QD).tau), [4.0, 5.0, 6.0])

    def test_a_reset_begins_an_episode_and_time_goes_on(self):
        plant = self.started()
        self.controller.command(2, RESET, episode=5)
        command = plant.send(Q, QD)
        self.assertTrue(command.reset and not command.track)
        self.controller.command(3, episode=5)
        plant.send(Q, QD)
        self.assertEqual(self.controller.state()[:3], [2, 0, 2_000_000])
        self.assertEqual(self.controller.state()[:3], [3, 5, 3_000_000])

    def test_stop_has_no_torque(self):
        plant = self.started()
        self.controller.command(0, STOP)
        command = plant.send(Q, QD)
        self.assertTrue(command.stop)
        self.assertIsNone(command.tau)

    def test_silence_is_an_error(self):
        with mock.patch.object(skillet_plant, "SILENCE_S", 0.1):
            plant = self.started()
            self.fails("nothing from the controller for 0.1 s", plant.send, Q, QD)

    def test_a_controller_that_reads_nothing_is_an_error(self):
        with mock.patch.object(skillet_plant, "SILENCE_S", 0.1):
            plant = self.started()
            plant._socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 1)
            with self.assertRaises(PlantError) as caught:
                for seq in range(2, 10_000):
                    self.controller.command(seq)
                    plant.send(Q, QD)
            self.assertIn("read nothing for 0.1 s", str(caught.exception))

    def test_a_controller_that_died_is_an_error(self):
        plant = self.started()
        self.controller.line.close()
        self.fails("the controller is gone", plant.send, Q, QD)

    def test_a_controller_that_dies_before_it_reads_is_an_error(self):
        plant = self.started()
        plant._send_sample(Q, QD)
        self.controller.line.close()
        self.fails("the controller is gone", plant.send, Q, QD)

    def test_a_refusal_is_told_at_any_time(self):
        plant = self.started()
        plant._send_sample(Q, QD)
        self.controller.welcome("it sent a sample of episode 3")
        self.controller.line.close()  # with the sample unread: a reset of the connection
        self.fails("episode 3", plant.send, Q, QD)

    def test_messages_of_another_length_kind_or_mode_are_errors(self):
        for message in [struct.pack("<Q", 4), struct.pack("<13Q", 9, *[0] * 12), b"x", bytes(4000)]:
            with self.subTest(length=len(message)):
                plant = self.started()
                self.controller.line.send(message)
                self.fails("unexpected message", plant.send, Q, QD)
        plant = self.started()
        self.controller.command(2, mode=7)
        self.fails("mode 7", plant.send, Q, QD)

    def test_samples_of_another_length_are_errors(self):
        plant = self.started()
        self.fails("q, qd and tau take 3 numbers", plant.send, Q + [0.4], QD)
        self.fails("object_position 3", plant.send, Q, QD, object_position=(1, 2))
        self.fails("user at most 8", plant.send, Q, QD, user=[0.0] * 9)

    def test_measures_go_before_the_sample_and_once(self):
        plant = self.started()
        plant.measure("load_max", 3.5, "N")
        plant.measure("touched", True, "bool")
        for seq in (2, 3):
            self.controller.command(seq)
            plant.send(Q, QD)
        outcome = self.controller.receive()
        self.assertEqual(len(outcome), 1560)
        self.assertEqual(words(outcome[:24], "Q"), (5, 0, 2))
        self.assertEqual(outcome[24:88].replace(b"\0", b""), b"load_maxtouched")
        self.assertEqual(outcome[1048:1064].replace(b"\0", b""), b"Nbool")
        self.assertEqual(words(outcome[1304:1328], "d"), (3.5, 1.0, 0.0))
        self.assertEqual([self.controller.state()[0] for _ in range(2)], [2, 3])
        self.fails("at most 8", plant.measure, "x", 1.0, "furlongs/s")

    def test_a_real_plants_call_is_refused(self):
        self.fails("uses send()", self.started().exchange, Q, QD)


class RealPace(PlantTest):
    def real(self):
        return self.started(simulated=False)

    def test_the_last_torque_is_repeated_at_most_twice_then_held(self):
        plant = self.real()
        commands = [plant.exchange(Q, QD) for _ in range(4)]
        self.assertEqual([c.track for c in commands], [True, True, False, False])
        self.assertEqual([c.hold for c in commands], [False, False, True, True])
        self.assertIsNone(commands[2].tau)
        self.assertEqual(plant.n_unanswered, 4)
        self.assertEqual([self.controller.state()[5] for _ in range(4)], [0, 1, 2, 3])
        self.controller.command(5)
        self.assertTrue(plant.exchange(Q, QD).track, "the answer to the sample before counts")
        self.assertEqual(plant.n_unanswered, 4)

    def test_the_newest_of_several_answers_counts(self):
        plant = self.real()
        self.controller.command(1, tau=(1.0, 0.0, 0.0))
        self.controller.command(2, tau=(2.0, 0.0, 0.0))
        self.assertEqual(plant.exchange(Q, QD).tau[0], 2.0)

    def test_an_answer_that_has_expired_is_none(self):
        plant = self.real()
        self.controller.command(2, expires_ns=1_000)
        command = plant.exchange(Q, QD, t_ns=2_000)
        self.assertEqual((command.answers_seq, plant.n_unanswered), (1, 1))
        plant._last = plant._last._replace(expires_ns=2_500)
        self.assertTrue(plant.exchange(Q, QD, t_ns=3_000).hold, "it is not repeated beyond its end")

    def test_it_waits_for_the_answer_no_longer_than_told(self):
        plant = self.real()
        start = time.monotonic()
        plant.exchange(Q, QD, timeout=0.02)
        self.assertGreaterEqual(time.monotonic() - start, 0.02)

    def test_a_person_ends_a_reset(self):
        plant = self.real()
        self.controller.command(2, RESET, episode=4)
        command = plant.exchange(Q, QD)
        self.assertTrue(command.reset)
        self.assertEqual(list(command.tau), [4.0, 5.0, 6.0], "the arm is held meanwhile")
        plant.exchange(Q, QD)
        plant.reset_done()
        plant.exchange(Q, QD)
        self.assertEqual([self.controller.state()[1] for _ in range(3)], [0, 0, 4])

    def test_silence_and_death_are_errors(self):
        plant = self.real()
        with mock.patch.object(skillet_plant, "SILENCE_S", 0.0):
            self.fails("nothing from the controller", plant.exchange, Q, QD)
        self.controller.line.close()
        self.fails("the controller is gone", plant.exchange, Q, QD)

    def test_a_full_socket_counts_and_waits_for_nobody(self):
        plant = self.real()
        for _ in range(2_000):
            plant.exchange(Q, QD)
        self.assertEqual(plant.n_unanswered, 2_000)

    def test_a_simulated_plants_call_is_refused(self):
        self.fails("uses exchange()", self.real().send, Q, QD)


if __name__ == "__main__":
    unittest.main()
