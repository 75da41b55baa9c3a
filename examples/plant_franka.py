"""A Franka arm as a plant for a Skillet controller: pip install pylibfranka

    skillet controller --cell kitchen --config my_fr3.toml --plant external --pace plant
    python3 examples/plant_franka.py 172.16.0.2 --cell kitchen --urdf my_fr3.urdf

Untried on hardware: it has only been run against a stand-in for pylibfranka 0.21.3. Keep the stop button in reach.

pylibfranka 0.21 needs robot system 5.9 or newer, that is an FR3. robots/panda describes the older Panda: the same
kinematics, but other inertias and limits. Write a URDF of your arm first, and start with `skillet plant check --real`.
Enter the pan in Desk as the end effector (mass, centre, inertia). Otherwise the arm sinks whenever the driver holds it,
and the robot takes the weight of the pan for a contact.

Tasks that look at an object, as pancake does, need a camera. Import this file and call `main(look=...)`. `look` must
return at once: the last pose as arguments of `Plant.exchange`, {"object_position": p, "object_quaternion": w_x_y_z,
"in_contact": True}, in the frame of the arm's base, or {} if the object is not in sight.

Python uses up much of the millisecond. If the robot reports communication_constraints_violation even on a PREEMPT_RT
kernel, write this loop in C++ with clients/plant/include/skillet_plant.h.
"""

import argparse
import gc
import math
import os
import signal
import sys
import termios
import threading
import xml.etree.ElementTree
from concurrent.futures import ThreadPoolExecutor, wait
from pathlib import Path

from pylibfranka import FrankaException, RealtimeConfig, Robot, Torques

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "clients/python"))

from skillet_plant import Plant, PlantError  # noqa: E402

# How long a cycle waits for the answer to its own sample, before it uses the previous one.
PATIENCE_S = 0.0002
# Largest change of a torque per period, N·m; the robot stops at 1. Skillet limits its own rate, but the gravity
# subtracted here changes as well.
STEP = 0.999
# The driver's own hold, N·m/(rad/s) and N·m: a tenth of a torque limit per rad/s, as in the controller.
DAMPING = [8.7] * 4 + [1.2] * 3
DAMPING_MAX = [20.0] * 4 + [5.0] * 3
# When the arm counts as at rest: rad/s, and N·m on top of gravity. It gets this many cycles to come to rest.
REST_SPEED, REST_TORQUE, REST_CYCLES = 0.05, 2.0, 2000
# External torques, N·m, and forces, N and N·m, at which the robot stops itself. A throw may need more.
COLLISION_TORQUES = [40.0, 40.0, 36.0, 36.0, 32.0, 28.0, 24.0]
COLLISION_FORCES = [40.0, 40.0, 40.0, 50.0, 50.0, 50.0]


class Person:
    """Puts the object back and presses Enter. Runs in its own thread: a terminal may stall, the loop must not."""

    def __init__(self):
        self._is_asked, self._is_ready = threading.Event(), False
        threading.Thread(target=self._listen, daemon=True).start()

    def is_ready(self):
        """Prompts on the first call; true once Enter was pressed. Never waits."""
        is_ready, self._is_ready = self._is_ready, False
        if not is_ready:
            self._is_asked.set()
        return is_ready

    def _listen(self):
        while self._is_asked.wait():
            if sys.stdin.isatty():
                # Discard what was typed before the prompt.
                termios.tcflush(sys.stdin, termios.TCIFLUSH)
            print("Put the object back, step out of reach of the arm, then press Enter.", flush=True)
            if not os.read(sys.stdin.fileno(), 1024):
                print("plant_franka: stdin is closed, so nobody can confirm a reset", file=sys.stderr)
                return
            # In this order: the loop, between the two, must not ask again.
            self._is_ready = True
            self._is_asked.clear()


def damped(state):
    """The driver's own hold: −D q̇, clipped. The robot compensates gravity itself."""
    limits = zip(state.dq, DAMPING, DAMPING_MAX)
    return [max(-most, min(most, -damping * speed)) for speed, damping, most in limits]


