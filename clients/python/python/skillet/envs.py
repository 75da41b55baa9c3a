"""Gymnasium environments of the built-in tasks. One step is one rollout: a contextual bandit, as episodic policy
search has it. The action chooses the policy, the reward is the rollout's, and the episode ends.

    import gymnasium, skillet.envs                  # importing it registers them; needs the tool `skillet`
    env = gymnasium.make("skillet/Pancake-v0")      # or alone: gymnasium.make("skillet.envs:skillet/Pancake-v0")
    env.reset(seed=1)
    observation, reward, terminated, truncated, info = env.step(env.action_space.sample())

Action: e, (k,), in units of the search's noise: θ = start + directions @ e, for a task with a known box the box scaled
to [−1, 1]. Observation: nothing, (0,). Info: every measure by name, `success`, `fault` and `theta`.
"""

from typing import Any, Mapping, Optional

import numpy as np

from ._task import Task

try:
    import gymnasium
except ImportError:
    raise ImportError("environments need gymnasium: pip install 'skillet-robot[gym]'") from None

ENVIRONMENTS = {
    "skillet/Pancake-v0": "pancake",
    "skillet/BallInACup-v0": "ball-in-a-cup",
    "skillet/ViaPoints-v0": "via-points",
    "skillet/Obstacle-v0": "obstacle",
    "skillet/Skittles-v0": "skittles",
    "skillet/Archery-v0": "archery",
}
REACH = 10.0
"""Largest entry of an action along directions: ten standard deviations of a search's first draws."""
WIDE = 1e6
"""A box as wide as this has no end."""


class TaskEnv(gymnasium.Env):
    """A task as an environment. `env.unwrapped.task` is the task; arguments as of `skillet.Task`."""

    metadata: dict[str, Any] = {"render_modes": []}

    def __init__(self, task: str, options: Optional[Mapping[str, str]] = None, config: Optional[str] = None):
        self.task = Task(task, options=options, config=config)
        k = self.task.directions.shape[1]
        # Demonstrations bound their attractors only: such a box is no scale for actions.
        box = self.task.box
        self._box = box if box is not None and np.abs(box).max() < WIDE and k == len(self.task.start) else None
        self._reach = REACH if self._box is None else 1.0
        self.action_space = gymnasium.spaces.Box(-self._reach, self._reach, (k,), dtype=np.float64)
        self.observation_space = gymnasium.spaces.Box(-1.0, 1.0, (0,), dtype=np.float64)

    def theta(self, action: np.ndarray) -> np.ndarray:
        """θ, (D,), of an action, (k,)."""
        action = np.clip(np.asarray(action, dtype=np.float64), -self._reach, self._reach)
        if self._box is not None:
            low, high = self._box
            return low + 0.5 * (action + 1.0) * (high - low)
        return self.task.start + self.task.directions @ action

    def reset(self, *, seed: Optional[int] = None, options: Optional[dict[str, Any]] = None):
        """Nothing to reset: every rollout begins in a fresh world, and rollouts are deterministic."""
        super().reset(seed=seed)
        return np.zeros(0), {}

    def step(self, action: np.ndarray):
        theta = self.theta(action)
        outcome = self.task.run(theta)
        info = {**outcome.measures, "success": outcome.success, "fault": outcome.fault, "theta": theta}
        return np.zeros(0), outcome.reward, True, False, info

    def close(self) -> None:
        self.task.close()


for _name, _task in ENVIRONMENTS.items():
    gymnasium.register(id=_name, entry_point="skillet.envs:TaskEnv", kwargs={"task": _task})
