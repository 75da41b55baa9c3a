"""What the study of peers compares: a task as every method sees it, and the methods behind one `ask` and `tell`.

Every method proposes e, (k,): θ = start + directions @ e, or the known box of an action scaled to [-1, 1], as
`skillet.envs` has it. Trial 1 is the start for all, except where our default searches a box. The peers see the reward,
and pyribs two measures for its archive; what else a row of ours sees stands at its class.
"""

import tempfile
from pathlib import Path

import cma
import cmaes  # noqa: F401  Optuna's CMA sampler needs it
import nevergrad
import numpy as np
import optuna
import ribs.archives
import ribs.emitters
import ribs.schedulers
import scipy.ndimage
import skillet

REACH = 10.0
GOOD = 0.7
"""The skittles know no success: from this reward on a throw counts as one."""
MEASURES = {"pancake": (("apex_m", 0.0, 1.0), ("turn_rad", -6.3, 6.3)),
            "ball-in-a-cup": (("apex_m", 0.0, 0.4), ("miss_forward_m", -0.3, 0.3)),
            "obstacle": (("goal_m", 0.0, 0.5), ("clearance_m", -0.05, 0.3))}
"""Measures of the archive of pyribs with their ranges; elsewhere two entries of e."""
ENTRIES = {"via-points": (1, 5), "skittles": (0, 1)}


class World:
    """A task as every method sees it. The faster plant, as in `study robots`."""

    def __init__(self, name: str):
        self.name = name
        with tempfile.TemporaryDirectory() as folder:
            config = Path(folder) / "task.toml"
            config.write_text(f'[task]\nname = "{name}"\n[plant]\ndynamics = "split"\n')
            self.task = skillet.Task(name, config=config)
        self.boxed = self.task.box is not None and np.abs(self.task.box).max() < 1e6
        self.rollouts = self.task.learner["rollouts"]
        self.k = self.task.directions.shape[1]
        self.bound = 1.0 if self.boxed else REACH
        self.regions = self._regions() if name == "skittles" else None

    def theta(self, e):
        e = np.clip(e, -self.bound, self.bound)
        if self.boxed:
            low, high = self.task.box
            return low + 0.5 * (e + 1.0) * (high - low)
        return self.task.start + self.task.directions @ e

    def run(self, theta):
        outcome = self.task.run(theta)
        return outcome._replace(success=outcome.reward >= GOOD) if self.name == "skittles" else outcome

    def _regions(self, n=80):
        """Places of good throws on a grid, (m, 2), and the connected region of each."""
        axis = np.linspace(-1.0, 1.0, n)
        good = np.array([[self.run(self.theta(np.array([x, y]))).success for y in axis] for x in axis])
        label = scipy.ndimage.label(good, np.ones((3, 3)))[0]
        i, j = np.nonzero(good)
        low, high = self.task.box
        return low + 0.5 * (np.stack([axis[i], axis[j]], 1) + 1.0) * (high - low), label[i, j]

    def mode(self, theta, outcome):
        """Which of several ways a success is; None where the task has one."""
        if self.name == "via-points":
            return outcome.measures["way"]
        if self.regions is None:
            return None
        places, labels = self.regions
        return int(labels[np.argmin((((places - theta) / np.ptp(places, axis=0)) ** 2).sum(1))])


class Ours:
    """What `skillet learn` runs: told of successes, of which directions are about stiffness, and of the box."""

    def __init__(self, world, sigma, seed, method=None):
        self.search = world.task.search(method, seed=seed)

    def ask(self):
        self.trial = self.search.ask()
        return self.trial.theta

    def tell(self, outcome):
        self.search.tell(self.trial, outcome.reward, outcome.success, measures=outcome.measures)


class OursAim(Ours):
    """Learns from measures instead of the reward, without a prediction of them."""

    def __init__(self, world, sigma, seed):
        super().__init__(world, sigma, seed, "aim")


class OnE:
    """A method that proposes e, one or several at a time; the first trial is the start."""

    def __init__(self, world, sigma, seed):
        self.world, self.queue, self.done, self.started = world, [], [], False
        self.begin(np.zeros(world.k), sigma, seed)

    def ask(self):
        if not self.started:
            self.e = np.zeros(self.world.k)
        else:
            self.queue = self.queue or list(self.batch())
            self.e = self.queue.pop(0)
        return self.world.theta(np.asarray(self.e))

    def tell(self, outcome):
        if not self.started:
            self.started = True
            return
        self.done.append((self.e, outcome))
        if not self.queue:
            self.learn(*zip(*self.done))
            self.done = []


