"""Judges rollouts of the peg: a line of JSON in, a line out; see docs/peg.md."""

import json
import sys

import numpy

# So deep the peg is in; the hole has 40 mm.
DEPTH_M = 0.025
# What the plate bears.
FORCE_N = 20.0


def entry_s(path, depth_m):
    """When the peg was in, s after the start; the end of the rollout if it never was."""
    rollout = numpy.load(path)
    t_s, z_m = rollout["t_s"], rollout["p_m"][:, 2]
    mouth_m = z_m[-1] + depth_m
    is_in = z_m < mouth_m - DEPTH_M
    return float(t_s[is_in.argmax()] if is_in.any() else t_s[-1])


def judge(measures, path):
    """Deep is good, and every newton is bad: 20 N cost half of what the depth is worth."""
    depth_m, force_n = measures["depth_m"], measures["force_n"]
    reward = min(max(depth_m / DEPTH_M, 0.0), 1.0) - 0.5 * min(force_n / FORCE_N, 3.0)
    success = depth_m > DEPTH_M and force_n < FORCE_N
    return {"reward": reward, "success": success, "measures": {"entry_s": entry_s(path, depth_m)}}


for line in sys.stdin:
    rollout = json.loads(line)
    answer = judge(rollout["measures"], rollout["path"])
    print(json.dumps({"rollout": rollout["rollout"], **answer}), flush=True)
