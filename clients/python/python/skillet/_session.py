"""Sessions as arrays. A session is an SQLite file; it is read with the standard library, read-only, while it is
being learnt or afterwards. No connection stays open: a learner never waits for a reader."""

import json
import os
import sqlite3
from pathlib import Path
from typing import TYPE_CHECKING, Any, Iterable, NamedTuple, Optional, Union

import numpy as np
from numpy.typing import NDArray

from ._repr import brief

if TYPE_CHECKING:
    from ._policy import Policy
    from ._search import Search

APPLICATION_ID = 0x534B_4C54
FORMAT = 8
PATH_DTYPE = np.dtype([
    ("t_s", "<f4"), ("position_m", "<f4", 3), ("rotation_rad", "<f4", 3), ("object_position_m", "<f4", 3),
    ("object_quaternion", "<f4", 4), ("attractor", "<f4", 6),
])
"""A row of a path: time since the start of the movement (0 before); the tip's position and rotation vector (pitch,
roll, yaw); the object's position and unit quaternion (w, x, y, z); Σ hᵢ μᵢ (x, y, z, pitch, roll, yaw). World frame."""

_TRIALS = ("rollout", "reward", "success", "set_aside", "fault", "n_records", "policy_id", "applied_tick")
_FLAGS = ("success", "set_aside")
_ORDERED = ("asked_after", "told", "cell")
_ORDER = "COALESCE(asked.after, rollout - 1), COALESCE(told.place, rollout), COALESCE(told.cell, '')"
Table = dict[str, NDArray]
_Path = Union[str, os.PathLike]


class SessionError(Exception):
    """A session cannot be read; the text says what to do."""


class StoredCell(NamedTuple):
    """What a cell drove from a trial on."""

    cell: str
    """Its name; empty where there was but one."""
    since: int
    """Place of the first such trial in the order in which they were told, `trials["told"]`."""
    arm: str
    """Name of the robot in its URDF; empty without an arm."""
    urdf_sha256: str
    plant: str
    """The simulation, or what the plant in another process calls itself, with its version."""

    def __repr__(self) -> str:
        short = self._replace(urdf_sha256=self.urdf_sha256[:8] + "…" * bool(self.urdf_sha256))
        return brief(short, "cell", "since", "arm", "plant", "urdf_sha256")


class StoredMode(NamedTuple):
    """A solution the session found; written when its search stops."""

    number: int
    prior: float
    mean: NDArray[np.float64]
    """θ, (D,)."""
    covariance: NDArray[np.float64]
    """(D, D)."""
    best_rollout: Optional[int]
    best_reward: Optional[float]
    tolerance: Optional[float]
    policy_id: int

    def __repr__(self) -> str:
        return brief(self, "number", "policy_id", "prior", "best_rollout", "best_reward", "tolerance", "mean")


