"""The blocks of docs/python.md that need the package run, and are as short as the page promises. Those that need
only the standard library run in tests/commands_in_documents.rs; those that need the tool are marked as text."""

import json
import os
import re
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import numpy as np

import skillet
from test_session import Case, ROOT, create

BLOCKS = re.findall(r"^```py\n(.*?)^```", (ROOT / "docs/python.md").read_text(), re.S | re.M)


def block(word):
    found, = [text for text in BLOCKS if word in text]
    return found


class Blocks(Case):
    def run_block(self, text, stdin=""):
        done = subprocess.run([sys.executable, "-c", text], cwd=self.folder, input=stdin, capture_output=True, text=True,
                              env={**os.environ, "MPLBACKEND": "agg"})
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        return done.stdout

    def learnt(self):
        connection = create(self.folder / "s7", n=0)
        search = skillet.Search("power", start=[0.5, -0.5], seed=6)
        learner = {"seed": 6, "action": {"start": [0.5, -0.5], "unit": [], "min": [], "max": []},
                   "search": search.settings}
        connection.execute("UPDATE meta SET value = ? WHERE key = 'learner'", [json.dumps(learner)])
        from test_session import add
        for rollout in range(1, 9):
            trial = search.ask()
            add(connection, rollout, trial.theta)
            search.fail(trial) if rollout == 2 else search.tell(trial, 0.25 * rollout, rollout > 2)
        connection.close()

    def test_lengths(self):
        for word, most in [("search.ask()\n    reward", 8), ("plot_learning", 3), ("skillet.judge", 10)]:
            lines = [line for line in block(word).splitlines() if line.strip()]
            self.assertLessEqual(len(lines), most, block(word))

    def test_a_search_loop(self):
        self.assertIn("[", self.run_block(block("search.ask()\n    reward")))

    def test_a_session(self):
        self.learnt()
        said = self.run_block("import skillet\n" + block("session.units"))
        self.assertIn("pancake", said)
        self.run_block("import skillet\n" + block("policy.evaluate"))
        self.assertTrue((self.folder / "higher.toml").exists())

    def test_a_curve(self):
        try:
            import matplotlib  # noqa: F401
        except ImportError:
            self.skipTest("matplotlib is not installed")
        self.learnt()
        self.run_block(block("plot_learning"))
        self.assertTrue((self.folder / "learning.png").exists())

    def test_a_judge(self):
        path = self.folder / "rollout.npy"
        np.save(path, np.zeros(3, dtype=[("t_s", "f8"), ("tau", "f8", 7)]))
        requests = [{"rollout": 1, "measures": {"apex_m": 0.5, "caught": 1.0}, "path": str(path)},
                    {"rollout": 2, "measures": {"apex_m": 0.25, "caught": 0.0}, "path": str(path)}, {"rollout": 3}]
        said = self.run_block(block("skillet.judge"), "".join(json.dumps(request) + "\n" for request in requests))
        first, second, third = map(json.loads, said.splitlines())
        self.assertEqual((first["reward"], first["success"]), (0.5, True))
        self.assertEqual((second["reward"], second["success"]), (0.25, False))
        self.assertIn("apex_m", third["error"])


class Importing(unittest.TestCase):
    def test_importing_imports_nothing_else(self):
        program = "import sys, skillet; print([name for name in ('numpy', 'sqlite3', 'matplotlib') if name in sys.modules])"
        said = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True).stdout
        self.assertEqual(said.strip(), "[]")

    def test_every_name_is_there(self):
        for name in skillet.__all__:
            if name != "envs":
                self.assertIsNotNone(getattr(skillet, name), name)
        with self.assertRaises(AttributeError):
            skillet.nothing

    def test_the_plant_is_the_single_file(self):
        self.assertEqual(Path(skillet.plant.__file__).read_text(),
                         (ROOT / "clients/python/skillet_plant.py").read_text())


if __name__ == "__main__":
    unittest.main()
