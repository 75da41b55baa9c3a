"""A running controller, by way of the tool: status, policies, live values."""

import json
import os
import subprocess
import tempfile
from pathlib import Path
from typing import Any, Iterator, Optional, Union

from . import _tool
from ._policy import Policy


class Cell:
    """A cell by its name.

        cell = skillet.Cell("kitchen")
        number = cell.load("policy.toml")
        cell.activate(number)

    Every method calls the tool with --json and returns its output, or raises `ToolError` with the tool's message.
    """

    def __init__(self, name: str = "skillet", *, timeout: float = 60.0):
        self.name, self.timeout = name, timeout

    def _run(self, *arguments: str) -> Any:
        return _tool.run(*arguments, "--cell", self.name, "--json", timeout=self.timeout)

    def status(self) -> dict[str, Any]:
        """Health, phase, tick, active policy, latencies …; the fields of `skillet status --json`."""
        return self._run("status")

    @property
    def is_running(self) -> bool:
        try:
            return self.status()["controller"] == "running"
        except _tool.ToolError as error:
            if error.exit_code == 3:
                return False
            raise

    def policies(self) -> Any:
        """The catalogue of the cell."""
        return self._run("policy", "list")

    def load(self, policy: Union[Policy, str, os.PathLike], policy_id: Optional[int] = None) -> dict[str, Any]:
        """Checks a policy, a policy file or a session (its selected policy, or `policy_id`) and imports it; the reply has its
        number as `policy_id`."""
        if isinstance(policy, Policy):
            with tempfile.TemporaryDirectory() as folder:
                file = Path(folder) / "policy.json"
                policy.write(file)
                return self._run("policy", "import", str(file))
        chosen = () if policy_id is None else ("--id", str(policy_id))
        return self._run("policy", "import", os.fspath(policy), *chosen)

    def activate(self, policy: Union[int, str, dict], now: bool = False) -> dict[str, Any]:
        """Makes a policy the active one: its number, "last-good", or the reply of `load`; `now` blends it into the
        rollout in progress. Returns when it is applied, with the exact tick."""
        if isinstance(policy, dict):
            policy = policy["policy_id"]
        return self._run("policy", "activate", str(policy), "--at", "now" if now else "next-rollout")

    def pin(self) -> dict[str, Any]:
        """Keeps serving the active policy and ignores the learner; persists across restarts."""
        return self._run("policy", "pin")

    def unpin(self) -> dict[str, Any]:
        """Accepts the learner's proposals again."""
        return self._run("policy", "unpin")

    def roll_back(self) -> dict[str, Any]:
        """Returns to the policy that was active before, else to the last good one."""
        return self._run("policy", "rollback")

    def watch(self, duration_s: Optional[float] = None) -> Iterator[dict[str, Any]]:
        """One dict a second: loop, policies, trials; the fields of `skillet watch --json`. A slow reader never affects
        the loop. For every tick see `examples/live.py`."""
        limit = () if duration_s is None else ("--duration-s", str(duration_s))
        command = [_tool.find(), "watch", "--cell", self.name, "--json", *limit]
        with subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                              text=True) as child:
            assert child.stdout
            try:
                for line in child.stdout:
                    value = json.loads(line)
                    if "error" in value and "cell" not in value:
                        error = value["error"]
                        raise _tool.ToolError(error["message"], error["exit_code"])
                    yield value
            finally:
                child.terminate()

    def __repr__(self) -> str:
        return f"<Cell {self.name}>"