class Session:
    """A consistent snapshot of a session: its folder, or its `session.db`.

        session = skillet.Session("sessions/pancake-1")
        session.trials["reward"].max()

    `refresh()` reads what has been learnt since.
    """

    def __init__(self, path: _Path):
        path = Path(path)
        self.file = path / "session.db" if path.is_dir() else path
        self.name = path.name if path.is_dir() else path.parent.name
        self.refresh()

    def refresh(self) -> "Session":
        """Reads the file again."""
        with _Reader(self.file) as read:
            self._meta = dict(read("SELECT key, value FROM meta"))
            columns = ", ".join(_TRIALS)
            rows = read(f"SELECT {columns}, {_ORDER}, theta FROM trials LEFT JOIN asked USING (rollout) "
                        "LEFT JOIN told USING (rollout) ORDER BY rollout")
            self._in_flight: list[tuple[int, int]] = read(
                "SELECT rollout, COALESCE(asked.after, rollout - 1) FROM proposals LEFT JOIN asked USING (rollout) "
                "WHERE rollout NOT IN (SELECT rollout FROM trials) ORDER BY rollout")
            self.cells: list[StoredCell] = [StoredCell(*row) for row in read(
                "SELECT cell, since, arm, urdf_sha256, plant FROM cells ORDER BY since, cell")]
            """What the cells drove, each from a trial on."""
            measured = read("SELECT rollout, name, value FROM measures")
            self._searches = read("SELECT rollout, mean, std, floor FROM searches ORDER BY rollout")
            self._modes = read("SELECT mode, prior, mean, covariance, best_rollout, best_reward, tolerance, "
                               "policy_id FROM modes ORDER BY mode")
            self._policies = read("SELECT policy_id, kind, rollout, digest FROM policies ORDER BY policy_id")
            self.wishes: list[str] = [text for text, in read("SELECT text FROM wishes ORDER BY after")]
            """What a success was wished to be like (`--where`), beside what its judge says."""
            self.ratings: list[tuple[int, int, Optional[float]]] = read(
                "SELECT after, rollout, rating FROM ratings ORDER BY id")
            """What people said: known after so many trials, rollout, 0 to 10 or None where it was withdrawn."""
            (self._n_added,), = read("SELECT count(*) FROM demonstrations")
            self.events: list[tuple[str, str]] = read("SELECT kind, text FROM events ORDER BY id")
        self.theta = _matrix(row[-1] for row in rows)
        """θ of every trial, (n, D), scaled units."""
        self.trials = self._table(rows, measured)
        """One array a column, (n,): rollout, reward, success (by the judge, without ratings), set_aside, fault, n_records, policy_id,
        applied_tick, asked_after (how many trials were known when it was proposed), told (its place in the order in
        which trials came back), cell (which executed it), and every measure by its name (NaN where there is none).
        `pandas.DataFrame(session.trials)`."""
        return self

    def _table(self, rows: list[tuple], measured: list[tuple]) -> Table:
        kinds: dict[str, type] = {"reward": np.float64, "cell": np.str_, **dict.fromkeys(_FLAGS, np.bool_)}
        table: Table = {name: np.array([row[i] for row in rows], dtype=kinds.get(name, np.int64))
                 for i, name in enumerate(_TRIALS + _ORDERED)}
        place = {rollout: i for i, rollout in enumerate(table["rollout"].tolist())}
        for name in self.units:
            table[name] = np.full(len(rows), np.nan)
        for rollout, name, value in measured:
            if name in table and rollout in place:
                table[name][place[rollout]] = value
        return table

    @property
    def task(self) -> str:
        return self._meta["task"]

    @property
    def seed(self) -> int:
        return int(self._meta["seed"])

    @property
    def units(self) -> dict[str, str]:
        """Unit of every measure by its name, in order; "bool" for truth values (1 or 0)."""
        return dict(json.loads(self._meta["measures"]))

    @property
    def config(self) -> dict[str, Any]:
        """The configuration file it was started with."""
        from ._policy import toml
        return toml(self._meta["config_toml"])

    @property
    def learner(self) -> dict[str, Any]:
        """`[learner]` of its configuration, defaults included."""
        return json.loads(self._meta["learner"])

    @property
    def measures(self) -> Table:
        """The measures alone, (n,) each."""
        return {name: self.trials[name] for name in self.units}

    @property
    def searches(self) -> Table:
        """The search after each trial: rollout (n,), mean (n, D), std (n, D) and floor (n,), scaled units."""
        rows = self._searches
        return {"rollout": np.array([row[0] for row in rows], dtype=np.int64), "mean": _matrix(row[1] for row in rows),
                "std": _matrix(row[2] for row in rows), "floor": np.array([row[3] for row in rows], dtype=np.float64)}

    @property
    def modes(self) -> list[StoredMode]:
        """What the search had found when it last stopped, the highest prior first; empty while it has never."""
        found = []
        for number, prior, mean, covariance, *rest in self._modes:
            mean = _vector(mean)
            found.append(StoredMode(number, prior, mean, _vector(covariance).reshape(len(mean), -1), *rest))
        return found

    @property
    def policies(self) -> Table:
        """policy_id, kind ("initial", "trial", "mode"), rollout and digest, (n,) each; `policy(id)` reads one."""
        names = ("policy_id", "kind", "rollout", "digest")
        return {name: np.array([row[i] for row in self._policies]) for i, name in enumerate(names)}

    def policy(self, policy_id: Optional[int] = None) -> "Policy":
        """A policy by its id, 0 for the initial one; that of the best trial when None."""
        from ._policy import Policy
        if policy_id is None:
            policy_id = int(self.trials["policy_id"][self.best])
        rows = self._one("SELECT message FROM policies WHERE policy_id = ?", policy_id)
        if not rows:
            raise SessionError(f"{self.file}: no policy {policy_id}: see session.policies")
        return Policy.from_json(rows[0][0])

    @property
    def best(self) -> int:
        """Index of the trial with the highest reward, the first of equals."""
        usable = np.flatnonzero(~self.trials["set_aside"])
        if len(usable) == 0:
            raise SessionError(f"{self.file}: no trial yet: wait for the first, then refresh()")
        return int(usable[np.argmax(self.trials["reward"][usable])])

    def path(self, rollout: int) -> NDArray[np.void]:
        """Every tenth tick of a rollout, (n,) of `PATH_DTYPE`: path["t_s"], path["position_m"] (n, 3), …"""
        rows = self._one("SELECT path FROM trials WHERE rollout = ?", rollout)
        if not rows:
            raise SessionError(f"{self.file}: no trial {rollout}: it has {len(self.theta)} trials")
        return np.frombuffer(rows[0][0], dtype=PATH_DTYPE)

    def cell_of(self, rollout: int) -> Optional[StoredCell]:
        """What executed a rollout; None if its cell told nothing."""
        found = np.flatnonzero(self.trials["rollout"] == rollout)
        if len(found) == 0:
            raise SessionError(f"{self.file}: no trial {rollout}: it has {len(self.theta)} trials")
        cell, told = self.trials["cell"][found[0]], self.trials["told"][found[0]]
        drove = [row for row in self.cells if row.cell == cell and row.since <= told]
        return drove[-1] if drove else None

    def _one(self, query: str, key: int) -> list[tuple]:
        with _Reader(self.file) as read:
            return read(query, int(key))

    def search(self) -> "Search":
        """The `Search` as it stands after these trials; it proposes them again, bit for bit, or raises. A rollout that
        has not come back is pending in it if later ones have.

        What it is told from now on stays in Python: the session is not changed.
        """
        from ._resume import resume
        return resume(self)

    def frame(self):
        """`trials` as a pandas DataFrame, indexed by rollout."""
        return _pandas().DataFrame(self.trials).set_index("rollout")

    def plot_learning(self, axes=None):
        """Rewards by rollout, successes filled, with the best so far; returns the matplotlib axes."""
        axes = axes or _pyplot().subplots(layout="constrained")[1]
        learnt = ~self.trials["set_aside"]
        rollout, reward = self.trials["rollout"][learnt], self.trials["reward"][learnt]
        success = self.trials["success"][learnt]
        axes.plot(rollout[~success], reward[~success], "o", mfc="none", color="tab:grey", label="trial")
        axes.plot(rollout[success], reward[success], "o", color="tab:green", label="success")
        axes.step(rollout, np.maximum.accumulate(reward), where="post", color="tab:blue", label="best so far")
        axes.set(xlabel="rollout", ylabel="reward", title=f"{self.task}, seed {self.seed}")
        axes.legend()
        return axes

    def __len__(self) -> int:
        return len(self.theta)

    def __repr__(self) -> str:
        n = int(np.count_nonzero(self.trials["success"]))
        return f"<Session {self.file}: {self.task}, {len(self)} trials, {n} successes>"


