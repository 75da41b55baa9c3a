"""Searches from Python: the bits of the Rust crate, failed and pending trials, files, messages."""

import json
import struct
import tempfile
import unittest
from pathlib import Path

import numpy as np

import skillet

HERE = Path(__file__).parent
DEMONSTRATION = HERE.parents[2] / "demos/pancake.csv"
METHODS = ["power", "aim", "tempered", "regions", "niching", "algorithm1", "cem", "pi2", "rwr", "reinforce", "enac",
           "random"]


def bits(vector):
    return [f"{struct.unpack('<Q', struct.pack('<d', value))[0]:016x}" for value in vector]


def reward(theta):
    squares = 0.0
    for value in theta:
        squares += (value - 1.0) * (value - 1.0)
    return 1.0 / (1.0 + squares)


def run(search, n):
    for _ in range(n):
        trial = search.ask()
        search.tell(trial, reward(trial.theta))
    return search


def refusal(test, function):
    with test.assertRaises(ValueError) as caught:
        function()
    return str(caught.exception)


class Reference(unittest.TestCase):
    def search(self, case):
        method = case["search"]["method"]
        box = case["low"] and (case["low"], case["high"])
        return skillet.Search(method, start=case["start"], seed=case["seed"], box=box, directions=case["directions"],
                              settings=case["search"].get(method))

    def test_same_seed_same_bits_as_in_rust(self):
        cases = json.loads((HERE / "reference.json").read_text())
        self.assertEqual({case["search"]["method"] for case in cases}, set(METHODS))
        for case in cases:
            with self.subTest(method=case["search"]["method"], box=case["low"], along=case["directions"]):
                search = self.search(case)
                for _ in range(case["trials"]):
                    trial = search.ask()
                    first, second = float(trial.theta[0]), float(trial.theta[1])
                    measures = {"first": first, "second": second, "positive": second > 0.0}
                    search.tell(trial, reward(trial.theta), first > 0.5, measures=measures)
                self.assertEqual(bits(search.ask().theta), case["next"])
                self.assertEqual(bits(search.mean), case["mean"])


class Asking(unittest.TestCase):
    def test_a_loop_finds_the_optimum(self):
        search = run(skillet.Search("power", start=[0.0, 0.0], seed=3), 150)
        self.assertLess(np.abs(search.mean - 1.0).max(), 0.2)
        self.assertGreater(search.best.reward, 0.95)
        self.assertEqual(search.std.shape, (2,))
        mode, = search.modes()
        self.assertEqual((mode.mean.shape, mode.covariance.shape, mode.n_trials), ((2,), (2, 2), 150))

    def test_a_batch_may_be_told_in_any_order(self):
        search = skillet.Search("cem", start=np.zeros(3))
        trials = search.ask(5)
        self.assertEqual([trial.rollout for trial in trials], [1, 2, 3, 4, 5])
        self.assertEqual(len({tuple(trial.theta) for trial in trials}), 5)
        for trial in reversed(trials[1:]):
            search.tell(trial.rollout, reward(trial.theta))
        self.assertEqual([trial.rollout for trial in search.pending], [1])

    def test_a_failed_trial_teaches_nothing(self):
        a, b = (run(skillet.Search("power", start=[0.0], seed=2), 30) for _ in range(2))
        a.fail(a.ask(), "the camera was unplugged")
        b.ask()
        self.assertEqual(bits(a.ask().theta), bits(b.ask().theta))
        self.assertTrue(a.told[-1].failed)
        self.assertIn("trial 31 was already reported", refusal(self, lambda: a.tell(31, 1.0)))

    def test_what_was_executed_may_differ_from_what_was_proposed(self):
        search = skillet.Search("power", start=[0.0])
        search.tell(search.ask(), 1.0, theta=[0.5])
        self.assertEqual(search.best.theta[0], 0.5)

    def test_modes_are_told_apart(self):
        search = skillet.Search("regions", box=([-2.0], [2.0]), seed=1)
        for _ in range(100):
            trial = search.ask()
            search.tell(trial, float(np.exp(-20 * (abs(trial.theta[0]) - 1.0) ** 2)))
        means = sorted(float(mode.mean[0]) for mode in search.modes())
        self.assertLess(abs(means[0] + 1.0) + abs(means[-1] - 1.0), 0.05, means)

    def test_units_are_directions(self):
        a = skillet.Search("power", start=[0.0, 0.0], unit=[1.0, 5.0])
        b = skillet.Search("power", start=[0.0, 0.0], directions=np.diag([1.0, 5.0]))
        self.assertEqual(bits(a.ask().theta), bits(b.ask().theta))

    def test_costs_are_mapped(self):
        search = skillet.Search("tempered", start=[0.0], reward_map={"exp": 1.0})
        search.tell(search.ask(), -3.0)
        self.assertEqual(search.best.reward, -3.0)


class Demonstrated(unittest.TestCase):
    def test_a_search_begins_at_a_demonstration(self):
        search = skillet.Search.from_demonstrations(DEMONSTRATION, seed=4, learner={"task_dim": 4})
        theta = search.ask().theta
        self.assertEqual(theta.shape, (search.dim,))
        policy = search.policy(theta)
        self.assertEqual((policy.task_dim, policy.attractors.shape[1]), (4, 6))
        self.assertEqual(search.policy().digest, search.policy(search.mean).digest)

    def test_only_such_a_search_has_policies(self):
        self.assertIn("demonstrations", refusal(self, lambda: skillet.Search(start=[0.0]).policy()))


