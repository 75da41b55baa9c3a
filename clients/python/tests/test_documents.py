"""Every block fenced `py` in the pages about Python runs by itself, and the reference lists every name. The blocks fenced
`python` need only the standard library: they run in tests/commands_in_documents.rs."""

import json
import os
import re
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import skillet
from test_session import POLICY, Case, ROOT, add, create
from test_tool import STAND_IN

PAGES = [*sorted((ROOT / "docs").glob("python*.md")), ROOT / "clients/python/README.md"]
BLOCKS = [text for page in PAGES for text in re.findall(r"^```py\n(.*?)^```", page.read_text(), re.S | re.M)]
NEEDS = {"plot_learning": "matplotlib", "gymnasium": "gymnasium"}
"""What must be installed for a block with that word in it."""


def block(word):
    found, = [text for text in BLOCKS if word in text]
    return found


def has(package):
    return subprocess.run([sys.executable, "-c", f"import {package}"], capture_output=True).returncode == 0


class Blocks(Case):
    """Blocks run in a folder with the session `s7` and the file `flip.toml`, and with a stand-in for the tool."""

    def setUp(self):
        super().setUp()
        self.learnt()
        (self.folder / "flip.toml").write_text(skillet.Policy.from_json(POLICY).to_toml())
        tool = self.folder / "skillet"
        tool.write_text(STAND_IN)
        tool.chmod(0o755)
        self.tool = str(tool)

    def run_block(self, text, stdin="", **environment):
        done = subprocess.run([sys.executable, "-c", text], cwd=self.folder, input=stdin, capture_output=True, text=True,
                              env={**os.environ, "MPLBACKEND": "agg", "SKILLET": self.tool, **environment})
        self.assertEqual((done.returncode, done.stderr), (0, ""), text)
        return done.stdout

    def learnt(self):
        connection = create(self.folder / "s7", n=0)
        search = skillet.Search("power", start=[0.5, -0.5], seed=6)
        learner = {"seed": 6, "action": {"start": [0.5, -0.5], "unit": [], "min": [], "max": []},
                   "search": search.settings}
        connection.execute("UPDATE meta SET value = ? WHERE key = 'learner'", [json.dumps(learner)])
        for rollout in range(1, 9):
            trial = search.ask()
            add(connection, rollout, trial.theta)
            search.fail(trial) if rollout == 2 else search.tell(trial, 0.25 * rollout, rollout > 2)
        mode, = search.modes()
        connection.execute("INSERT INTO modes (mode, prior, mean, covariance, policy_id, trials, best_reward) "
                           "VALUES (1, 1.0, ?, ?, 8, 7, 2.0)", [mode.mean.tobytes(), mode.covariance.tobytes()])
        connection.close()

    def test_each_runs_by_itself(self):
        for text in BLOCKS:
            with self.subTest(text=text):
                self.assertRegex(text, r"\A(import .*\n)+", "it begins with its imports")
                needed = {package for word, package in NEEDS.items() if word in text}
                if all(map(has, needed)):
                    said = self.run_block(text)
                    self.assertEqual(bool(said), "print(" in text)
        self.assertGreaterEqual(len(BLOCKS), 10)

    def test_no_page_has_code_that_does_not_run(self):
        for page in PAGES:
            fences = re.findall(r"^```(.*)\n(?:.*\n)*?```$", page.read_text(), re.M)
            self.assertLessEqual(set(fences), {"py", "python", "sh"}, page)

    def test_lengths(self):
        for word, most in [("search.ask()\n    reward", 8), ("plot_learning", 3), ("skillet.judge", 10)]:
            lines = [line for line in block(word).splitlines() if line.strip()]
            self.assertLessEqual(len(lines), most, block(word))

    def test_what_they_write(self):
        self.run_block(block("policy.evaluate"))
        self.assertTrue((self.folder / "higher.toml").exists())
        if has("matplotlib"):
            self.run_block(block("plot_learning"))
            self.assertTrue((self.folder / "learning.png").exists())

    def test_modes_are_short_at_the_prompt(self):
        self.assertIn("StoredMode(number=1, policy_id=8, prior=1, ", self.run_block(block("session.modes")))

    @unittest.skipUnless(os.environ.get("SKILLET"), "SKILLET names no built tool")
    def test_those_of_tasks_run_with_the_tool(self):
        for word in ("task.search", "task.directions", *(["gymnasium"] if has("gymnasium") else [])):
            self.assertIn("rollout=" if word == "task.search" else "", self.run_block(block(word), SKILLET=os.environ["SKILLET"]))

    @unittest.skipUnless(os.environ.get("SKILLET"), "SKILLET names no built tool")
    def test_the_judge_judges(self):
        (self.folder / "my_task.py").write_text(block("skillet.judge"))
        learn = [os.environ["SKILLET"], "learn", "pancake", "--seed", "7", "--rollouts", "12", "--judge", "my_task.py"]
        done = subprocess.run([*learn, "--out", "judged"], cwd=self.folder, capture_output=True, text=True,
                              env={**os.environ, "SKILLET_PYTHON": sys.executable})
        self.assertEqual(done.returncode, 0, done.stderr)
        trials = skillet.Session(self.folder / "judged").trials
        self.assertFalse(trials["set_aside"].any(), "the judge reads the fields that ticks have")
        self.assertTrue(trials["success"].any(), "the ticks were read")


class Reference(unittest.TestCase):
    def test_every_name_is_in_it(self):
        page = (ROOT / "docs/python-api.md").read_text()
        sections = dict(re.findall(r"^## (\w+)\n(.*?)(?=^## |\Z)", page, re.S | re.M))
        plant = skillet.plant
        homes = {"Search": ("Search", "Trial", "Mode"), "Session": ("Session", "Sessions", "SessionError"),
                 "Policy": ("Policy", "Evaluation"), "Task": ("Task", "Outcome"), "Cell": ("Cell", "ToolError"),
                 "Judges": ("judge", "Rollout"), "Plants": (plant.Plant, plant.Command, plant.PlantError)}
        listed = {name for names in homes.values() for name in names} | {"envs", "plant"}
        self.assertLessEqual(set(skillet.__all__), listed)
        for section, things in homes.items():
            names = set(re.findall(r"\w+", " ".join(re.findall(r"`([^`]+)`", sections[section]))))
            for thing in things:
                thing = getattr(skillet, thing) if isinstance(thing, str) else thing
                own = vars(thing) if isinstance(thing, type) else ()
                wanted = {thing.__name__, *(name for name in own if not name.startswith("_"))}
                self.assertLessEqual(wanted, names, section)


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
