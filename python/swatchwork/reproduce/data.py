# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Light probes, measured materials and textures from a folder the user names, or stand-ins that say so.

The folder (``--data``) may hold, all optional:

- ``envmaps/latlong/NAME_1024x512.hdr`` for the probes grace, stpeters, rnl (Eucalyptus Grove) and uffizi;
- ``merl/NAME.binary``, full MERL tables, or ``merl/merl_nbrdf.npz``, their Neural-BRDF fits;
- ``textures/rustymetal/albedo.jpg`` and ``roughness.jpg``.
"""

from __future__ import annotations

import hashlib
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

FOUR = ("pink-plastic", "hematite", "yellow-phenolic", "blue-metallic-paint")
"""The paper's four MERL materials (section 7.1)."""
STAND_INS = 12
"""For all of MERL's."""
PROBES = {"grace": "room", "stpeters": "atelier", "rnl": "sky", "uffizi": "overcast"}
"""The probes, and the procedural light that stands in for each."""
# A quarter turn about x brings the files' frame (y up) to ours (z up).
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
        """A probe by name, z up, in its own unit; a procedural stand-in of mean radiance 1 without it."""
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
            return [stand_in(name) for name in names]
        assert self.folder is not None, "it has names"
        table = self.folder / "merl"
        networks = table / "merl_nbrdf.npz"
        found: list[MeasuredBrdf] = []
        for name in names:
            if (table / f"{name}.binary").is_file():
                found.append(read_merl_binary(table / f"{name}.binary"))
            elif networks.is_file():
                found.append(read_neural_brdf(networks, name))
            else:
                raise InputError(
                    f"has no {name}.binary",
                    file=table,
                    expected="a table for each of the materials",
                )
        return found

    def files(self) -> list[Path]:
        """The files that experiments may read, those that are there."""
        if self.folder is None:
            return []
        latlong, merl, metal = (self.folder / x for x in ("envmaps/latlong", "merl", "textures/rustymetal"))
        wanted = [latlong / f"{name}_1024x512.hdr" for name in PROBES]
        wanted += [*sorted(merl.glob("*.binary")), merl / "merl_nbrdf.npz"]
        wanted += [metal / "albedo.jpg", metal / "roughness.jpg"]
        return [file for file in wanted if file.is_file()]

    def fingerprint(self) -> str:
        """SHA-256 of those files' names and bytes."""
        digest = hashlib.sha256()
        for file in self.files():
            digest.update(file.name.encode() + hashlib.sha256(file.read_bytes()).digest())
        return digest.hexdigest()

    def words(self) -> str:
        """What the figures rest on, for the page."""
        if self.folder is None:
            return "Procedural lights, GGX materials and random fields stand in for all measured data."
        probes = [f.name.split("_")[0] for f in self.files() if f.suffix == ".hdr"]
        tables = any((self.folder / "merl").glob("*.binary"))
        kind = "full tables" if tables else "Neural-BRDF fits" if self.merl_names else "GGX stand-ins"
        missing = sorted(set(PROBES) - set(probes))
        lights = f"Probes: {', '.join(probes)}" if probes else "No probes"
        lights += f" (procedural stand-ins for {', '.join(missing)})" if missing else ""
        texture = "a photographed one" if any(f.suffix == ".jpg" for f in self.files()) else "random fields"
        return f"{lights}. MERL materials: {kind}. Texture: {texture}."


def stand_in(name: str) -> KernelBrdf:
    """A GGX material, outside the generic bases, for a measured one that is not at hand."""
    known = dict(zip(FOUR, four_materials(1), strict=True))
    known |= {f"stand-in {i}": material for i, material in enumerate(many_materials(STAND_INS, 1))}
    return KernelBrdf(name, ggx_basis(), in_ggx((known[name],))[0])
