"""Rollouts of a built-in task: the tool runs them in a child process, bit for bit those of a session."""

import json
import os
import subprocess
from typing import Any, Mapping, NamedTuple, Optional, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _tool
from ._policy import Policy
from ._repr import brief
from ._session import PATH_DTYPE

Floats = NDArray[np.float64]


class Outcome(NamedTuple):
    """What came of a rollout."""

    reward: float
    success: bool
    measures: dict[str, float]
    """By name; units are `Task.units`."""
    fault: int
    """0, or the first fault of the loop."""
    path: Optional[NDArray[np.void]]
    """Every tenth tick, (n,), if it was asked for; see `Session.path`."""

    def __repr__(self) -> str:
        return brief(self, *self._fields)


class Task:
    """A task with its world, loop and judge: pancake, landscape, skittles, archery, obstacle, via-points, ball-in-a-cup.

        with skillet.Task("pancake") as task:
            outcome = task.run(task.start)

    config   a configuration file (TOML) instead of the task's defaults
    options  `task.options` of the task, such as {"start": "hanging"}; see `skillet task list`
    """

    def __init__(self, name: str = "pancake", *, config: Optional[Union[str, os.PathLike]] = None,
                 options: Optional[Mapping[str, str]] = None):
        arguments = ["task", "serve", name, "--json"]
        arguments += ["--config", os.fspath(config)] if config is not None else []
        for option, value in (options or {}).items():
            arguments += ["--option", f"{option}={value}"]
        self._arguments = tuple(arguments)
        self._child = subprocess.Popen([_tool.find(), *arguments], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                                       stderr=subprocess.PIPE, text=True)
        assert self._child.stdin and self._child.stdout
        self._to, self._from = self._child.stdin, self._child.stdout
        about = self._read()
        self.name: str = about["task"]
        self.about: str = about["about"]
        self.units: dict[str, str] = about["measures"]
        """Unit of every measure by its name."""
        self.start: Floats = np.array(about["start"])
        """θ where a search begins, (D,)."""
        self.directions: Floats = np.array(about["directions"], dtype=np.float64).reshape(len(self.start), -1)
        """Directions to explore along, (D, k): θ = start + directions @ e, with e about 1 in size."""
        self.box: Optional[tuple[Floats, Floats]] = about["box"] and tuple(np.array(side) for side in about["box"])
        """(low, high), (D,) each, if a box is known."""
        self.learner: dict[str, Any] = about["learner"]
        """`[learner]` of its configuration."""
        self._demonstrations = about["demonstrations"]

    def run(self, theta: Union[ArrayLike, Policy], path: bool = False) -> Outcome:
        """One rollout of θ, (D,), or of a policy; with `path` its path as well."""
        request: dict[str, Any] = {"path": path}
        if isinstance(theta, Policy):
            request["policy"] = theta.fields
        else:
            request["theta"] = np.asarray(theta, dtype=np.float64).tolist()
        answer = self._ask(request)
        rows = None
        if answer.get("path") is not None:
            flat = np.array(answer["path"], dtype="<f4").reshape(-1, 20)
            rows = np.frombuffer(flat.tobytes(), dtype=PATH_DTYPE)
        return Outcome(answer["reward"], answer["success"], answer["measures"], answer["fault_code"], rows)

    def policy(self, theta: ArrayLike) -> Policy:
        """The policy of θ, (D,)."""
        answer = self._ask({"decode": np.asarray(theta, dtype=np.float64).tolist()})
        return Policy.from_json(json.dumps(answer["policy"]))

    def search(self, method: Optional[str] = None, *, seed: int = 1, settings: Optional[Mapping[str, Any]] = None):
        """The search that `skillet learn` would run on this task: the same seed gives the same trials, bit for bit.

        With another method, or other `settings` of it, everything else stays as the task has it. `aim` does without the
        task's prediction of its measures, which only the tool has.
        """
        from ._search import Search
        search = dict(self.learner["search"], method=method or self.learner["search"]["method"])
        search[search["method"]] = {**search.get(search["method"], {}), **(settings or {})}
        return Search._as_configured({**self.learner, "seed": seed, "search": search}, self._demonstrations)

    def _ask(self, request: dict[str, Any]) -> dict[str, Any]:
        if self._to.closed:
            raise ValueError(f"{self.name}: this task was closed: make another one")
        try:
            line = json.dumps(request, allow_nan=False)
        except ValueError:
            raise ValueError(f"{self.name}: theta holds nan or inf: give finite numbers") from None
        try:
            self._to.write(line + "\n")
            self._to.flush()
        except BrokenPipeError:
            pass  # why it ended is read below
        answer = self._read()
        if "refused" in answer:
            raise ValueError(f"{self.name}: {answer['refused']}")
        return answer

    def _read(self) -> dict[str, Any]:
        line = self._from.readline()
        value = json.loads(line) if line.startswith("{") else {}
        if line and "error" not in value:
            return value
        stdout, stderr = self._child.communicate()
        _tool.answer(line + stdout, stderr, self._child.returncode or 2, self._arguments)
        raise _tool.ToolError(f"`skillet {' '.join(self._arguments)}` has ended", 2)

    def close(self) -> None:
        """Ends the child."""
        if not self._to.closed:
            self._child.communicate()

    def __repr__(self) -> str:
        return f"<Task {self.name}: {len(self.start)} parameters{', closed' if self._to.closed else ''}>"

    def __enter__(self) -> "Task":
        return self

    def __exit__(self, *_) -> None:
        self.close()

    def __del__(self) -> None:
        child = getattr(self, "_child", None)
        if child is not None and child.poll() is None:
            child.kill()
            child.wait()
