"""What goes through the tool: the commands that are called, their answers and errors. With SKILLET (the built tool)
the tasks and environments run; without it a stand-in shows what is called."""

import os
import stat
import sys
import tempfile
import unittest
from pathlib import Path
from unittest import mock

import numpy as np

import skillet

try:
    import gymnasium
except ImportError:
    gymnasium = None

STAND_IN = f"""#!{sys.executable}
import json, sys
arguments = sys.argv[1:]
if arguments[:2] == ["task", "serve"]:
    print(json.dumps({{"task": arguments[2], "about": "", "start": [0.5, 0.0], "directions": [[1.0], [0.5]], "box": None,
                      "measures": {{"gap_m": "m"}}, "demonstrations": [], "learner": {{"action": {{"start": [0.5, 0.0],
                      "unit": [1.0, 2.0]}}, "search": {{"method": "power"}}}}}}), flush=True)
    for line in sys.stdin:
        request = json.loads(line)
        if "decode" in request:
            print(json.dumps({{"policy": {{"action": request["decode"]}}}}), flush=True)
        elif len(request["theta"]) != 2:
            print(json.dumps({{"refused": "theta has 1 numbers: give 2 finite ones"}}), flush=True)
        else:
            path = [0.5] * 40 if request["path"] else None
            print(json.dumps({{"reward": -request["theta"][0], "success": True, "measures": {{"gap_m": 0.1}},
                              "fault_code": 0, "path": path}}), flush=True)
elif "nowhere" in arguments:
    print(json.dumps({{"error": {{"message": "no controller in nowhere", "causes": [], "exit_code": 3}}}}))
    sys.exit(3)
elif arguments[0] == "watch":
    print(json.dumps({{"tick": 1}}))
    print(json.dumps({{"tick": 2}}))
else:
    print(json.dumps({{"called": arguments, "policy_id": 7, "controller": "running", "health": "ok"}}))
"""


class Case(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        tool = Path(folder.name) / "skillet"
        tool.write_text(STAND_IN)
        tool.chmod(tool.stat().st_mode | stat.S_IXUSR)
        patch = mock.patch.dict(os.environ, {"SKILLET": str(tool)})
        patch.start()
        self.addCleanup(patch.stop)


class Cells(Case):
    def test_a_method_is_a_command(self):
        cell = skillet.Cell("kitchen")
        end = ["--cell", "kitchen", "--json"]
        for reply, command in [
            (cell.status(), ["status"]),
            (cell.policies(), ["policy", "list"]),
            (cell.load("flip.toml"), ["policy", "import", "flip.toml"]),
            (cell.load("s7", 91), ["policy", "import", "s7", "--id", "91"]),
            (cell.activate(1), ["policy", "activate", "1", "--at", "next-rollout"]),
            (cell.activate({"policy_id": 7}, now=True), ["policy", "activate", "7", "--at", "now"]),
            (cell.pin(), ["policy", "pin"]),
            (cell.unpin(), ["policy", "unpin"]),
            (cell.roll_back(), ["policy", "rollback"]),
        ]:
            self.assertEqual(reply["called"], command + end)
        self.assertTrue(cell.is_running)
        self.assertEqual([line["tick"] for line in cell.watch(2)], [1, 2])

    def test_a_policy_goes_through_a_file(self):
        policy = skillet.Policy.from_toml("action = [1.0]")
        self.assertEqual(skillet.Cell("kitchen").load(policy)["called"][:2], ["policy", "import"])

    def test_the_tools_words_are_the_error(self):
        cell = skillet.Cell("nowhere")
        with self.assertRaisesRegex(skillet.ToolError, "no controller in nowhere") as caught:
            cell.status()
        self.assertEqual(caught.exception.exit_code, 3)
        self.assertFalse(cell.is_running)
        with mock.patch.dict(os.environ, {"SKILLET": "/nowhere/skillet"}):
            with self.assertRaisesRegex(skillet.ToolError, "SKILLET is /nowhere/skillet"):
                cell.status()


class Tasks(Case):
    def test_a_rollout(self):
        with skillet.Task("pancake") as task:
            outcome = task.run(task.start, path=True)
            self.assertEqual((outcome.reward, outcome.success, outcome.measures), (-0.5, True, {"gap_m": 0.1}))
            self.assertEqual((outcome.path.shape, outcome.path["position_m"].shape), ((2,), (2, 3)))
            self.assertIsNone(task.run(task.start).path)
            self.assertEqual(task.policy([1.0, 2.0]).action.tolist(), [1.0, 2.0])
            with self.assertRaisesRegex(ValueError, "give 2 finite ones"):
                task.run([1.0])
            search = task.search(seed=4)
            self.assertEqual((search.settings["method"], search.dim), ("power", 2))
            same = skillet.Search("power", start=[0.5, 0.0], unit=[1.0, 2.0], seed=4)
            self.assertEqual(search.ask().theta.tolist(), same.ask().theta.tolist())
            self.assertEqual(task.search("cem", settings={"n_elites": 8}).settings["method"], "cem")

    @unittest.skipIf(gymnasium is None, "gymnasium is not installed")
    def test_an_environment(self):
        env = gymnasium.make("skillet.envs:skillet/Pancake-v0")
        observation, info = env.reset(seed=1)
        self.assertEqual((observation.shape, info, env.action_space.shape), ((0,), {}, (1,)))
        _, reward, terminated, truncated, info = env.step(np.array([2.0]))
        self.assertEqual((reward, terminated, truncated), (-2.5, True, False))
        self.assertEqual((info["gap_m"], info["success"], info["theta"].tolist()), (0.1, True, [2.5, 1.0]))
        env.close()


@unittest.skipUnless(os.environ.get("SKILLET"), "SKILLET names no built tool")
class Real(unittest.TestCase):
    def test_every_environments_task_runs_and_repeats_itself(self):
        for name in ("pancake", "ball-in-a-cup", "via-points", "obstacle", "skittles", "archery"):
            with self.subTest(task=name), skillet.Task(name) as task:
                first, again = task.run(task.start, path=True), task.run(task.start)
                self.assertEqual((first.reward, first.measures), (again.reward, again.measures))
                self.assertEqual(set(first.measures), set(task.units))
                self.assertEqual(task.run(task.policy(task.start)).reward, first.reward)
                with self.assertRaisesRegex(ValueError, "finite"):
                    task.run([1.0])

    def test_an_unknown_task_is_named(self):
        with self.assertRaisesRegex(skillet.ToolError, "flipping"):
            skillet.Task("flipping")

    def test_a_search_in_python_is_the_sessions(self):
        """The trials of `skillet learn`, proposed and judged again from Python, bit for bit."""
        from skillet import _tool
        for name in ("skittles", "pancake"):
            with self.subTest(task=name), tempfile.TemporaryDirectory() as folder, skillet.Task(name) as task:
                out = str(Path(folder) / "s")
                _tool.run("learn", name, "--rollouts", "12", "--seed", "3", "--out", out, "--json")
                session, search = skillet.Session(out), task.search(seed=3)
                self.assertEqual(session.search().ask().rollout, 13)
                for theta, reward in zip(session.theta, session.trials["reward"]):
                    trial = search.ask()
                    outcome = task.run(trial.theta)
                    self.assertEqual((trial.theta.tolist(), outcome.reward), (theta.tolist(), reward))
                    search.tell(trial, outcome.reward, outcome.success, measures=outcome.measures)


if __name__ == "__main__":
    unittest.main()
