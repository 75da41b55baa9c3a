"""Searches: propose θ, learn from rewards. The code is the learner's own: the same seed gives the same bits."""

import json
import math
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any, Iterable, Mapping, NamedTuple, Optional, Sequence, Union, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._repr import brief
from ._skillet import Core

if TYPE_CHECKING:
    from ._policy import Policy

FORMAT = 2
Floats = NDArray[np.float64]


class Trial(NamedTuple):
    """Parameters to try."""

    rollout: int
    """Number of the rollout, from 1."""
    theta: Floats
    """θ, (D,)."""

    def __repr__(self) -> str:
        return brief(self, "rollout", "theta")


class Mode(NamedTuple):
    """A solution the search has found."""

    prior: float
    """πᵢ; the modes' priors sum to one."""
    mean: Floats
    """μᵢ, (D,)."""
    covariance: Floats
    """Σᵢ, (D, D)."""
    n_trials: int
    """Trials that belong to it."""
    best_rollout: Optional[int]
    best_reward: Optional[float]
    """Its best trial; None if none belongs to it."""
    tolerance: Optional[float]
    """Expected reward when θ is executed with the search's noise; None without trials nearby."""

    def __repr__(self) -> str:
        return brief(self, "prior", "n_trials", "best_rollout", "best_reward", "tolerance", "mean")


class Told(NamedTuple):
    """A trial that has ended."""

    rollout: int
    theta: Floats
    reward: float
    """NaN if it failed."""
    success: bool
    failed: bool
    measured: list[Optional[float]]
    reason: str
    asked_after: int
    """How many trials had ended when it was asked for."""

    def __repr__(self) -> str:
        return brief(self, "rollout", *(("failed", "reason") if self.failed else ("reward", "success")), "theta")


