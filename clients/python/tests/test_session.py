"""Sessions as arrays: a file of the learner's own schema, read while it is written."""

import json
import re
import sqlite3
import sys
import tempfile
import unittest
from pathlib import Path
from unittest import mock

import numpy as np

import skillet
from skillet import _session

ROOT = Path(__file__).parents[3]
STORE = ROOT / "learner/src/store"
POLICY = json.dumps({
    "task_dim": 3, "activation": "time", "duration_s": 0.5, "decay_rate": 0.0, "damping": 28.0,
    "orientation_stiffness": 400.0, "orientation_damping": 40.0,
    "components": [{"center": 0.1, "width": 0.1, "attractor": [0.5, 0.0, 0.3, 0.0, 0.0, 0.0],
                    "stiffness": [[200.0, 0.0, 0.0], [0.0, 200.0, 0.0], [0.0, 0.0, 200.0]]}],
})


def create(folder, seed=1, n=4):
    """A session of n trials as the learner writes one; the connection stays open, as the learner's does."""
    folder.mkdir()
    file = folder / "session.db"
    connection = sqlite3.connect(file, isolation_level=None)
    connection.execute("PRAGMA journal_mode = WAL")
    connection.executescript((STORE / "schema.sql").read_text())
    connection.execute(f"PRAGMA application_id = {_session.APPLICATION_ID}")
    connection.execute(f"PRAGMA user_version = {_session.FORMAT}")
    meta = {"task": "pancake", "seed": str(seed), "measures": json.dumps([["apex_m", "m"], ["caught", "bool"]]),
            "config_toml": "[task]\nname = \"pancake\"\n", "learner": json.dumps({"seed": seed})}
    connection.executemany("INSERT INTO meta (key, value) VALUES (?, ?)", meta.items())
    connection.execute("INSERT INTO policies (policy_id, kind, rollout, digest, message) VALUES (0, 'initial', 0, 'ff', ?)",
                       [POLICY])
    for rollout in range(1, n + 1):
        add(connection, rollout)
    return connection


def add(connection, rollout, theta=None):
    theta = (np.array([rollout, -1.0]) if theta is None else theta).tobytes()
    path = np.zeros(3, _session.PATH_DTYPE)
    path["t_s"], path["position_m"] = [0.0, 0.01, 0.02], rollout
    aside = int(rollout == 2)
    connection.execute("BEGIN")
    connection.execute("INSERT INTO policies (policy_id, kind, rollout, digest, message) VALUES (?, 'trial', ?, 'aa', ?)",
                       [rollout, rollout, POLICY])
    connection.execute("INSERT INTO proposals (rollout, theta) VALUES (?, ?)", [rollout, theta])
    connection.execute(
        "INSERT INTO trials (rollout, theta, reward, success, set_aside, policy_id, policy_digest, boot_id, applied_tick, "
        "fault, n_records, path) VALUES (?, ?, ?, ?, ?, ?, 'aa', 'bb', 7, 0, 30, ?)",
        [rollout, theta, 9.0 if aside else 0.25 * rollout, int(rollout > 2), aside, rollout, path.tobytes()])
    if not aside:
        connection.executemany("INSERT INTO measures (rollout, name, value) VALUES (?, ?, ?)",
                               [(rollout, "apex_m", 0.1 * rollout), (rollout, "caught", float(rollout > 2))])
    connection.execute("INSERT INTO searches (rollout, mean, std, floor) VALUES (?, ?, ?, 0.1)", [rollout, theta, theta])
    connection.execute("COMMIT")


class Case(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)

    def session(self, name="s7", **arguments):
        connection = create(self.folder / name, **arguments)
        self.addCleanup(connection.close)
        return connection, skillet.Session(self.folder / name)


