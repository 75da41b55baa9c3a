"""Skillet's search beside those of other packages, on the same rollouts of the built-in tasks.

    pip install ./clients/python cma ribs optuna cmaes nevergrad scipy "numpy<2.4"
    python3 clients/python/peers.py --seeds 8 --out studies/peer-runs.jsonl  # a line a run; resumes
    python3 clients/python/peers.py --tune --out studies/peer-tuning.jsonl   # the step sizes of CHOSEN

`skillet study peers` calls it once a seed with --samples. The methods, and what each is told: `peer_methods.py`.
"""

import argparse
import json
import sys
import time
import warnings
from pathlib import Path

try:
    import numpy as np
    import optuna
    from peer_methods import ENTRIES, METHODS, TUNED, World
except ImportError as error:
    sys.exit(f'study peers: {error}: pip install ./clients/python cma ribs optuna cmaes nevergrad scipy "numpy<2.4"')

LATE = 20
"""Rollouts at the end that show what was learnt."""
TUNING_SEEDS = (0, 1, 2, 3)
TIE = 1e-4
"""What a unit of mean reward counts beside the share of successes when a step size is chosen."""
ALONG, METRES, BOX = (0.15, 0.3, 0.7, 1.5), (0.01, 0.02, 0.05, 0.12, 0.25), (0.08, 0.15, 0.3, 0.6)
STEPS = {"via-points": BOX, "obstacle": METRES, "skittles": BOX, "ball-in-a-cup": ALONG, "pancake": ALONG}
"""Initial step sizes that are tried, in units of e; one unit along the obstacle's directions is a metre."""
CHOSEN: dict[str, dict[str, float]] = {
    "Skillet, reward only": {"via-points": 0.6, "obstacle": 0.12, "skittles": 0.08, "ball-in-a-cup": 0.3, "pancake": 1.5},
    "pycma": {"via-points": 0.15, "obstacle": 0.02, "skittles": 0.08, "ball-in-a-cup": 0.15, "pancake": 0.3},
    "pyribs CMA-ME": {"via-points": 0.3, "obstacle": 0.02, "skittles": 0.3, "ball-in-a-cup": 0.15, "pancake": 0.3},
    "Optuna TPE": {"via-points": 0.3, "obstacle": 0.05, "skittles": 0.08, "ball-in-a-cup": 0.3, "pancake": 0.7},
    "Optuna CMA-ES": {"via-points": 0.15, "obstacle": 0.05, "skittles": 0.08, "ball-in-a-cup": 0.3, "pancake": 0.3},
    "nevergrad NGOpt": {"via-points": 0.15, "obstacle": 0.05, "skittles": 0.3, "ball-in-a-cup": 0.3, "pancake": 0.15},
}
"""Method and task: the best of STEPS by --tune."""


def session(world, method, sigma, seed):
    """One run: what came of it, as a line."""
    own, successes, modes, rewards = 0.0, [], set(), []
    begin = time.process_time()
    search = METHODS[method](world, sigma, seed)
    for _ in range(world.rollouts):
        theta = search.ask()
        own += time.process_time() - begin
        outcome = world.run(theta)
        successes.append(bool(outcome.success))
        rewards.append(outcome.reward)
        modes |= {world.mode(theta, outcome)} if outcome.success else set()
        begin = time.process_time()
        search.tell(outcome)
    own += time.process_time() - begin
    return {"task": world.name, "method": method, "sigma": sigma, "seed": seed, "rollouts": world.rollouts,
            "first": successes.index(True) + 1 if any(successes) else None,
            "late": float(np.mean(successes[-LATE:])), "share": float(np.mean(successes)),
            "modes": len(modes - {None}), "reward": float(np.mean(rewards)), "own_ms": 1e3 * own / world.rollouts}


def runs(plan, path, keep_going=lambda: True):
    """The lines of a plan of (task, method, step, seed); those in the file are not run again."""
    text = path.read_text() if path and path.exists() else ""
    if text and not text.endswith("\n"):
        with path.open("a") as file:
            file.write("\n")  # ends a torn last line; its run is done again
    lines = [json.loads(line) for line in text.splitlines() if line.endswith("}")]
    done = {(line["task"], line["method"], line["sigma"], line["seed"]): line for line in lines}
    worlds = {}
    for key in plan:
        if key not in done and keep_going():
            task, method, sigma, seed = key
            worlds[task] = worlds.get(task) or World(task)
            done[key] = session(worlds[task], method, sigma, seed)
            if path:
                with path.open("a") as file:
                    file.write(json.dumps(done[key]) + "\n")
    return [done[key] for key in plan if key in done]


