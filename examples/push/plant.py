"""A box on a table in MuJoCo, as a plant for a Skillet controller; see docs/peg.md."""

import json
import os
import sys
from pathlib import Path

import mujoco
import numpy

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent.parent / "clients/python"))

from skillet_plant import Plant  # noqa: E402

PERIOD_S = 0.001
# Where the box should stop, m along x from where it is.
GOAL_M = 0.12
# Friction of the table, and how far to either side the box stands, m: different in every rollout.
FRICTION, ASIDE_M = (0.3, 0.5), 0.003
TELL_EVERY = 20


class World:
    def __init__(self, seed):
        self.seed = seed
        self.model = mujoco.MjModel.from_xml_path(str(HERE / "push.xml"))
        self.data = mujoco.MjData(self.model)
        self.n_steps = round(PERIOD_S / self.model.opt.timestep)
        self.q, self.qd = self.data.qpos[:7], self.data.qvel[:7]
        self.position, self.quaternion = self.data.qpos[7:10], self.data.qpos[10:14]
        self.pressure = self.data.sensor("force").data
        self.reset(0)

    def reset(self, rollout):
        mujoco.mj_resetDataKeyframe(self.model, self.data, self.model.key("start").id)
        random = numpy.random.default_rng((self.seed, rollout))
        self.model.geom("table").friction[0] = random.uniform(*FRICTION)
        self.position[1] += random.uniform(-ASIDE_M, ASIDE_M)
        self.goal = self.position + (GOAL_M, 0.0, 0.0)
        self.n_samples = self.largest_n = 0
        mujoco.mj_forward(self.model, self.data)

    def step(self, tau):
        """One period with the joint torques `tau`, N·m."""
        self.data.ctrl[:] = tau
        mujoco.mj_step(self.model, self.data, self.n_steps)
        self.n_samples += 1
        self.largest_n = max(self.largest_n, self.pressure[0])

    def tell(self, plant):
        plant.measure("miss_m", numpy.linalg.norm(self.position - self.goal), "m")
        plant.measure("turn_rad", 2 * numpy.arccos(min(abs(self.quaternion[0]), 1.0)), "rad")
        plant.measure("force_n", self.largest_n, "N")

    def sample(self):
        return {"object_position": self.position, "object_quaternion": self.quaternion,
                "in_contact": self.pressure[0] > 0.0}


def main():
    settings = json.loads(os.environ.get("SKILLET_PLANT_SETTINGS", "{}"))
    world = World(settings.get("seed", 0))
    limits = world.model.actuator_ctrlrange[:, 1]
    names = [world.model.joint(i).name for i in range(7)]
    with Plant("box in MuJoCo", names, PERIOD_S, tracks_object=True, deterministic=True,
               urdf=HERE.parent / "peg/wam7_peg.urdf", torque_limits=limits) as plant:
        command = plant.start(world.q, world.qd, **world.sample())
        while not command.stop:
            if command.reset:
                world.reset(command.rollout)
            else:
                world.step(command.tau)
            if world.n_samples % TELL_EVERY == 0:
                world.tell(plant)
            command = plant.send(world.q, world.qd, **world.sample())


if __name__ == "__main__":
    main()
