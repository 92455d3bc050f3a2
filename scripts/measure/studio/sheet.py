from dataclasses import dataclass
from typing import Any


@dataclass
class Story:
    a: Any


def write(*a):
    pass
