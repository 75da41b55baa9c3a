"""What tuples with arrays look like at the prompt: numbers in short, arrays by their shape. Standard library only."""

from typing import Any


def brief(value: Any, *names: str) -> str:
    """`Trial(rollout=3, theta=<20 numbers>)` for the attributes `names` of `value`."""
    return f"{type(value).__name__}({', '.join(f'{name}={_short(getattr(value, name))}' for name in names)})"


def _short(value: Any) -> str:
    if shape := getattr(value, "shape", ()):
        return f"<{'×'.join(map(str, shape))} {'rows' if value.dtype.names else 'numbers'}>"
    if isinstance(value, dict):
        return f"<{len(value)} entries>"
    value = value.item() if hasattr(value, "item") else value
    return f"{value:.6g}" if isinstance(value, float) else repr(value)
