# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Candidate sets of generic kernels for `basis.py`: maskings, Fresnel powers, roughnesses, diffuse shapes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

SIGMAS = np.geomspace(0.001, 0.5, 35)


@dataclass(frozen=True)
class Cosines:
    i: np.ndarray  # n.i
    o: float  # n.o
    h: np.ndarray  # n.h
    d: np.ndarray  # o.h


def masking(name: str, c: Cosines) -> np.ndarray:
    """G(i, o): no masking here depends on sigma."""
    kind, _, number = name.partition(":")
    a2 = float(number or 1) ** 2
    root_i, root_o = (np.sqrt(a2 + (1 - a2) * x * x) for x in (c.i, c.o))
    match kind:
        case "vgroove":
            return np.minimum(1, 2 * c.h * np.minimum(c.i, c.o) / c.d)
        case "smith":  # separable G1(i) G1(o), GGX of alpha
            return 4 * c.i * c.o / ((c.i + root_i) * (c.o + root_o))
        case "correlated":  # height-correlated Smith, GGX of alpha
            return 2 * c.i * c.o / (c.o * root_i + c.i * root_o)
        case "one":
            return np.ones_like(c.i)
        case "implicit":
            return c.i * c.o
        case "neumann":
            return np.minimum(c.i, c.o)
        case "kelemen":
            return np.minimum(c.i * c.o / c.d**2, 1e3)
        case "premoze":
            return c.i * c.o / (c.i + c.o - c.i * c.o)
    raise ValueError(name)


def specular(g: str, power: float, ndf_name: str, c: Cosines) -> np.ndarray:
    """Lobes of all `SIGMAS` times n.i, [35, S]; F is (1 - o.h)^power, so power 0 is the paper's tau = 1."""
    tan2 = 1 / c.h**2 - 1
    s2 = SIGMAS[:, None] ** 2
    if ndf_name == "ggx":
        ndf = s2 / (np.pi * c.h**4 * (s2 + tan2) ** 2)
    else:
        ndf = np.exp(-tan2 / s2) / (np.pi * s2 * c.h**4)
    return ndf * (masking(g, c) * (1 - c.d) ** power / (4 * c.o))


def diffuse(name: str, c: Cosines) -> np.ndarray:
    """Diffuse kernels times n.i, [S]."""
    f, e = (1 - c.o) ** 5, (1 - c.i) ** 5
    if name.startswith("hat:"):  # hat:knots_j,k = hat_j(n.i) hat_k(n.o) + the same with i and o swapped
        knots_text, _, pair = name[4:].partition("_")
        knots = np.array([float(x) for x in knots_text.split(",")])
        j, k = (int(x) for x in pair.split(","))
        at_i, at_o = (np.stack([np.interp(x, knots, row) for row in np.eye(len(knots))]) for x in (c.i, c.o))
        return (at_i[j] * at_o[k] + at_i[k] * at_o[j]) * c.i / np.pi
    shape = {
        "lambert": 1.0,
        "lambert_1mf": 1 - f,
        "lambert_f": f,
        "half": (1 - (1 - c.i / 2) ** 5) * (1 - (1 - c.o / 2) ** 5),  # Ashikhmin and Shirley 2000
        "grazing5": e + f,
        "grazing10": (1 - c.i) ** 10 + (1 - c.o) ** 10,
        "smith1": 1 / ((1 + c.i) * (1 + c.o)),
        "matte_1mf": (1 - e) * (1 - f),
        "matte_f": (1 - e) * f,
        "e_1mf": e * (1 - f),
        "e_f": e * f,
        "1md": 1 - c.d,
        "d2": c.d**2,
    }[name]
    return shape * c.i / np.pi


@dataclass(frozen=True)
class Candidate:
    """maskings x Fresnel powers x every `step`-th of the 35 sigmas, then the diffuse kernels."""

    maskings: tuple[str, ...]
    powers: tuple[int, ...] = (5, 0)
    step: int = 3
    diffuse: tuple[str, ...] = ("lambert",)
    ndf: str = "beckmann"

    @property
    def families(self) -> list[str]:
        """What `respond` computes at once: 'masking/power/ndf' (35 kernels each) and the diffuse names."""
        return [f"{g}/{p}/{self.ndf}" for g in self.maskings for p in self.powers] + list(self.diffuse)

    @property
    def keys(self) -> list[str]:
        lobes = [f for f in self.families if "/" in f]
        return [f"{f}/{s}" for f in lobes for s in range(0, len(SIGMAS), self.step)] + list(self.diffuse)