class Reading(Case):
    def test_the_format_is_the_learners(self):
        text = (STORE / "mod.rs").read_text()
        self.assertEqual(int(re.search(r"FORMAT_VERSION: i64 = (\d+)", text)[1]), _session.FORMAT)
        application = re.search(r"APPLICATION_ID: i64 = (\w+)", text)[1]
        self.assertEqual(int(application, 16), _session.APPLICATION_ID)
        columns = re.search(r"COLUMNS: usize = (\d+)", (ROOT / "learner/src/path.rs").read_text())[1]
        self.assertEqual(_session.PATH_DTYPE.itemsize, 4 * int(columns))

    def test_trials_are_columns(self):
        _, session = self.session()
        self.assertEqual(session.trials["reward"].tolist(), [0.25, 9.0, 0.75, 1.0])
        self.assertEqual(session.trials["set_aside"].tolist(), [False, True, False, False])
        np.testing.assert_array_equal(session.measures["apex_m"], [0.1, np.nan, 0.1 * 3, 0.4])
        self.assertEqual((session.theta.shape, session.theta.dtype), ((4, 2), np.float64))
        self.assertEqual(session.best, 3, "what was set aside is not the best")
        self.assertEqual(session.units, {"apex_m": "m", "caught": "bool"})
        self.assertEqual((session.task, session.seed, len(session)), ("pancake", 1, 4))
        self.assertEqual(session.config["task"]["name"], "pancake")

    def test_cells_with_their_arms_and_plants(self):
        connection, session = self.session()
        self.assertEqual((session.trials["cell"].tolist(), session.cells), ([""] * 4, []))
        self.assertEqual((session.trials["told"].tolist(), session.cell_of(3)), ([1, 2, 3, 4], None))
        for place, rollout, cell in [(1, 2, "left"), (2, 1, "right"), (3, 4, "left"), (4, 3, "left")]:
            connection.execute("INSERT INTO told (place, rollout, cell) VALUES (?, ?, ?)", [place, rollout, cell])
        for cell, since, plant in [("left", 1, "mujoco"), ("right", 2, "mujoco"), ("left", 4, "real")]:
            connection.execute("INSERT INTO cells (cell, since, arm, urdf_sha256, plant) VALUES (?, ?, 'wam7', 'ab', ?)",
                               [cell, since, plant])
        session.refresh()
        self.assertEqual(session.trials["cell"].tolist(), ["right", "left", "left", "left"])
        self.assertEqual([session.cell_of(rollout).plant for rollout in (1, 2, 3, 4)],
                         ["mujoco", "mujoco", "real", "mujoco"])
        self.assertEqual(session.cell_of(3), ("left", 4, "wam7", "ab", "real"))
        with self.assertRaisesRegex(skillet.SessionError, "no trial 9"):
            session.cell_of(9)

    def test_paths_policies_and_the_search(self):
        _, session = self.session()
        path = session.path(3)
        self.assertEqual((path["position_m"].shape, path["position_m"][0, 0]), ((3, 3), 3.0))
        self.assertEqual(session.policies["kind"].tolist(), ["initial"] + ["trial"] * 4)
        self.assertEqual(session.policy().duration_s, 0.5)
        self.assertEqual(session.policy(0), session.policy(4))
        self.assertEqual(session.searches["mean"].shape, (4, 2))
        with self.assertRaisesRegex(skillet.SessionError, "no trial 9"):
            session.path(9)

    def test_modes(self):
        connection, session = self.session()
        self.assertEqual(session.modes, [])
        connection.execute("INSERT INTO modes (mode, prior, mean, covariance, policy_id, trials, best_reward) "
                           "VALUES (1, 0.75, ?, ?, 3, 4, 0.5)", [np.ones(2).tobytes(), np.eye(2).tobytes()])
        mode, = session.refresh().modes
        self.assertEqual((mode.prior, mode.covariance.shape, mode.best_rollout, mode.policy_id), (0.75, (2, 2), None, 3))

    def test_a_session_that_is_being_learnt(self):
        connection, session = self.session()
        add(connection, 5)
        self.assertEqual(len(session), 4, "a snapshot")
        self.assertEqual(len(session.refresh()), 5)
        connection.execute("BEGIN IMMEDIATE")
        self.assertEqual(len(skillet.Session(self.folder / "s7")), 5, "a writer blocks no reader")
        connection.execute("COMMIT")

    def test_nothing_is_written(self):
        connection, session = self.session()
        with _session._Reader(session.file) as read:
            with self.assertRaisesRegex(skillet.SessionError, "readonly"):
                read("DELETE FROM trials")

    def test_what_is_no_session_is_named(self):
        with self.assertRaisesRegex(skillet.SessionError, "no session here"):
            skillet.Session(self.folder / "nowhere")
        (self.folder / "text.db").write_text("no database at all, but long enough to be looked at " * 20)
        with self.assertRaisesRegex(skillet.SessionError, "text.db"):
            skillet.Session(self.folder / "text.db")
        connection, session = self.session()
        connection.execute("PRAGMA user_version = 3")
        with self.assertRaisesRegex(skillet.SessionError, "format 3 instead of"):
            session.refresh()