class Sessions(list):
    """Several sessions: paths, or folders that hold sessions.

        skillet.Sessions("sessions").plot_learning()
    """

    def __init__(self, paths: Union[_Path, Iterable[Union[_Path, Session]]]):
        if isinstance(paths, (str, os.PathLike)):
            paths = [paths]
        super().__init__(session for path in paths for session in _below(path))
        if not self:
            raise SessionError("no session: give folders with a session.db in them, or in a folder below")

    @property
    def trials(self) -> Table:
        """Trials of all, one below the other, with the column `session`; NaN where a session lacks a measure."""
        names = list(dict.fromkeys(name for session in self for name in session.trials))
        table = {"session": np.repeat([session.name for session in self], [len(session) for session in self])}
        for name in names:
            table[name] = np.concatenate([
                session.trials.get(name, np.full(len(session), np.nan)) for session in self])
        return table

    def frame(self):
        """`trials` as a pandas DataFrame."""
        return _pandas().DataFrame(self.trials)

    def plot_learning(self, axes=None):
        """Median and quartiles of the best reward so far over the sessions; returns the matplotlib axes."""
        axes = axes or _pyplot().subplots(layout="constrained")[1]
        n = max(len(session) for session in self)
        best = np.full((len(self), n), np.nan)
        for row, session in zip(best, self):
            reward = np.where(session.trials["set_aside"], -np.inf, session.trials["reward"])
            row[:len(session)] = np.maximum.accumulate(reward)
        best[np.isneginf(best)] = np.nan
        columns = ~np.all(np.isnan(best), axis=0)
        low, median, high = np.nanquantile(best[:, columns], (0.25, 0.5, 0.75), axis=0)
        rollout = np.arange(1, n + 1)[columns]
        axes.fill_between(rollout, low, high, alpha=0.3, step="post", label="quartiles")
        axes.step(rollout, median, where="post", label=f"median of {len(self)}")
        axes.set(xlabel="rollout", ylabel="best reward so far")
        axes.legend()
        return axes

    def __repr__(self) -> str:
        tasks = ", ".join(dict.fromkeys(session.task for session in self))
        n = sum(int(np.count_nonzero(session.trials["success"])) for session in self)
        return f"<Sessions: {len(self)} of {tasks}, {sum(map(len, self))} trials, {n} successes>"