OLD_DIFFUSE = ("lambert_1mf", "lambert_f")
FIVE_DIFFUSE = ("lambert", "half", "grazing5", "grazing10", "smith1")
FIFTH_DIFFUSE = ("lambert_1mf", "lambert_f", "e_1mf", "e_f", "matte_1mf", "matte_f")
KNOTS = "0,0.07,0.2,0.5,1"
HATS = tuple(f"hat:{KNOTS}_{j},{k}" for j in range(5) for k in range(j, 5))
TWO = ("smith:0.2", "smith:1")

CANDIDATES = {
    "paper": Candidate(("vgroove",), step=1),
    "V-groove + old diffuse": Candidate(("vgroove",), step=1, diffuse=OLD_DIFFUSE),
    "V-groove + 5 diffuse": Candidate(("vgroove",), step=1, diffuse=FIVE_DIFFUSE),
    "height-correlated Smith 0.5 + old diffuse": Candidate(("correlated:0.5",), step=1, diffuse=OLD_DIFFUSE),
    "no masking + old diffuse, 12": Candidate(("one",), diffuse=OLD_DIFFUSE),
    "Kelemen + old diffuse, 12": Candidate(("kelemen",), diffuse=OLD_DIFFUSE),
    "Neumann + old diffuse, 12": Candidate(("neumann",), diffuse=OLD_DIFFUSE),
    "G = c_i c_o + old diffuse, 12": Candidate(("implicit",), diffuse=OLD_DIFFUSE),
    "Smith 0.5": Candidate(("smith:0.5",), step=1),
    "Smith 0.5 + old diffuse": Candidate(("smith:0.5",), step=1, diffuse=OLD_DIFFUSE),
    "V-groove, Smith 0.5 + old diffuse": Candidate(("vgroove", "smith:0.5"), step=1, diffuse=OLD_DIFFUSE),
    "Smith 0.2, 0.7 + old diffuse": Candidate(("smith:0.2", "smith:0.7"), step=1, diffuse=OLD_DIFFUSE),
    "Smith 0.3 + 5 diffuse, 12 sigmas": Candidate(("smith:0.3",), diffuse=FIVE_DIFFUSE),
    "Smith 0.3, powers 5 2 0 + 5 diffuse, 12": Candidate(("smith:0.3",), (5, 2, 0), diffuse=FIVE_DIFFUSE),
    "Smith 0.2, 1 + old diffuse, 12": Candidate(TWO, diffuse=OLD_DIFFUSE),
    "Smith 0.2, 1 + 5 diffuse, 12": Candidate(TWO, diffuse=FIVE_DIFFUSE),
    "Smith 0.2, 1 + 5 diffuse, 18": Candidate(TWO, step=2, diffuse=FIVE_DIFFUSE),
    "Smith 0.2, 1 + 5 diffuse, 35": Candidate(TWO, step=1, diffuse=FIVE_DIFFUSE),
    "Smith 0.2, 1 + 6 diffuse of fifth powers, 12": Candidate(TWO, diffuse=FIFTH_DIFFUSE),
    "Smith 0.2, 1, powers 5 2 0 + 6 diffuse of fifth powers, 12": Candidate(
        TWO, (5, 2, 0), diffuse=FIFTH_DIFFUSE
    ),
    "extended: Smith 0.2, 1, powers 5 2 0 + 5 diffuse, 12": Candidate(TWO, (5, 2, 0), diffuse=FIVE_DIFFUSE),
    "the same, powers 5 1 0": Candidate(TWO, (5, 1, 0), diffuse=FIVE_DIFFUSE),
    "the same, GGX lobes": Candidate(TWO, (5, 2, 0), diffuse=FIVE_DIFFUSE, ndf="ggx"),
    "the same, 18 sigmas": Candidate(TWO, (5, 2, 0), 2, FIVE_DIFFUSE),
    "the same, + 1 - o.h, (o.h)^2": Candidate(TWO, (5, 2, 0), diffuse=(*FIVE_DIFFUSE, "1md", "d2")),
    "the same, and V-groove": Candidate(("vgroove", *TWO), (5, 2, 0), diffuse=FIVE_DIFFUSE),
    "the same, and V-groove, powers 5 0": Candidate(("vgroove", *TWO), (5, 0), diffuse=FIVE_DIFFUSE),
    "the same, 15 product hats for diffuse": Candidate(TWO, (5, 2, 0), diffuse=HATS),
    "ceiling: Smith 0.1 0.3 1, powers 5 2 1 0, 18 + hats, o.h": Candidate(
        ("smith:0.1", "smith:0.3", "smith:1"), (5, 2, 1, 0), 2, (*HATS, "1md", "d2")
    ),
}
CHOSEN = "extended: Smith 0.2, 1, powers 5 2 0 + 5 diffuse, 12"
