"""Policies: Eq. (5) against the formula in NumPy, and files that come back bit for bit."""

import json
import tempfile
import unittest
from pathlib import Path

import numpy as np

import skillet


def fields(**changes):
    rng = np.random.default_rng(1)
    components = []
    for i in range(3):
        root = rng.normal(size=(4, 4))
        stiffness = root @ root.T * 50.0 + 100.0 * np.eye(4)
        components.append({"center": 0.1 + 0.2 * i, "width": 0.1, "attractor": rng.normal(size=6).tolist(),
                           "stiffness": ((stiffness + stiffness.T) / 2).tolist()})
    return {"task_dim": 4, "activation": "time", "duration_s": 0.6, "decay_rate": 0.0, "damping": 28.3,
            "orientation_stiffness": 400.0, "orientation_damping": 40.0, "components": components, **changes}


def policy(**changes):
    return skillet.Policy.from_json(json.dumps(fields(**changes)))


def by_hand(policy, t, x, xd):
    """Eq. (5), written once more."""
    weight = np.exp(-0.5 * ((t - policy.centers) / policy.widths) ** 2) / policy.widths
    h = weight / weight.sum()
    xdd, K_all = np.zeros(6), np.zeros((6, 6))
    damping = np.array([policy.fields["damping"]] * 4 + [policy.fields["orientation_damping"]] * 2)
    for h_i, attractor, learnt in zip(h, policy.attractors, policy.stiffness):
        K = np.diag([0.0] * 4 + [policy.fields["orientation_stiffness"]] * 2)
        K[:4, :4] = learnt
        xdd += h_i * (K @ (attractor - x))
        K_all += h_i * K
    return xdd - damping * xd, h @ policy.attractors, K_all, h


class Evaluating(unittest.TestCase):
    def test_equation_5(self):
        found, rng = policy(), np.random.default_rng(2)
        for t in (-0.5, 0.0, 0.2, 0.31, 1.5):
            x, xd = rng.normal(size=6), rng.normal(size=6)
            for value, expected in zip(found.evaluate(t, x, xd), by_hand(found, t, x, xd)):
                np.testing.assert_allclose(value, expected, rtol=1e-12, atol=1e-9)

    def test_many_states_at_once(self):
        found = policy()
        t, x = np.linspace(0.0, 0.6, 7), np.ones((7, 6))
        many = found.evaluate(t, x, np.zeros(6))
        self.assertEqual([part.shape for part in many], [(7, 6), (7, 6), (7, 6, 6), (7, 3)])
        one = found.evaluate(t[3], x[3], np.zeros(6))
        np.testing.assert_array_equal(many.acceleration[3], one.acceleration)
        np.testing.assert_array_equal(many.stiffness[3], one.stiffness)
        np.testing.assert_allclose(many.activations.sum(axis=1), 1.0)

    def test_forces(self):
        found = policy().evaluate(0.2, np.zeros(6), np.zeros(6))
        np.testing.assert_allclose(found.force(2.0 * np.eye(6)), 2.0 * found.acceleration)
        np.testing.assert_allclose(found.force(2.0), [*2.0 * found.acceleration[:3], 0.0, 0.0, 0.0])

    def test_it_settles_at_its_last_attractor(self):
        found = policy(duration_s=3.0)
        t, x, xd = found.integrate(np.zeros(6))
        self.assertEqual((t.shape, x.shape), ((3001,), (3001, 6)))
        np.testing.assert_allclose(x[-1], found.attractors[-1], atol=0.02)
        self.assertLess(np.abs(xd[-1]).max(), 0.1)


def field_by_hand(fields, x, xd):
    """Eq. (2) driven by the state, and the law that follows its velocity."""
    weights, velocities = [], []
    for system in fields["systems"]:
        error, covariance = x[:3] - system["center"], np.array(system["covariance"])
        weights.append(np.exp(system["log_prior"] - 0.5 * error @ np.linalg.solve(covariance, error))
                       / np.sqrt(np.linalg.det(covariance)))
        velocities.append(np.array(system["of_position"]) @ x[:3] + system["offset"])
    h = np.array(weights) / np.sum(weights)
    velocity = h @ np.array(velocities)
    rest = 400.0 * (np.array(fields["target"]) - x) - 40.0 * xd
    return np.concatenate([fields["following"] * (velocity - xd[:3]), rest[3:]]), h, velocity


