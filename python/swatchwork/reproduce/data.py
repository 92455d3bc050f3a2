# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Light probes, measured materials and textures from a folder the user names, or stand-ins that say so.

The folder (``--data``) may hold, all optional:

- ``envmaps/latlong/NAME_1024x512.hdr`` for the probes grace, stpeters, rnl (Eucalyptus Grove) and uffizi;
- ``merl/NAME.binary``, full MERL tables, or ``merl/merl_nbrdf.npz``, their Neural-BRDF fits;
- ``textures/rustymetal/albedo.jpg`` and ``roughness.jpg``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..arrays import F64, Float
from ..capture import EnvironmentSource
from ..errors import InputError
from ..light import Environment, read_environment
from ..reflectance import GenericBasis
from ..simulate import (
    MeasuredBrdf,
    four_materials,
    ggx_basis,
    in_ggx,
    many_materials,
    material_names,
    procedural_environment,
    read_merl_binary,
    read_neural_brdf,
)

PROBES = {"grace": "room", "stpeters": "atelier", "rnl": "sky", "uffizi": "overcast"}
"""The probes, and the procedural light that stands in for each."""
# Three quarters of a turn bring the files' frame (y up) to ours (z up).
Z_UP = np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])


@dataclass(frozen=True)
class KernelBrdf:
    """A material of a generic basis as a function of directions."""

    name: str
    basis: GenericBasis
    weights: F64
    """[J, 3]"""

    def evaluate(self, i_in_local: Float, o_in_local: Float) -> F64:
        """BRDF values [..., 3]."""
        used = np.flatnonzero(self.weights.any(axis=1))
        values = self.basis.evaluate(i_in_local, o_in_local, [int(j) for j in used])
        return np.asarray(values @ self.weights[used])


@dataclass(frozen=True)
class Data:
    """A folder, or none."""

    folder: Path | None = None

    def __post_init__(self) -> None:
        if self.folder is not None and not self.folder.is_dir():
            raise InputError("no such folder", file=self.folder, expected="a data folder", hint="See --help")

    def probe(self, name: str) -> Environment:
        """A probe by name, z up, of mean radiance 1 so that experiments are alike; a stand-in without it."""
        file = None if self.folder is None else self.folder / "envmaps" / "latlong" / f"{name}_1024x512.hdr"
        if file is None or not file.is_file():
            return procedural_environment(PROBES[name], seed=3)
        return read_environment(EnvironmentSource(file, "mitsuba", Z_UP))

    @property
    def merl_names(self) -> tuple[str, ...]:
        """Names of the measured materials at hand; none without a folder."""
        if self.folder is None:
            return ()
        tables = tuple(sorted(file.stem for file in (self.folder / "merl").glob("*.binary")))
        networks = self.folder / "merl" / "merl_nbrdf.npz"
        return tables or (material_names(networks) if networks.is_file() else ())

    def merl(self, names: Sequence[str]) -> list[MeasuredBrdf]:
        """Measured materials by name; stand-ins (GGX lobes that no basis has) without a folder."""
        if not self.merl_names:
            recipes = four_materials(1) if len(names) <= 4 else many_materials(len(names), 1)
            weights = in_ggx(recipes[: len(names)])
            return [KernelBrdf(r.name, ggx_basis(), w) for r, w in zip(recipes, weights, strict=False)]
        assert self.folder is not None, "it has names"
        table = self.folder / "merl"
        return [
            read_merl_binary(table / f"{name}.binary")
            if (table / f"{name}.binary").is_file()
            else read_neural_brdf(table / "merl_nbrdf.npz", name)
            for name in names
        ]

    def words(self) -> str:
        """What the figures rest on, for the page."""
        if self.folder is None:
            return "Procedural lights and GGX materials stand in for probes and measured ones."
        probes = [
            name for name in PROBES if (self.folder / "envmaps/latlong" / f"{name}_1024x512.hdr").is_file()
        ]
        tables = any((self.folder / "merl").glob("*.binary"))
        kind = "full tables" if tables else "Neural-BRDF fits" if self.merl_names else "none, stand-ins"
        return f"Probes: {', '.join(probes) or 'none, stand-ins'}. MERL materials: {kind}."
