"""placeholder until the scenario branch lands"""
from typing import Any
def invalid(message: str, **k: Any) -> ValueError:
    return ValueError(message)