class Systems(unittest.TestCase):
    def setUp(self):
        rng = np.random.default_rng(3)
        target = np.array([0.5, 0.1, 0.8, 0.1, 0.0, 0.2])
        systems = []
        for i in range(3):
            turn, root = rng.normal(size=(3, 3)), 0.1 * rng.normal(size=(3, 3))
            A = -2.0 * np.eye(3) + turn - turn.T
            covariance = root @ root.T + 0.01 * np.eye(3)
            systems.append({"log_prior": -0.2 * i, "center": (0.2 * rng.normal(size=3)).tolist(),
                            "covariance": ((covariance + covariance.T) / 2).tolist(), "of_position": A.tolist(),
                            "offset": (-A @ target[:3]).tolist()})
        self.fields = {"task_dim": 3, "activation": "state", "output": "velocity", "duration_s": 1.0, "following": 50.0,
                       "orientation_stiffness": 400.0, "orientation_damping": 40.0, "target": target.tolist(),
                       "certificate": np.eye(3).tolist(), "systems": systems}
        self.policy = skillet.Policy.from_json(json.dumps(self.fields))

    def test_equation_2(self):
        rng = np.random.default_rng(4)
        for _ in range(5):
            x, xd = 0.3 * rng.normal(size=6), rng.normal(size=6)
            found = self.policy.evaluate(0.3, x, xd)
            acceleration, h, velocity = field_by_hand(self.fields, x, xd)
            np.testing.assert_allclose(found.acceleration, acceleration, rtol=1e-9, atol=1e-9)
            np.testing.assert_allclose(found.activations, h, rtol=1e-9, atol=1e-12)
            np.testing.assert_allclose(found.attractor[:3], x[:3] + velocity / 50.0, rtol=1e-9)
            A = np.einsum("i,ijk->jk", h, [system["of_position"] for system in self.fields["systems"]])
            np.testing.assert_allclose(found.stiffness[:3, :3], -50.0 * A, rtol=1e-9, atol=1e-9)

    def test_files_come_back_bit_for_bit_and_springs_are_not_looked_for(self):
        self.assertTrue(self.policy.is_systems and "3 systems" in repr(self.policy))
        again = skillet.Policy.from_toml(self.policy.to_toml())
        self.assertEqual((again, again.fields), (self.policy, self.policy.fields))
        with self.assertRaisesRegex(ValueError, "no springs"):
            self.policy.attractors
        self.fields["systems"][1]["covariance"][0][0] = -1.0
        with self.assertRaisesRegex(ValueError, "system 1: covariance must be positive definite"):
            skillet.Policy.from_json(json.dumps(self.fields))


class Files(unittest.TestCase):
    def test_each_format_comes_back_bit_for_bit(self):
        found = policy(damping_ratio=0.7)
        with tempfile.TemporaryDirectory() as folder:
            for name in ("policy.json", "policy.toml"):
                found.write(Path(folder) / name)
                again = skillet.Policy.read(Path(folder) / name)
                self.assertEqual((again, again.fields), (found, found.fields), name)

    def test_actions_too(self):
        found = skillet.Policy.from_toml("action = [8.0, 0.30000000000000004]\n")
        self.assertTrue(found.is_action)
        self.assertEqual(skillet.Policy.from_toml(found.to_toml()).action.tolist(), [8.0, 0.1 + 0.2])
        with self.assertRaisesRegex(ValueError, "action vector"):
            found.centers
        with self.assertRaisesRegex(ValueError, "action vector"):
            found.evaluate(0.0, np.zeros(6), np.zeros(6))

    def test_a_changed_policy_is_another_one(self):
        found = policy()
        moved = found.replace(attractors=found.attractors + 0.01, duration_s=0.7)
        np.testing.assert_allclose(moved.attractors, found.attractors + 0.01)
        self.assertEqual(moved.duration_s, 0.7)
        self.assertNotEqual(moved.digest, found.digest)
        self.assertEqual(found.duration_s, 0.6)

    def test_each_mistake_is_named(self):
        indefinite = fields()
        indefinite["components"][1]["stiffness"][0][0] = -100.0
        found = policy()
        for function, word in [
            (lambda: policy(task_dim=3), "3 rows of 3"),
            (lambda: policy(duration_s=-1.0), "duration_s"),
            (lambda: skillet.Policy.from_json("{}"), "task_dim"),
            (lambda: skillet.Policy.from_json(json.dumps(indefinite)), "component 1: stiffness must be positive definite"),
            (lambda: skillet.Policy.from_toml("action = [nan]"), "finite"),
            (lambda: found.replace(duration_s=float("nan")), "finite"),
            (lambda: found.replace(speed=1.0), "speed"),
            (lambda: found.replace(attractors=[[0.0] * 6]), "one a component"),
            (lambda: found.evaluate(0.0, np.zeros(4), np.zeros(4)), r"\(6,\)"),
        ]:
            with self.assertRaisesRegex(ValueError, word):
                function()


if __name__ == "__main__":
    unittest.main()
