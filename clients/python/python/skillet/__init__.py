"""Skillet from Python: search a robot skill, read sessions, evaluate policies, judge rollouts, connect plants.

    Search      proposes parameters and learns from their rewards
    Session     what `skillet learn` has stored, as arrays
    Sessions    several of them
    Policy      Eq. (5) as the control loop evaluates it
    judge       a reward in Python for `skillet learn`
    Task        rollouts of a built-in task, in a child process
    Cell        a running controller
    plant       your simulator or robot behind the controller (`skillet.plant.Plant`)
    envs        Gymnasium environments, one rollout a step

SI units throughout. Importing this package imports nothing else; each name loads what it needs.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from . import envs as envs, plant as plant
    from ._cell import Cell as Cell
    from ._judge import judge as judge, Rollout as Rollout
    from ._policy import Evaluation as Evaluation, Policy as Policy
    from ._search import Mode as Mode, Search as Search, Trial as Trial
    from ._session import Session as Session, SessionError as SessionError, Sessions as Sessions
    from ._task import Outcome as Outcome, Task as Task
    from ._tool import ToolError as ToolError

_HOMES = {
    "Cell": "_cell",
    "judge": "_judge", "Rollout": "_judge",
    "Evaluation": "_policy", "Policy": "_policy",
    "Mode": "_search", "Search": "_search", "Trial": "_search",
    "Session": "_session", "SessionError": "_session", "Sessions": "_session",
    "Outcome": "_task", "Task": "_task",
    "ToolError": "_tool",
}
_MODULES = ("envs", "plant")

__all__ = [*_HOMES, *_MODULES]


def __getattr__(name: str):
    if name in _MODULES:
        return import_module(f".{name}", __name__)
    if name not in _HOMES:
        raise AttributeError(f"module 'skillet' has no attribute '{name}'")
    value = getattr(import_module(f".{_HOMES[name]}", __name__), name)
    globals()[name] = value
    return value


def __dir__():
    return sorted([*globals(), *__all__])