class OursReward(OnE):
    """PoWER told the reward alone, like a peer; settings of the obstacle, relative to the initial step."""

    def begin(self, zero, sigma, seed):
        settings = {"elites": "all", "floor_decay": 0.97, "floor_std": 0.4, "floor_min": 0.04, "n_elites": 6,
                    "n_initial": 10, "initial_std": 1.0}
        box = (zero - 1.0, zero + 1.0) if self.world.boxed else None
        self.search = skillet.Search("power", start=zero, unit=sigma, seed=seed, box=box, settings=settings)

    def batch(self):
        self.trial = self.search.ask()
        return [self.trial.theta]

    def learn(self, _, outcomes):
        self.search.tell(self.trial, outcomes[0].reward)


class Pycma(OnE):
    def begin(self, zero, sigma, seed):
        bounds = {"bounds": [-self.world.bound, self.world.bound]} if self.world.boxed else {}
        self.es = cma.CMAEvolutionStrategy(zero, sigma, {"seed": seed + 1, "verbose": -9, **bounds})

    def batch(self):
        return self.es.ask()

    def learn(self, points, outcomes):
        self.es.tell(list(points), [-outcome.reward for outcome in outcomes])


class Pyribs(OnE):
    """CMA-ME: one emitter, improvement ranking, an archive of two measures, 20 × 20."""

    def begin(self, zero, sigma, seed):
        named = MEASURES.get(self.world.name)
        ranges = [pair[1:] for pair in named] if named else [(-1.0, 1.0)] * 2
        archive = ribs.archives.GridArchive(solution_dim=len(zero), dims=(20, 20), ranges=ranges, seed=seed)
        bounds = {"lower_bounds": zero - 1.0, "upper_bounds": zero + 1.0} if self.world.boxed else {}
        emitter = ribs.emitters.EvolutionStrategyEmitter(archive, x0=zero, sigma0=sigma, seed=seed, **bounds)
        self.scheduler = ribs.schedulers.Scheduler(archive, [emitter])

    def batch(self):
        return self.scheduler.ask()

    def learn(self, points, outcomes):
        named = MEASURES.get(self.world.name)
        measures = [[outcome.measures[name] for name, _, _ in named] if named else
                    [e[i] for i in ENTRIES[self.world.name]] for e, outcome in zip(points, outcomes)]
        self.scheduler.tell([outcome.reward for outcome in outcomes], measures)


class Optuna(OnE):
    def begin(self, zero, sigma, seed):
        self.reach = self.range(sigma)
        self.names = [f"e{i:03}" for i in range(len(zero))]
        self.study = optuna.create_study(direction="maximize", sampler=self.sampler(zero, sigma, seed))

    def ask(self):
        if not self.started:
            self.study.enqueue_trial(dict.fromkeys(self.names, 0.0))
        self.trial = self.study.ask()
        return self.world.theta(np.array([self.trial.suggest_float(n, -self.reach, self.reach) for n in self.names]))

    def tell(self, outcome):
        self.started = True
        self.study.tell(self.trial, outcome.reward)


class OptunaTpe(Optuna):
    """Uniform over ±3 steps at first, and never outside."""

    def range(self, sigma):
        return min(3.0 * sigma, self.world.bound)

    def sampler(self, zero, sigma, seed):
        return optuna.samplers.TPESampler(seed=seed)


class OptunaCma(Optuna):
    """Its step is relative to the range."""

    def range(self, sigma):
        return self.world.bound

    def sampler(self, zero, sigma, seed):
        start = dict.fromkeys(self.names, 0.0)
        return optuna.samplers.CmaEsSampler(x0=start, sigma0=0.5 * sigma / self.reach, seed=seed)


class Nevergrad(OnE):
    """NGOpt, which chooses a method by dimension and budget."""

    def begin(self, zero, sigma, seed):
        space = nevergrad.p.Array(init=zero).set_mutation(sigma=sigma)
        if self.world.boxed:
            space = nevergrad.p.Array(init=zero).set_bounds(-1.0, 1.0).set_mutation(sigma=sigma)
        space.random_state.seed(seed)
        self.optimizer = nevergrad.optimizers.NGOpt(parametrization=space, budget=self.world.rollouts - 1)

    def batch(self):
        self.candidate = self.optimizer.ask()
        return [self.candidate.value]

    def learn(self, _, outcomes):
        self.optimizer.tell(self.candidate, -outcomes[0].reward)


METHODS = {"Skillet, default": Ours, "Skillet, aim": OursAim, "Skillet, reward only": OursReward, "pycma": Pycma,
           "pyribs CMA-ME": Pyribs, "Optuna TPE": OptunaTpe, "Optuna CMA-ES": OptunaCma, "nevergrad NGOpt": Nevergrad}
TUNED = [name for name, method in METHODS.items() if not issubclass(method, Ours)]