def measured(task, method):
    return method != "Skillet, aim" or task in ("pancake", "ball-in-a-cup")


def tuning_plan():
    return [(task, method, sigma, seed) for seed in TUNING_SEEDS for task in STEPS for method in TUNED
            for sigma in STEPS[task]]


def plan_of(seeds):
    return [(task, method, step(method, task), seed) for seed in seeds for task in STEPS
            for method in METHODS if measured(task, method)]


def step(method, task):
    """None for those that are not tuned; the middle one where nothing was chosen."""
    return CHOSEN.get(method, {}).get(task, STEPS[task][1]) if method in TUNED else None


def chosen(lines):
    """Of every method and task the step with the highest share of successes, then of reward."""
    best = {}
    for method in TUNED:
        for task in STEPS:
            def score(sigma):
                of = [line for line in lines if (line["task"], line["method"], line["sigma"]) == (task, method, sigma)]
                return np.mean([line["share"] + TIE * line["reward"] for line in of])
            best.setdefault(method, {})[task] = max(STEPS[task], key=score)
    return best


def samples(lines):
    """As a table of `skillet study` has them."""
    for line in lines:
        kinds = [("first success", "median", line["first"]),
                 ("success in the session", "rate", float(line["first"] is not None)),
                 ("success in the last 20", "mean", line["late"]), ("own ms a trial", "median", line["own_ms"])]
        if line["task"] in ENTRIES:
            kinds.append(("ways found", "mean", float(line["modes"])))
        for metric, statistic, value in kinds:
            yield {"method": line["method"], "metric": f"{line['task']}: {metric}", "statistic": statistic,
                   "value": value}


def median(values):
    """Median and the order statistics that enclose it with 95 %, as `skillet study` has them."""
    values, n = sorted(values), len(values)
    half = 0.98 * n**0.5
    low, high = max(int(np.floor(n / 2 - half)), 0), min(int(np.ceil(n / 2 + half)), n - 1)
    middle = values[n // 2] if n % 2 else 0.5 * (values[n // 2 - 1] + values[n // 2])
    return ["–" if value == np.inf else f"{value:g}" for value in (middle, values[low], values[high])]


def table(lines):
    for task in STEPS:
        ways = task in ENTRIES
        print(f"\n{task}\n\n| method | step | first success, median | seeds with one | late | "
              f"{'ways | ' if ways else ''}own ms a trial |\n|---|---|---|---|---|{'---|' * (ways + 1)}")
        for method in METHODS:
            of = [line for line in lines if (line["task"], line["method"]) == (task, method)]
            if not of:
                continue
            middle, low, high = median([line["first"] or np.inf for line in of])
            late = np.array([line["late"] for line in of])
            half = 1.96 * late.std(ddof=1) / len(of)**0.5 if len(of) > 1 else np.nan
            some = f"{np.mean([line['modes'] for line in of]):.1f} | " if ways else ""
            print(f"| {method} | {of[0]['sigma'] or '–'} | {middle} [{low}, {high}] | "
                  f"{sum(line['first'] is not None for line in of)} of {len(of)} | {late.mean():.2f} ± {half:.2f} | "
                  f"{some}{np.median([line['own_ms'] for line in of]):.2g} |")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=8)
    parser.add_argument("--first-seed", type=int, default=1001)
    parser.add_argument("--out", type=Path, help="file of the runs, one JSON line each")
    parser.add_argument("--minutes", type=float, default=float("inf"), help="start no run after this long")
    parser.add_argument("--tune", action="store_true", help="choose the step sizes on the tuning seeds")
    parser.add_argument("--samples", action="store_true", help="print the samples of a study as JSON")
    args = parser.parse_args()
    warnings.simplefilter("ignore")
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    end = time.monotonic() + 60.0 * args.minutes
    if args.out:
        args.out.parent.mkdir(parents=True, exist_ok=True)
    plan = tuning_plan() if args.tune else plan_of(range(args.first_seed, args.first_seed + args.seeds))
    lines = runs(plan, args.out, lambda: time.monotonic() < end)
    if args.samples:
        print(json.dumps(list(samples(lines))))
    elif args.tune:
        print(json.dumps(chosen(lines), indent=4))
    else:
        table(lines)


if __name__ == "__main__":
    main()
