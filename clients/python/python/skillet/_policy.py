"""Policies: the springs of Eq. (5), ẍ = Σ hᵢ [Kᵢ (μᵢ − x) − κᵛ ẋ], or the linear systems of Eq. (2), evaluated by the
code of the control loop."""

import json
import os
import sys
from pathlib import Path
from typing import Any, NamedTuple, Optional, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._repr import brief
from ._skillet import Springs

COORDINATES = ("x", "y", "z", "pitch", "roll", "yaw")
"""Task coordinates: position in m, and the rotation vector of the tip in rad, world frame."""
Floats = NDArray[np.float64]


class Evaluation(NamedTuple):
    """A policy at one state, or at n of them: every shape then begins with n."""

    acceleration: Floats
    """ẍ, (6,), m/s² and rad/s². The loop turns it into torques with the arm's inertia."""
    attractor: Floats
    """Σ hᵢ μᵢ, (6,), m and rad; of systems x + ẋ/following where they yield ẋ, else x."""
    stiffness: Floats
    """Σ hᵢ Kᵢ, (6, 6), s⁻²: per unit mass. What is not learnt has the gain of the orientation. Of systems, −∂ẍ/∂x with
    the activations held."""
    activations: Floats
    """hᵢ, (N,); their sum is 1."""

    def __repr__(self) -> str:
        return brief(self, *self._fields)

    def force(self, inertia: ArrayLike) -> Floats:
        """Λ ẍ, (6,), N and N·m, for the inertia Λ (6, 6) at the tip, or one mass in kg (a point: forces only)."""
        inertia = np.asarray(inertia, dtype=np.float64)
        if inertia.ndim == 0:
            return inertia * self.acceleration * (np.arange(6) < 3)
        return self.acceleration @ inertia.T


