"""What the prompt shows is one short line without arrays."""

import unittest

import numpy as np

import skillet
from skillet._session import PATH_DTYPE, StoredCell, StoredMode
from test_policy import policy
from test_session import Case as Sessions
from test_tool import Case as Tools


class Tuples(unittest.TestCase):
    def shows(self, value, text):
        self.assertEqual(repr(value), text)
        self.assertEqual(str(value), text)

    def test_a_search(self):
        search = skillet.Search("power", start=np.zeros(30), seed=1)
        first, second = search.ask(2)
        self.shows(first, "Trial(rollout=1, theta=<30 numbers>)")
        search.tell(first, np.float64(0.93), np.True_)
        search.fail(second, "no image")
        self.shows(search.told[0], "Told(rollout=1, reward=0.93, success=True, theta=<30 numbers>)")
        self.shows(search.told[1], "Told(rollout=2, failed=True, reason='no image', theta=<30 numbers>)")
        mode, = search.modes()
        self.assertRegex(repr(mode), r"^Mode\(prior=1, n_trials=\d+, best_rollout=\w+, .*, mean=<30 numbers>\)$")

    def test_a_session(self):
        mode = StoredMode(1, 0.75, np.ones(30), np.eye(30), 41, 0.93, None, 3)
        self.shows(mode, "StoredMode(number=1, policy_id=3, prior=0.75, best_rollout=41, best_reward=0.93, "
                         "tolerance=None, mean=<30 numbers>)")
        self.shows(StoredCell("left", 1, "wam7", 32 * "ab", "MuJoCo 4.0"),
                   "StoredCell(cell='left', since=1, arm='wam7', plant='MuJoCo 4.0', urdf_sha256='abababab…')")
        self.shows(StoredCell("", 1, "", "", ""), "StoredCell(cell='', since=1, arm='', plant='', urdf_sha256='')")

    def test_rollouts(self):
        measures = {f"m{i}": 0.5 for i in range(14)}
        outcome = skillet.Outcome(0.1 + 0.2, True, measures, 0, np.zeros(57, PATH_DTYPE))
        self.shows(outcome, "Outcome(reward=0.3, success=True, measures=<14 entries>, fault=0, path=<57 rows>)")
        self.shows(skillet.Rollout(2, measures, None), "Rollout(rollout=2, measures=<14 entries>, path=None)")

    def test_an_evaluation(self):
        x = np.zeros((7, 6))
        self.shows(policy().evaluate(0.1, x[0], x[0]), "Evaluation(acceleration=<6 numbers>, attractor=<6 numbers>, "
                                                       "stiffness=<6×6 numbers>, activations=<3 numbers>)")
        self.assertIn("stiffness=<7×6×6 numbers>", repr(policy().evaluate(0.1, x, x)))

    def test_policies(self):
        self.shows(policy(), "<Policy: 3 springs in 4 coordinates, 0.6 s>")
        self.shows(skillet.Policy.from_toml(f"action = {[0.1] * 12}"), "<Policy: action of 12 numbers>")


class Stored(Sessions):
    def test_sessions(self):
        for seed in (1, 2):
            self.session(f"s{seed}", seed=seed)
        sessions = skillet.Sessions(self.folder)
        self.assertEqual(repr(sessions), "<Sessions: 2 of pancake, 8 trials, 4 successes>")
        self.assertRegex(repr(sessions[0]), "^<Session .*session.db: pancake, 4 trials, 2 successes>$")


class Running(Tools):
    def test_a_task_and_a_cell(self):
        with skillet.Task("pancake") as task:
            self.assertEqual(repr(task), "<Task pancake: 2 parameters>")
        self.assertEqual(repr(task), "<Task pancake: 2 parameters, closed>")
        self.assertEqual(repr(skillet.Cell("kitchen")), "<Cell kitchen>")


if __name__ == "__main__":
    unittest.main()