class Search:
    """Proposes θ and learns from rewards.

        search = skillet.Search("power", start=[0.0, 0.0], seed=1)
        for _ in range(200):
            trial = search.ask()
            search.tell(trial, reward(trial.theta))

    method      power, aim, tempered, regions, niching, algorithm1, cem, pi2, rwr, reinforce, enac, random
    start       where the search begins, (D,); the middle of the box when None
    seed        the same seed and trials give the same proposals, bit for bit
    box         (low, high), (D,) each: known to hold the solutions; needed by regions and niching
    unit        size of one unit of noise in each parameter, (D,); 1 when None
    directions  directions to explore along, (D, k), instead of `unit`
    reward_map  {"exp": scale} or {"shift": s} for methods that refuse negative rewards
    settings    settings of the method, as in `[learner.search.METHOD]`

    Several trials may be pending at once; they may be told in any order.
    """

    def __init__(self, method: str = "power", *, start: Optional[ArrayLike] = None, seed: int = 1,
                 box: Optional[tuple[ArrayLike, ArrayLike]] = None, unit: Optional[ArrayLike] = None,
                 directions: Optional[ArrayLike] = None,
                 reward_map: Union[str, Mapping[str, float], None] = None,
                 settings: Optional[Mapping[str, Any]] = None):
        low, high = (None, None) if box is None else (_floats("box", box[0]), _floats("box", box[1]))
        if start is None:
            if low is None or high is None or low.shape != high.shape:
                raise ValueError("start: give the point where the search begins, or a box (low, high)")
            start = low + 0.5 * (high - low)
        start = _floats("start", start)
        if low is None and method in ("regions", "niching"):
            raise ValueError(f"box: {method} searches a known box; give (low, high), or use tempered")
        if unit is not None and directions is not None:
            raise ValueError("unit and directions: give one of them")
        if unit is not None:
            directions = np.diag(np.broadcast_to(_floats("unit", unit, ndim=None), start.shape))
        if directions is not None:
            directions = _floats("directions", directions, ndim=2)
            if directions.shape[0] != len(start):
                raise ValueError(f"directions: {directions.shape[0]} rows for {len(start)} parameters")
        self._begin({
            "search": _search_settings(method, reward_map, settings), "seed": int(seed),
            "start": start.tolist(), "low": _list(low), "high": _list(high),
            "directions": _list(directions),
        })

    @classmethod
    def from_demonstrations(cls, files: Union[str, os.PathLike, Sequence[Union[str, os.PathLike]]],
                            method: str = "power", *, seed: int = 1,
                            reward_map: Union[str, Mapping[str, float], None] = None,
                            settings: Optional[Mapping[str, Any]] = None,
                            learner: Optional[Mapping[str, Any]] = None) -> "Search":
        """A search that begins at the policy fitted to a demonstration and explores along its directions.

        files    CSV files as `skillet demo convert` writes them: t_s, x_m, y_m, z_m, pitch_rad[, roll_rad, yaw_rad]
        learner  further settings of `[learner]`, such as task_dim, n_components, exploration

        `policy(theta)` makes a policy of what it proposes.
        """
        if isinstance(files, (str, os.PathLike)):
            files = [files]
        config = {"seed": int(seed), **(learner or {})}
        config["search"] = {**config.get("search", {}), **_search_settings(method, reward_map, settings)}
        texts = [[os.fspath(file), Path(file).read_text(encoding="utf-8")] for file in files]
        return cls._of({"learner": config, "demonstrations": texts})

    @classmethod
    def _of(cls, origin: dict[str, Any]) -> "Search":
        search = cls.__new__(cls)
        search._begin(origin)
        return search

    @classmethod
    def _as_configured(cls, learner: dict[str, Any], demonstrations: Sequence[Sequence[str]]) -> "Search":
        """The search of a session with the settings `[learner]`; no demonstrations where θ is an action."""
        if demonstrations:
            return cls._of({"learner": learner, "demonstrations": [list(pair) for pair in demonstrations]})
        action = learner["action"]
        low, high, unit = (action.get(key) or None for key in ("min", "max", "unit"))
        return cls._of({"search": learner["search"], "seed": learner["seed"], "start": action["start"], "low": low,
                        "high": high, "directions": _list(None if unit is None else np.diag(unit))})

    def _begin(self, origin: dict[str, Any]) -> None:
        self._origin = origin
        if "demonstrations" in origin:
            texts = [(name, text) for name, text in origin["demonstrations"]]
            self._core = Core.from_demonstrations(json.dumps(origin["learner"]), texts)
        else:
            low, high, directions = (
                None if origin[key] is None else _bytes(np.asarray(origin[key])) for key in ("low", "high", "directions"))
            start = _bytes(np.asarray(origin["start"]))
            self._core = Core.around(json.dumps(origin["search"]), origin["seed"], start, low, high, directions)
        self._targets = self._core.targets
        self._n_asked = 0
        self._pending: dict[int, Trial] = {}
        self._asked_after: dict[int, int] = {}
        self._told: list[Told] = []

    @property
    def dim(self) -> int:
        """D, the number of parameters."""
        return self._core.dim

    @property
    def settings(self) -> dict[str, Any]:
        """All settings of the search, defaults included."""
        return json.loads(self._core.settings)

    @property
    def pending(self) -> list[Trial]:
        """Trials that were asked for and have neither been told nor failed."""
        return list(self._pending.values())

    @property
    def told(self) -> list[Told]:
        """Trials that have ended, in the order they were told."""
        return list(self._told)

    @property
    def best(self) -> Optional[Told]:
        """The trial with the highest reward, the first of equals; None before the first."""
        learnt = [trial for trial in self._told if not trial.failed]
        return max(learnt, key=lambda trial: trial.reward, default=None)

    @property
    def mean(self) -> Floats:
        """Centre of the distribution proposals are drawn from, (D,)."""
        return _array(self._core.mean())

    @property
    def std(self) -> Floats:
        """Its standard deviations, (D,)."""
        return _array(self._core.snapshot(self._n_asked + 1)[1])

    @overload
    def ask(self) -> Trial: ...
    @overload
    def ask(self, n: int) -> list[Trial]: ...

    def ask(self, n: Optional[int] = None) -> Union[Trial, list[Trial]]:
        """The next trial; with `n` a list of the next n, to be run in any order."""
        if n is not None:
            return [self.ask() for _ in range(n)]
        self._n_asked += 1
        return self._ask(self._n_asked)

    def _ask(self, rollout: int) -> Trial:
        theta = _array(self._core.ask(rollout))
        theta.flags.writeable = False
        self._pending[rollout] = Trial(rollout, theta)
        self._asked_after[rollout] = len(self._told)
        return self._pending[rollout]

    def tell(self, trial: Union[Trial, int], reward: float, success: bool = False, *,
             measures: Optional[Mapping[str, float]] = None, theta: Optional[ArrayLike] = None) -> None:
        """Learns from a trial, or from the number of one.

        reward    finite; larger is better
        success   the task's own verdict, where it has one
        measures  by name, for the targets of `aim`
        theta     what was executed, (D,), if it is not what was proposed
        """
        pending = self._take(trial)
        reward = float(reward)
        if not math.isfinite(reward):
            raise ValueError(f"trial {pending.rollout}: the reward is {reward}: rewards are finite; "
                             "call fail(trial) for a rollout without one")
        told = pending.theta if theta is None else _floats("theta", theta)
        self._learn(Told(pending.rollout, told, reward, bool(success), False,
                         self._measured(measures or {}), "", self._asked_after[pending.rollout]))

    def fail(self, trial: Union[Trial, int], reason: str = "") -> None:
        """Sets a trial aside that gave no reward: a broken recording, a robot that stopped. Not learnt."""
        pending = self._take(trial)
        self._learn(Told(pending.rollout, pending.theta, math.nan, False, True, [], reason,
                         self._asked_after[pending.rollout]))

    def _take(self, trial: Union[Trial, int]) -> Trial:
        rollout = trial.rollout if isinstance(trial, Trial) else int(trial)
        if rollout not in self._pending:
            why = "was already reported" if any(told.rollout == rollout for told in self._told) else "was not proposed"
            raise ValueError(f"trial {rollout} {why}: pending are {list(self._pending) or 'none'}")
        return self._pending[rollout]

    def _learn(self, told: Told) -> None:
        if told.failed:
            self._core.withdraw(told.rollout)
        else:
            self._core.tell(told.rollout, _bytes(told.theta), told.reward, told.success, told.measured)
        del self._pending[told.rollout], self._asked_after[told.rollout]
        self._told.append(told)

    def _measured(self, measures: Mapping[str, float]) -> list[Optional[float]]:
        def value(name: str, when: Optional[str]) -> Optional[float]:
            there = when is None or bool(measures.get(when))
            return float(measures[name]) if there and name in measures else None

        return [value(name, when) for name, when in self._targets]

    def modes(self) -> list[Mode]:
        """What the search has found, at least one, the highest prior first."""
        rows = self._core.modes()
        shape = (self.dim, self.dim)
        return [Mode(row["prior"], _array(row["mean"]), _array(row["covariance"]).reshape(shape), row["n_trials"],
                     row["best_rollout"], row["best_reward"], row["tolerance"]) for row in rows]

    def policy(self, theta: Optional[ArrayLike] = None) -> "Policy":
        """The policy of θ, (D,), or of the mean; only where the search began from demonstrations."""
        from ._policy import Policy
        theta = self._core.mean() if theta is None else _bytes(_floats("theta", theta))
        return Policy.from_json(self._core.decode(theta))

    def save(self, path: Union[str, os.PathLike]) -> None:
        """Writes settings, seed and all trials as JSON; never leaves half a file."""
        state = {
            "skillet_search": FORMAT, **self._origin, "asked": self._n_asked,
            "pending": [[trial.rollout, trial.theta.tolist(), self._asked_after[trial.rollout]]
                        for trial in self._pending.values()],
            "trials": [_row(told) for told in self._told], "mean": self.mean.tolist(),
        }
        path = Path(path)
        draft = path.with_name(path.name + ".new")
        draft.write_text(json.dumps(state, allow_nan=False), encoding="utf-8")
        os.replace(draft, path)

    @classmethod
    def load(cls, path: Union[str, os.PathLike]) -> "Search":
        """The search that was saved: asks and tells it again in the same order, and checks that it comes to the same
        pending proposals and the same mean."""
        try:
            state = json.loads(Path(path).read_text(encoding="utf-8"))
            found = state["skillet_search"]
        except (ValueError, TypeError, KeyError):
            raise ValueError(f"{path}: not a search saved by Search.save") from None
        if found != FORMAT:
            raise ValueError(f"{path}: format {found} instead of {FORMAT}: load it with the version that saved it")
        keys = ("search", "seed", "start", "low", "high", "directions", "learner", "demonstrations")
        search = cls._of({key: state[key] for key in keys if key in state})
        search._replay([_from_row(row) for row in state["trials"]],
                       [(rollout, after) for rollout, _, after in state["pending"]])
        search._n_asked = state["asked"]
        pending = {rollout: theta for rollout, theta, _ in state["pending"]}
        if {trial.rollout: trial.theta.tolist() for trial in search.pending} != pending:
            raise ValueError(f"{path}: this version of skillet does not come to the same proposals from the same "
                             "trials: load it with the version that saved it")
        if search.mean.tolist() != state["mean"]:
            raise ValueError(f"{path}: this version of skillet does not come to the same mean from the same "
                             "trials: load it with the version that saved it")
        return search

    def _replay(self, trials: Sequence[Told], pending: Iterable[tuple[int, int]]) -> None:
        """Asks for each rollout when as many trials have ended as then, and tells the trials in their order. `pending`
        are rollouts that have not ended, each with how many trials had when it was asked for."""
        asked: dict[int, list[int]] = {}
        for rollout, after in [*((told.rollout, told.asked_after) for told in trials), *pending]:
            asked.setdefault(after, []).append(rollout)
        for after in range(len(trials) + 1):
            for rollout in sorted(asked.get(after, [])):
                self._ask(rollout)
            if after < len(trials):
                if (rollout := trials[after].rollout) not in self._pending:
                    raise ValueError(f"trial {rollout} was told before it was asked for")
                self._learn(trials[after])

    def __repr__(self) -> str:
        method = self.settings["method"]
        return f"<Search {method}: {self.dim} parameters, {len(self._told)} told, {len(self._pending)} pending>"