class Resuming(Case):
    """A session of 20 trials whose search is the Rust crate's; those of the tool itself are in test_tool.py."""

    def learnt(self):
        connection, _ = self.session(n=0)
        action = {"start": [0.5, -0.5], "unit": [], "min": [-2.0, -2.0], "max": [2.0, 2.0]}
        search = skillet.Search("power", start=action["start"], box=(action["min"], action["max"]), seed=6)
        learner = {"seed": 6, "action": action, "search": search.settings}
        connection.execute("UPDATE meta SET value = ? WHERE key = 'learner'", [json.dumps(learner)])
        for rollout in range(1, 21):
            trial = search.ask()
            add(connection, rollout)
            connection.execute("UPDATE trials SET theta = ?, reward = ? WHERE rollout = ?",
                               [trial.theta.tobytes(), float(trial.theta[0]), rollout])
            search.fail(trial) if rollout == 2 else search.tell(trial, float(trial.theta[0]), rollout > 2)
        return connection, search, skillet.Session(self.folder / "s7")

    def test_a_search_goes_on_where_the_session_stands(self):
        _, search, session = self.learnt()
        again = session.search()
        self.assertEqual(again.ask().theta.tolist(), search.ask().theta.tolist())
        self.assertTrue(again.told[1].failed)

    def test_a_session_of_several_cells_too(self):
        connection, _ = self.session(n=0)
        action = {"start": [0.5, -0.5], "unit": [], "min": [-2.0, -2.0], "max": [2.0, 2.0]}
        search = skillet.Search("power", start=action["start"], box=(action["min"], action["max"]), seed=6)
        learner = {"seed": 6, "action": action, "search": search.settings}
        connection.execute("UPDATE meta SET value = ? WHERE key = 'learner'", [json.dumps(learner)])
        waiting = search.ask(3)
        for place in range(1, 31):
            # The first one is never told.
            trial = waiting.pop(1 if place % 2 else 2)
            after = search._asked_after[trial.rollout]
            add(connection, trial.rollout, trial.theta)
            connection.execute("UPDATE trials SET reward = ?, set_aside = 0 WHERE rollout = ?",
                               [float(trial.theta[0]), trial.rollout])
            connection.execute("INSERT INTO asked (rollout, after) VALUES (?, ?)", [trial.rollout, after])
            connection.execute("INSERT INTO told (place, rollout, cell) VALUES (?, ?, ?)",
                               [place, trial.rollout, "left" if place % 2 else "right"])
            search.tell(trial, float(trial.theta[0]), trial.rollout > 2)
            waiting.append(search.ask())
        for trial in search.pending:
            connection.execute("INSERT INTO proposals (rollout, theta) VALUES (?, ?)",
                               [trial.rollout, trial.theta.tobytes()])
            connection.execute("INSERT INTO asked (rollout, after) VALUES (?, ?)",
                               [trial.rollout, search._asked_after[trial.rollout]])
        again = skillet.Session(self.folder / "s7").search()
        told = [trial.rollout for trial in search.told]
        self.assertEqual([trial.rollout for trial in again.told], told)
        self.assertEqual(again.pending[0].theta.tolist(), search.pending[0].theta.tolist())
        self.assertEqual(again.mean.tolist(), search.mean.tolist())
        connection.execute("UPDATE asked SET after = after + 9 WHERE rollout = 25")
        with self.assertRaisesRegex(skillet.SessionError, "comes out otherwise"):
            skillet.Session(self.folder / "s7").search()

    def test_what_does_not_come_out_again_is_named(self):
        connection, _, session = self.learnt()
        connection.execute("UPDATE trials SET theta = ? WHERE rollout = 7", [np.zeros(2).tobytes()])
        with self.assertRaisesRegex(skillet.SessionError, "rollout 7"):
            session.refresh().search()
        connection.execute("INSERT INTO wishes (after, text) VALUES (3, 'apex_m > 0.3')")
        with self.assertRaisesRegex(skillet.SessionError, "--where"):
            session.refresh().search()
        connection.execute("DELETE FROM wishes")
        connection.execute("INSERT INTO ratings (letter, after, rollout, rating) VALUES ('a', 3, 2, 7.5)")
        with self.assertRaisesRegex(skillet.SessionError, "people rated"):
            session.refresh().search()
        self.assertEqual(session.ratings, [(3, 2, 7.5)])


class Several(Case):
    def test_sessions_below_a_folder_are_one_table(self):
        for seed in (1, 2):
            self.session(f"s{seed}", seed=seed, n=seed + 2)
        sessions = skillet.Sessions(self.folder)
        self.assertEqual([session.seed for session in sessions], [1, 2])
        self.assertEqual(sessions.trials["session"].tolist(), ["s1"] * 3 + ["s2"] * 4)
        self.assertEqual(len(skillet.Sessions([self.folder / "s1", sessions[1]])), 2)
        with self.assertRaisesRegex(skillet.SessionError, "no session"):
            skillet.Sessions([])


class Optional(Case):
    def test_what_is_missing_is_named_with_how_to_install_it(self):
        _, session = self.session()
        with mock.patch.dict(sys.modules, {"pandas": None, "matplotlib": None}):
            with self.assertRaisesRegex(ImportError, r"pip install 'skillet-robot\[table\]'"):
                session.frame()
            with self.assertRaisesRegex(ImportError, r"pip install 'skillet-robot\[plot\]'"):
                session.plot_learning()

    def test_a_table(self):
        try:
            import pandas  # noqa: F401
        except ImportError:
            self.skipTest("pandas is not installed")
        _, session = self.session()
        frame = session.frame()
        self.assertEqual(frame.loc[4, "apex_m"], 0.4)

    def test_a_curve(self):
        try:
            import matplotlib
        except ImportError:
            self.skipTest("matplotlib is not installed")
        matplotlib.use("agg")
        _, session = self.session()
        self.assertEqual(session.plot_learning().get_ylabel(), "reward")
        self.assertEqual(skillet.Sessions(self.folder).plot_learning().get_xlabel(), "rollout")


if __name__ == "__main__":
    unittest.main()
