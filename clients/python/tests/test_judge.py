"""The judge's loop: what it answers to what a function does."""

import io
import json
import sys
import tempfile
import unittest
from pathlib import Path

import numpy as np

import skillet


def answers(function, *requests):
    lines = io.StringIO("".join(json.dumps(request) + "\n" for request in requests))
    out = io.StringIO()
    skillet.judge(function, lines, out)
    return [json.loads(line) for line in out.getvalue().splitlines()]


def answer(function, **request):
    only, = answers(function, {"rollout": 12, "measures": {"apex_m": 0.5}, **request})
    return only


class Judging(unittest.TestCase):
    def test_each_form_of_a_verdict(self):
        for value, expected in [
            (1.5, {"reward": 1.5}),
            (np.float32(0.5), {"reward": 0.5}),
            ((1.5, np.True_), {"reward": 1.5, "success": True}),
            ({"reward": 2, "success": 0, "measures": {"gap_m": 0.01}},
             {"reward": 2.0, "success": False, "measures": {"gap_m": 0.01}}),
        ]:
            self.assertEqual(answer(lambda rollout: value), {"rollout": 12, **expected})

    def test_a_function_sees_measures_and_ticks(self):
        with tempfile.TemporaryDirectory() as folder:
            path = str(Path(folder) / "rollout.npy")
            np.save(path, np.array([(0.0, 1.0), (0.001, 2.0)], dtype=[("t_s", "f8"), ("tau", "f8")]))
            found = answer(lambda rollout: rollout.ticks["tau"].max() + rollout.measures["apex_m"], path=path)
        self.assertEqual(found["reward"], 2.5)

    def test_whatever_a_function_does_is_an_answer(self):
        for function, word in [
            (lambda rollout: 1 / 0, "ZeroDivisionError"),
            (lambda rollout: rollout.measures["gap"], "KeyError: 'gap'"),
            (lambda rollout: float("nan"), "finite"),
            (lambda rollout: None, "TypeError"),
            (lambda rollout: "good", "good"),
            (lambda rollout: (1.0, True, 3), "ValueError"),
            (lambda rollout: {"rewards": 1.0}, "rewards"),
            (lambda rollout: {"reward": 1.0, "measures": {"gap_m": float("inf")}}, "gap_m"),
            (lambda rollout: rollout.ticks, "no path"),
        ]:
            found = answer(function)
            self.assertEqual(set(found), {"rollout", "error"})
            self.assertIn(word, found["error"])

    def test_one_answer_a_line_in_order(self):
        found = answers(lambda rollout: rollout.rollout, {"rollout": 1}, {"rollout": 2})
        self.assertEqual([one["rollout"] for one in found], [1, 2])

    def test_what_a_function_prints_is_no_answer(self):
        said, sys.stderr = sys.stderr, io.StringIO()
        try:
            found = answer(lambda rollout: print("thinking") or 1.0)
            self.assertIn("thinking", sys.stderr.getvalue())
        finally:
            sys.stderr = said
        self.assertEqual(found["reward"], 1.0)


if __name__ == "__main__":
    unittest.main()
