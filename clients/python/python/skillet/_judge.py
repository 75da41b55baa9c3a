"""A reward in Python: answers the lines in which `skillet learn` sends its rollouts. Standard library only."""

import json
import sys
from typing import IO, Any, Callable, NamedTuple, Optional

from ._repr import brief


class Rollout(NamedTuple):
    """What is known of a rollout."""

    rollout: int
    """Its number, from 1."""
    measures: dict[str, float]
    """What the task measured of it, by name; SI units."""
    path: Optional[str]
    """File with its ticks; None if it has none."""

    @property
    def ticks(self) -> Any:
        """Its ticks, a NumPy structured array, (n,)."""
        import numpy
        if self.path is None:
            raise ValueError(f"rollout {self.rollout} has no path")
        return numpy.load(self.path, mmap_mode="r", allow_pickle=False)

    def __repr__(self) -> str:
        return brief(self, *self._fields)


def judge(function: Callable[[Rollout], Any], lines: Optional[IO[str]] = None, out: Optional[IO[str]] = None) -> None:
    """Judges rollouts until there are no more: call it at the end of a program that is given to `skillet learn`.

        skillet.judge(lambda rollout: -rollout.measures["distance_m"])

    The function returns a reward, (reward, success), or a dict with `reward` and optionally `success` and
    `measures`, numbers of its own by name. An exception in it sets the rollout aside, with its text.
    What it prints goes to standard error.
    """
    lines, out = lines or sys.stdin, out or sys.stdout
    printed, sys.stdout = sys.stdout, sys.stderr
    try:
        for line in lines:
            if line.strip():
                out.write(json.dumps(_answer(function, json.loads(line)), allow_nan=False) + "\n")
                out.flush()
    finally:
        sys.stdout = printed


def _answer(function: Callable[[Rollout], Any], request: dict[str, Any]) -> dict[str, Any]:
    number = request["rollout"]
    try:
        rollout = Rollout(number, request.get("measures", {}), request.get("path"))
        return {"rollout": number, **_verdict(function(rollout))}
    except Exception as error:  # whatever the function does, the session goes on
        return {"rollout": number, "error": f"{type(error).__name__}: {error}"}


def _verdict(value: Any) -> dict[str, Any]:
    if isinstance(value, dict):
        unknown = set(value) - {"reward", "success", "measures"}
        if unknown or "reward" not in value:
            raise ValueError(f"the judge returned {sorted(value)}: use reward, success, measures")
        verdict = dict(value)
    elif isinstance(value, tuple):
        verdict = dict(zip(("reward", "success"), value, strict=True))
    else:
        verdict = {"reward": value}
    verdict["reward"] = _finite("the reward", verdict["reward"])
    if "success" in verdict:
        verdict["success"] = bool(verdict["success"])
    if "measures" in verdict:
        verdict["measures"] = {str(name): _finite(name, number) for name, number in verdict["measures"].items()}
    return verdict


def _finite(name: str, value: Any) -> float:
    number = float(value)
    if number - number != 0.0:
        raise ValueError(f"{name} is {number}: return a finite number")
    return number