def _search_settings(method: str, reward_map: Any, settings: Optional[Mapping[str, Any]]) -> dict[str, Any]:
    config: dict[str, Any] = {"method": method}
    if settings:
        config[method] = dict(settings)
    if reward_map is not None:
        config["reward_map"] = reward_map
    return config


def _row(told: Told) -> dict[str, Any]:
    row: dict[str, Any] = {"rollout": told.rollout, "asked_after": told.asked_after, "theta": told.theta.tolist()}
    if told.failed:
        return {**row, "failed": told.reason}
    return {**row, "reward": told.reward, "success": told.success, "measured": told.measured}


def _from_row(row: dict[str, Any]) -> Told:
    failed = "failed" in row
    return Told(row["rollout"], np.array(row["theta"]), row.get("reward", math.nan), row.get("success", False),
                failed, row.get("measured", []), row.get("failed", ""), row["asked_after"])


def _floats(name: str, values: ArrayLike, ndim: Optional[int] = 1) -> Floats:
    array = np.array(values, dtype=np.float64)
    if ndim is not None and array.ndim != ndim:
        raise ValueError(f"{name}: give {'a vector' if ndim == 1 else 'a matrix'}, not shape {array.shape}")
    return array


def _list(array: Optional[Floats]) -> Optional[list]:
    return None if array is None else array.tolist()


def _bytes(array: Floats) -> bytes:
    return array.astype("<f8", copy=False).tobytes()


def _array(data: bytes) -> Floats:
    return np.frombuffer(data, dtype="<f8").copy()