class _Reader:
    """A read-only connection for one consistent read."""

    def __init__(self, file: Path):
        if not file.is_file():
            raise SessionError(f"{file}: no session here: give the folder that `skillet learn --out` wrote")
        self._file = file

    def __enter__(self) -> "_Reader":
        uri = self._file.absolute().as_uri() + "?mode=ro"
        try:
            self._connection = sqlite3.connect(uri, uri=True, timeout=5.0, isolation_level=None)
            self._check()
            self._connection.execute("BEGIN")
        except sqlite3.Error as error:
            raise SessionError(f"{self._file}: {error}: is it a session.db, and readable?") from None
        return self

    def _check(self) -> None:
        pragma = lambda name: self._connection.execute(f"PRAGMA {name}").fetchone()[0]
        if pragma("application_id") != APPLICATION_ID:
            raise SessionError(f"{self._file}: not a Skillet session")
        if (found := pragma("user_version")) != FORMAT:
            raise SessionError(f"{self._file}: format {found} instead of {FORMAT}: an older session is converted when "
                               "`skillet trials` opens it; for a newer one update skillet-robot")

    def __call__(self, query: str, *parameters) -> list[tuple]:
        try:
            return self._connection.execute(query, parameters).fetchall()
        except sqlite3.Error as error:
            raise SessionError(f"{self._file}: {error}: check it with `skillet trials`") from None

    def __exit__(self, *_) -> None:
        self._connection.close()


def _below(path: Union[_Path, Session]) -> list[Session]:
    if isinstance(path, Session):
        return [path]
    folder = Path(path)
    if folder.is_dir() and not (folder / "session.db").exists():
        return [Session(file.parent) for file in sorted(folder.glob("*/session.db"))]
    return [Session(folder)]


def _vector(blob: bytes) -> NDArray[np.float64]:
    return np.frombuffer(blob, dtype="<f8")


def _matrix(blobs: Iterable[bytes]) -> NDArray[np.float64]:
    rows = [_vector(blob) for blob in blobs]
    return np.stack(rows) if rows else np.empty((0, 0))


def _pyplot():
    try:
        from matplotlib import pyplot
    except ImportError:
        raise ImportError("plots need matplotlib: pip install 'skillet-robot[plot]'") from None
    return pyplot


def _pandas():
    try:
        import pandas
    except ImportError:
        raise ImportError("tables need pandas: pip install 'skillet-robot[table]'; "
                          "without it, `trials` is a dict of arrays") from None
    return pandas
