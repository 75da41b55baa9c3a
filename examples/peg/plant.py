"""A peg and a plate with a hole in MuJoCo, as a plant for a Skillet controller; see docs/peg.md."""

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
# Nobody puts the plate back exactly: how far the hole is from where it was demonstrated, m.
ASIDE_M = (0.002, 0.004)
# A force sensor shows no shorter peaks than this, s.
SENSOR_S = 0.01
# The outcome is sent every so many samples; the last one counts.
TELL_EVERY = 20


class World:
    def __init__(self, seed):
        self.seed = seed
        self.model = mujoco.MjModel.from_xml_path(str(HERE / "peg.xml"))
        self.data = mujoco.MjData(self.model)
        self.n_steps = round(PERIOD_S / self.model.opt.timestep)
        # Views: MuJoCo keeps these arrays where they are.
        self.q, self.qd = self.data.qpos[:7], self.data.qvel[:7]
        self.peg, self.hole = self.data.body("peg").xpos, self.data.mocap_pos[0]
        self.pressure = self.data.sensor("force").data
        self.reset(0)

    def reset(self, rollout):
        """The start posture at rest. Where the hole is follows from seed and rollout alone."""
        mujoco.mj_resetDataKeyframe(self.model, self.data, self.model.key("start").id)
        random = numpy.random.default_rng((self.seed, rollout))
        aside, angle = random.uniform(*ASIDE_M), random.uniform(0.0, 2.0 * numpy.pi)
        self.hole[:2] += aside * numpy.cos(angle), aside * numpy.sin(angle)
        self.n_samples = self.force_n = self.largest_n = 0
        mujoco.mj_forward(self.model, self.data)

    def step(self, tau):
        """One period with the joint torques `tau`, N·m."""
        self.data.ctrl[:] = tau
        mujoco.mj_step(self.model, self.data, self.n_steps)
        self.n_samples += 1
        self.force_n += (self.pressure[0] - self.force_n) * PERIOD_S / (SENSOR_S + PERIOD_S)
        self.largest_n = max(self.largest_n, self.force_n)

    def tell(self, plant):
        """What the judge must know and only this program does."""
        plant.measure("depth_m", self.hole[2] - self.peg[2], "m")
        plant.measure("force_n", self.largest_n, "N")


def main():
    settings = json.loads(os.environ.get("SKILLET_PLANT_SETTINGS", "{}"))
    world = World(settings.get("seed", 0))
    limits = world.model.actuator_ctrlrange[:, 1]
    names = [world.model.joint(i).name for i in range(7)]
    with Plant("peg in MuJoCo", names, PERIOD_S, deterministic=True,
               urdf=HERE / "wam7_peg.urdf", torque_limits=limits) as plant:
        command = plant.start(world.q, world.qd)
        while not command.stop:
            if command.reset:
                world.reset(command.rollout)
            else:
                world.step(command.tau)
            if world.n_samples % TELL_EVERY == 0:
                world.tell(plant)
            command = plant.send(world.q, world.qd)


if __name__ == "__main__":
    main()