def torques(command, state, model):
    """Torques for the robot, which adds gravity itself, whereas Skillet's torques include it."""
    if command.tau is None:
        return damped(state)
    tau = [tau - gravity for tau, gravity in zip(command.tau, model.gravity(state))]
    return tau if all(map(math.isfinite, tau)) else damped(state)


def write(control, state, wanted, is_last=False):
    """Sends `wanted`, limited in rate against the torques the robot applies now."""
    pairs = zip(wanted, state.tau_J_d)
    command = Torques([last + max(-STEP, min(STEP, new - last)) for new, last in pairs])
    command.motion_finished = is_last
    control.writeOnce(command)


def sample(state, look):
    return {"tau": state.tau_J, "t_ns": round(state.time.to_sec() * 1e9), **look()}


def drive(control, model, plant, person, look):
    """Exchanges samples for torques until the controller ends. Holds the arm while connecting."""
    state, _ = control.readOnce()
    starting = ThreadPoolExecutor(1).submit(plant.start, state.q, state.dq, **sample(state, look))
    while not wait([starting], 1e-4).done:
        state, _ = control.readOnce()
        write(control, state, damped(state))
    command = starting.result()
    while not command.stop:
        state, _ = control.readOnce()
        command = plant.exchange(state.q, state.dq, PATIENCE_S, **sample(state, look))
        write(control, state, torques(command, state, model))
        if command.reset and command.episode != plant.episode and person.is_ready():
            plant.reset_done()


def come_to_rest(control):
    """Ends torque control, damped; afterwards the robot holds itself."""
    for i in range(REST_CYCLES):
        state, _ = control.readOnce()
        is_slow = max(map(abs, state.dq)) < REST_SPEED
        is_last = i == REST_CYCLES - 1 or (is_slow and max(map(abs, state.tau_J_d)) < REST_TORQUE)
        write(control, state, damped(state), is_last)
        if is_last:
            return


def serve(robot, plant, person, look):
    model = robot.load_model()
    control = robot.start_torque_control()
    try:
        drive(control, model, plant, person, look)
    finally:
        # However the loop ended. If the robot ended it, this fails at once: it has already stopped itself.
        come_to_rest(control)


def main(arguments=None, look=None):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("robot", help="address of the robot")
    parser.add_argument("--cell", help="cell of the controller, 'skillet' when absent")
    parser.add_argument("--urdf", type=Path, default=ROOT / "robots/panda/panda_pan.urdf",
                        help="URDF of the arm; the controller compares it")
    parser.add_argument("--any-kernel", action="store_true", help="do without a real-time kernel")
    options = parser.parse_args(arguments)
    joints = [joint for joint in xml.etree.ElementTree.parse(options.urdf).iter("joint")
              if joint.get("type") == "revolute"]
    # SIGTERM ends the loop like Ctrl-C: the arm comes to rest first.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    # Created before the robot, which gives real-time priority to this thread and to threads started later.
    person = Person()
    # pylibfranka holds Python's global lock while it waits for the robot; this lets other threads in between.
    sys.setswitchinterval(1e-4)
    try:
        kernel = RealtimeConfig.kIgnore if options.any_kernel else RealtimeConfig.kEnforce
        robot = Robot(options.robot, kernel)
        robot.set_collision_behavior(COLLISION_TORQUES, COLLISION_TORQUES,
                                     COLLISION_FORCES, COLLISION_FORCES)
        limits = [float(joint.find("limit").get("effort")) for joint in joints]
        with Plant("franka", [joint.get("name") for joint in joints], simulated=False,
                   tracks_object=look is not None, urdf=options.urdf, torque_limits=limits,
                   cell=options.cell) as plant:
            gc.disable()
            serve(robot, plant, person, look or (lambda: {}))
    # Most errors of pylibfranka are RuntimeErrors.
    except (PlantError, RuntimeError, FrankaException) as error:
        sys.exit(f"plant_franka: {error}")
    except KeyboardInterrupt:
        pass


if __name__ == "__main__":
    main()
