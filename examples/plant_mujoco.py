"""The pancake world in MuJoCo, as a plant for a Skillet controller: pip install mujoco numpy

    skillet learn pancake --plant-program "python3 examples/plant_mujoco.py"

or, beside a controller that waits for a plant (`skillet controller --cell kitchen --plant external --pace max`):

    python3 examples/plant_mujoco.py --cell kitchen

The model is robots/wam7/wam7_pancake.xml. Your own takes the same steps: hinges named as in the URDF, one
motor a hinge, a body with a free joint named "pancake", and a keyframe named "start".
"""

import argparse
import json
import os
import sys
from pathlib import Path

import mujoco

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "clients/python"))

from skillet_plant import Plant, PlantError  # noqa: E402

PERIOD_S = 0.001


class PancakeWorld:
    """MuJoCo's world, read and driven through the numbers that the protocol carries."""

    def __init__(self, path):
        self.model = mujoco.MjModel.from_xml_path(str(path))
        self.data = mujoco.MjData(self.model)
        joints = [self.model.joint(i) for i in range(self.model.njnt)]
        hinges = [joint for joint in joints if joint.type[0] == mujoco.mjtJoint.mjJNT_HINGE]
        self.joint_names = [joint.name for joint in hinges]
        self.torque_limits = self.model.actuator_ctrlrange[:, 1]
        # The model steps more finely than the controller, with the torque held.
        self.n_steps = round(PERIOD_S / self.model.opt.timestep)
        if abs(self.n_steps * self.model.opt.timestep - PERIOD_S) > 1e-12:
            sys.exit(f"{path}: its time step {self.model.opt.timestep} s does not divide 1 ms")
        # Views: MuJoCo keeps these arrays where they are.
        n, data = len(hinges), self.data
        free = self.model.joint("pancake").qposadr[0]
        self.q, self.qd, self.tau = data.qpos[:n], data.qvel[:n], data.qfrc_actuator[:n]
        self.position, self.quaternion = data.qpos[free : free + 3], data.qpos[free + 3 : free + 7]
        self.start = self.model.key("start").id
        self.settle(json.loads(os.environ.get("SKILLET_PLANT_SETTINGS", "{}")), free)
        self.reset()

    def settle(self, settings, free):
        """What the table [plant] of the configuration says of the pancake, where `skillet` passes it on."""
        body, model = self.model.body("pancake").id, self.model
        heavier = settings.get("pancake_mass_kg", model.body_mass[body]) / model.body_mass[body]
        model.body_mass[body] *= heavier
        model.body_inertia[body] *= heavier
        x, y = settings.get("pancake_offset_m", (0.0, 0.0))
        # The pan is level at the start, and its axes are the world's.
        model.key_qpos[self.start, free : free + 2] += (x, y)
        if "friction" in settings:
            model.geom_friction[:, 0] = settings["friction"]
        mujoco.mj_setConst(model, self.data)

    def reset(self):
        """The start posture at rest, the pancake just above the pan. Clears the solver's memory too."""
        mujoco.mj_resetDataKeyframe(self.model, self.data, self.start)

    def step(self, tau):
        """One period with the joint torques `tau`, N·m."""
        self.data.ctrl[:] = tau
        mujoco.mj_step(self.model, self.data, self.n_steps)

    def sample(self):
        """What a State says beside positions and speeds."""
        return {
            "tau": self.tau,
            "object_position": self.position,
            "object_quaternion": self.quaternion,
            # Nothing but pan and pancake can collide.
            "in_contact": self.data.ncon > 0,
        }


def serve(world, plant):
    """Steps the world until the controller ends."""
    command = plant.start(world.q, world.qd, **world.sample())
    while not command.stop:
        if command.reset:
            world.reset()
        else:
            world.step(command.tau)
        command = plant.send(world.q, world.qd, **world.sample())


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cell", help="cell of the controller, 'skillet' when absent")
    parser.add_argument("--model", type=Path, default=ROOT / "robots/wam7/wam7_pancake.xml")
    parser.add_argument("--urdf", type=Path, default=ROOT / "robots/wam7/wam7_pan.urdf",
                        help="URDF that the model was made from; the controller compares it")
    options = parser.parse_args()
    world = PancakeWorld(options.model)
    try:
        with Plant("mujoco", world.joint_names, PERIOD_S, tracks_object=True, deterministic=True,
                   urdf=options.urdf, torque_limits=world.torque_limits,
                   cell=options.cell) as plant:
            serve(world, plant)
    except PlantError as error:
        sys.exit(f"plant_mujoco: {error}")
    except KeyboardInterrupt:
        pass


if __name__ == "__main__":
    main()