class Policy:
    """A policy of springs, of linear systems, or the action vector of a task without arm.

        policy = skillet.Policy.read("policy.json")     # or .toml, as `skillet policy export` writes them
        policy.evaluate(0.2, x, xd).acceleration
    """

    def __init__(self, text: str):
        self._springs = Springs(text)
        self.fields: dict[str, Any] = json.loads(self._springs.json())
        """The policy as its JSON has it."""

    @classmethod
    def from_json(cls, text: str) -> "Policy":
        return cls(text)

    @classmethod
    def from_toml(cls, text: str) -> "Policy":
        return cls(_finite_json(toml(text)))

    @classmethod
    def read(cls, path: Union[str, os.PathLike]) -> "Policy":
        """From a JSON or TOML file; which it is shows in its first character."""
        text = Path(path).read_text(encoding="utf-8")
        try:
            return cls.from_json(text) if text.lstrip().startswith("{") else cls.from_toml(text)
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from None

    @classmethod
    def from_session(cls, path: Union[str, os.PathLike], policy_id: Optional[int] = None) -> "Policy":
        """From a session's folder: by id, or that of the best trial."""
        from ._session import Session
        return Session(path).policy(policy_id)

    @property
    def is_action(self) -> bool:
        return "action" in self.fields

    @property
    def is_systems(self) -> bool:
        """The policy is one of the linear systems of Eq. (2): see `fields["systems"]`."""
        return "systems" in self.fields

    @property
    def action(self) -> Floats:
        """The action vector, in the units of its world; empty for an arm's policy."""
        return np.array(self.fields.get("action", []), dtype=np.float64)

    @property
    def digest(self) -> str:
        """What names its parameters, as in a session's table of policies."""
        return f"{self._springs.digest:016x}"

    @property
    def task_dim(self) -> int:
        """Learnt coordinates d: the first of x, y, z, pitch, roll, yaw."""
        return self._of_arm("task_dim")

    @property
    def duration_s(self) -> float:
        return self._of_arm("duration_s")

    @property
    def centers(self) -> Floats:
        """Centres of the activations, (N,): s, or the phase when they decay."""
        return self._components("center")

    @property
    def widths(self) -> Floats:
        """Standard deviations of the activations, (N,), unit of `centers`."""
        return self._components("width")

    @property
    def attractors(self) -> Floats:
        """μᵢ, (N, 6), m and rad."""
        return self._components("attractor")

    @property
    def stiffness(self) -> Floats:
        """Kᵢ, (N, d, d), s⁻²."""
        return self._components("stiffness")

    def _components(self, key: str) -> Floats:
        return np.array([component[key] for component in self._of_springs("components")])

    def _of_springs(self, key: str) -> Any:
        if self.is_systems:
            raise ValueError('a policy of systems has no springs: see policy.fields["systems"]')
        return self._of_arm(key)

    def _of_arm(self, key: str) -> Any:
        if self.is_action:
            raise ValueError("this policy is an action vector without springs: see policy.action")
        return self.fields[key]

    def replace(self, **fields: ArrayLike) -> "Policy":
        """The same policy with other `attractors` (N, 6), `stiffness` (N, d, d), or any field of its JSON."""
        changed = json.loads(json.dumps(self.fields))
        for key, value in fields.items():
            name = {"attractors": "attractor", "stiffness": "stiffness", "centers": "center", "widths": "width"}.get(key)
            value = np.asarray(value).tolist() if not isinstance(value, str) else value
            if name is None:
                if key not in changed and key not in ("damping_ratio", "orientation"):
                    raise ValueError(f"{key}: a policy has {', '.join(changed)}")
                changed[key] = value
                continue
            if len(value) != len(self._of_springs("components")):
                raise ValueError(f"{key}: give {len(self.fields['components'])}, one a component")
            for component, part in zip(changed["components"], value):
                component[name] = part
        return Policy(_finite_json(changed))

    def evaluate(self, t: ArrayLike, x: ArrayLike, xd: ArrayLike) -> Evaluation:
        """Eq. (5), or Eq. (2) of systems, as the loop evaluates it, bit for bit.

        t    time since the start of the movement, s: a number, or (n,)
        x    task coordinates of the tip, m and rad: (6,), or (n, 6)
        xd   their velocities, m/s and rad/s: the same shape
        """
        t, x, xd = (np.asarray(value, dtype="<f8") for value in (t, x, xd))
        n = np.broadcast_shapes(t.shape, x.shape[:-1], xd.shape[:-1])
        if x.shape[-1:] != (6,) or xd.shape[-1:] != (6,) or len(n) > 1:
            raise ValueError(f"x and xd: give (6,) or (n, 6): {', '.join(COORDINATES)}; not {x.shape}, {xd.shape}")
        wide = lambda array, shape: np.broadcast_to(array, shape).tobytes()
        parts = self._springs.evaluate(wide(t, n), wide(x, (*n, 6)), wide(xd, (*n, 6)))
        shapes = ((6,), (6,), (6, 6), (-1,))
        return Evaluation(*(np.frombuffer(part, "<f8").reshape(*n, *shape) for part, shape in zip(parts, shapes)))

    def integrate(self, x: ArrayLike, xd: ArrayLike = (0.0,) * 6, dt: float = 0.001) -> tuple[Floats, Floats, Floats]:
        """What a free unit mass does that follows the policy alone: t (n,), x (n, 6), xd (n, 6).

        No arm, no limits, no object; for a rollout of those see `Task.run`.
        """
        n = round(self.duration_s / dt) + 1
        t: Floats = dt * np.arange(n, dtype=np.float64)
        xs, xds = np.empty((n, 6)), np.empty((n, 6))
        xs[0], xds[0] = x, xd
        for k in range(1, n):
            xds[k] = xds[k - 1] + dt * self.evaluate(t[k - 1], xs[k - 1], xds[k - 1]).acceleration
            xs[k] = xs[k - 1] + dt * xds[k]
        return t, xs, xds

    def to_json(self) -> str:
        """As `skillet policy export` prints it; numbers come back bit for bit."""
        return self._springs.json()

    def to_toml(self) -> str:
        """With units in comments; numbers come back bit for bit."""
        if self.is_action:
            return f"# in the units of its world\naction = {self.fields['action']!r}\n"
        units = {"task_dim": "learnt coordinates: the first of x, y, z, pitch, roll, yaw", "duration_s": "s",
                 "decay_rate": "s⁻¹", "damping": "s⁻¹", "orientation_stiffness": "s⁻²",
                 "orientation_damping": "s⁻¹", "damping_ratio": "spring i damps with 2ζ Kᵢ^½", "following": "s⁻¹"}
        law = "Σ hᵢ Kᵢ (μᵢ − x) − damping · ẋ"
        if self.is_systems:
            law = "Σ hᵢ [of_position · x + of_velocity · ẋ + of_drive · drive + offset]"
        lines = [f"# Eq. ({2 if self.is_systems else 5}): {self.fields.get('output', 'acceleration')} = {law}, world frame"]
        for key, value in self.fields.items():
            if key not in ("components", "systems"):
                lines.append(f"{key} = {json.dumps(value)}" + (f"  # {units[key]}" if key in units else ""))
        for system in self.fields.get("systems", []):
            lines += ["", "[[systems]]", *(f"{key} = {json.dumps(value)}" for key, value in system.items())]
        for component in self.fields.get("components", []):
            lines += ["", "[[components]]", f"center = {component['center']!r}", f"width = {component['width']!r}",
                      "# x, y, z in m; pitch, roll, yaw in rad", f"attractor = {component['attractor']!r}",
                      "# s⁻²", "stiffness = [", *(f"  {row!r}," for row in component["stiffness"]), "]"]
        return "\n".join(lines) + "\n"

    def write(self, path: Union[str, os.PathLike]) -> None:
        """As TOML if the name ends so, else as JSON."""
        text = self.to_toml() if os.fspath(path).endswith(".toml") else self.to_json()
        Path(path).write_text(text, encoding="utf-8")

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Policy) and self.digest == other.digest

    def __hash__(self) -> int:
        return hash(self.digest)

    def __repr__(self) -> str:
        if self.is_action:
            return f"<Policy: action of {len(self.action)} numbers>"
        kind, key = ("systems", "systems") if self.is_systems else ("springs", "components")
        return f"<Policy: {len(self.fields[key])} {kind} in {self.task_dim} coordinates, {self.duration_s:.6g} s>"


def toml(text: str) -> dict[str, Any]:
    """TOML as a dict; tomllib comes with Python 3.11."""
    if sys.version_info >= (3, 11):
        import tomllib
    else:
        import tomli as tomllib
    return tomllib.loads(text)


def _finite_json(fields: dict[str, Any]) -> str:
    try:
        return json.dumps(fields, allow_nan=False)
    except ValueError:
        raise ValueError("the policy holds nan or inf: use finite numbers") from None