class Files(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.file = Path(folder.name) / "search.json"

    def test_a_saved_search_goes_on_as_if_it_had_never_stopped(self):
        for method in METHODS[2:]:
            with self.subTest(method=method):
                search = run(skillet.Search(method, start=[0.0, 0.0], box=([-3.0, -3.0], [3.0, 3.0]), seed=5), 30)
                pending = search.ask(3)
                search.fail(pending[1], "lost")
                search.save(self.file)
                again = skillet.Search.load(self.file)
                self.assertEqual([trial.rollout for trial in again.pending], [31, 33])
                self.assertEqual(bits(again.pending[0].theta), bits(pending[0].theta))
                for one in (search, again):
                    one.tell(33, 0.25)
                    one.tell(31, 0.5)
                    run(one, 20)
                self.assertEqual(bits(search.ask().theta), bits(again.ask().theta))
                self.assertEqual(search.told[30].reason, again.told[30].reason)

    def test_several_that_are_pending_come_back_bit_for_bit(self):
        for method in ["power", *METHODS[2:]]:
            with self.subTest(method=method):
                search = skillet.Search(method, start=[0.0, 0.0], box=([-3.0, -3.0], [3.0, 3.0]), seed=5)
                pending = search.ask(4)
                for i in range(40):
                    # The second oldest comes back first, and one is asked for in its place.
                    trial = pending.pop(1 if i % 3 else 2)
                    search.tell(trial, reward(trial.theta))
                    pending.append(search.ask())
                search.save(self.file)
                again = skillet.Search.load(self.file)
                self.assertEqual([bits(trial.theta) for trial in again.pending],
                                 [bits(trial.theta) for trial in search.pending])
                self.assertEqual(again.told[9].asked_after, search.told[9].asked_after)
                for one in (search, again):
                    for trial in one.pending[::-1]:
                        one.tell(trial, reward(trial.theta))
                self.assertEqual(bits(search.ask().theta), bits(again.ask().theta))

    def test_one_from_a_demonstration_too(self):
        search = skillet.Search.from_demonstrations(DEMONSTRATION)
        for _ in range(5):
            trial = search.ask()
            search.tell(trial, float(trial.theta[0]))
        search.save(self.file)
        again = skillet.Search.load(self.file)
        self.assertEqual(bits(search.ask().theta), bits(again.ask().theta))

    def test_a_file_that_is_none_or_was_changed_is_refused(self):
        self.file.write_text("{}")
        self.assertIn("not a search", refusal(self, lambda: skillet.Search.load(self.file)))
        search = run(skillet.Search(start=[0.0]), 20)
        search.save(self.file)
        state = json.loads(self.file.read_text())
        state["trials"][3]["theta"][0] += 5.0
        state["trials"][3]["reward"] = 2.0
        self.file.write_text(json.dumps(state))
        self.assertIn("same mean", refusal(self, lambda: skillet.Search.load(self.file)))
        search.ask(2)
        search.save(self.file)
        state = json.loads(self.file.read_text())
        state["pending"][1][2] -= 5
        self.file.write_text(json.dumps(state))
        self.assertIn("same proposals", refusal(self, lambda: skillet.Search.load(self.file)))


class Messages(unittest.TestCase):
    def test_each_mistake_is_named_with_what_to_do(self):
        search = skillet.Search(start=[0.0, 0.0])
        trial = search.ask()
        for function, *words in [
            (lambda: skillet.Search("powr", start=[0.0]), "powr", "power"),
            (lambda: skillet.Search(), "start", "box"),
            (lambda: skillet.Search("regions", start=[0.0]), "box", "tempered"),
            (lambda: skillet.Search(start=[np.nan]), "start", "finite"),
            (lambda: skillet.Search(start=[[0.0]]), "start", "vector"),
            (lambda: skillet.Search(start=[5.0], box=([0.0], [1.0])), "start", "box"),
            (lambda: skillet.Search(box=([0.0], [0.0])), "min < max"),
            (lambda: skillet.Search(start=[0.0], settings={"n_elite": 3}), "n_elite"),
            (lambda: skillet.Search(start=[0.0], settings={"n_elites": "many"}), "many"),
            (lambda: skillet.Search(start=[0.0], settings={"floor_std": -1.0}), "floor_std"),
            (lambda: skillet.Search(start=[0.0, 0.0], directions=[[1.0, 1.0], [1.0, 1.0]]), "independent"),
            (lambda: skillet.Search(start=[0.0, 0.0], directions=[[1.0]]), "directions", "2 parameters"),
            (lambda: search.tell(trial, float("nan")), "trial 1", "fail(trial)"),
            (lambda: search.tell(trial, 1.0, theta=[0.0]), "trial 1", "1 numbers instead of 2"),
            (lambda: search.tell(9, 1.0), "trial 9 was not proposed", "[1]"),
            (lambda: skillet.Search.from_demonstrations([]), "demonstrations"),
        ]:
            said = refusal(self, function)
            for word in words:
                self.assertIn(word, said)
        self.assertEqual([one.rollout for one in search.pending], [1], "a refusal changes nothing")


if __name__ == "__main__":
    unittest.main()
