"""A judge of pancakes: skillet learn pancake --config config/pancake-judge.toml

It pays for height, for half a turn and for the catch, and charges for a pan that strays sideways. NumPy is
used where it is installed.
"""

import json
import math
import sys

try:
    import numpy
except ImportError:
    numpy = None


def sway(path):
    """How far the pan strays sideways during the rollout, m; 0 without NumPy."""
    y = numpy.load(path)["p_m"][:, 1] if numpy else []
    return float(max(y) - min(y)) if len(y) else 0.0


for line in sys.stdin:
    rollout = json.loads(line)
    measured, sway_m = rollout["measures"], sway(rollout["path"])
    turn = min(abs(measured["turn_rad"]), math.pi) / math.pi
    reward = 1.5 * min(measured["apex_m"], 0.55) + turn + 2.0 * measured["caught"] - sway_m
    answer = {"reward": reward, "success": measured["caught"], "measures": {"sway_m": sway_m}}
    print(json.dumps({"rollout": rollout["rollout"], **answer}), flush=True)
