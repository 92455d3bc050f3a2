# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Fig. 8: all MERL materials from a single picture, and whether the light it was taken under matters."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..arrays import F64
from ..baselines import Recovered, fit_reflectance, single_lobe_basis
from ..capture.images import read_coded
from ..light import Environment
from ..reflectance import GenericBasis, basis_by_name
from ..response import generic_responses
from ..simulate import MeasuredMaterials, Pairs
from ..solve import Problem
from .data import STAND_INS
from .experiment import Claim, Experiment, Figures, Plot, Setting, Table
from .pictures import Disc, caption, exposure_of, write_flat, write_small
from .spheres import rendered

CAPTURES, NOVEL = ("stpeters", "grace"), ("rnl", "uffizi")
WORDS = {"stpeters": "St. Peter's", "grace": "Grace", "rnl": "Grove", "uffizi": "Uffizi"}
BASES = ("paper", "extended")
PIXELS = 42
"""Along a side of the picture that is fitted, and of the test's: 1,250 of them show the sphere."""
RIM = 0.04
"""Least n.o, as in the prototype whose figures are to be beaten."""
AT_ONCE = 10
ACROSS = 4
"""Materials a line of the sheet."""
VIEW = np.array([0.0, -1.0, 0.0])
TEST_VIEW = np.array([0.35, -0.93, 0.15])


def measure(setting: Setting) -> Figures:
    """The novel-light error of each material by capture light, and of the parametric fit."""
    names = setting.data.merl_names or tuple(f"stand-in {i}" for i in range(STAND_INS))
    names = names[:: setting.pick(1, max(1, len(names) // 4))]
    runs: list[Figures] = []
    for start in range(0, len(names), AT_ONCE):
        chosen = names[start : start + AT_ONCE]

        def make(chosen: tuple[str, ...] = chosen) -> Figures:
            return {"runs": _some(setting, chosen)}

        runs += setting.kept(f"fig8-{start:03d}-{len(chosen)}", make)["runs"]
    return {"runs": runs, "measured": bool(setting.data.merl_names)}


def _some(setting: Setting, names: tuple[str, ...]) -> list[Figures]:
    """The figures of some materials, and their pictures."""
    brdfs = setting.data.merl(names)
    seen, test = (Disc.of(view, setting.pick(PIXELS, 15), RIM).pairs for view in (VIEW, TEST_VIEW))
    lights = {name: setting.data.probe(name) for name in (*CAPTURES, *NOVEL)}
    materials = MeasuredMaterials(brdfs)

    def lit(name: str, pairs: Pairs) -> F64:
        """Radiance [P, B, 3] of each material."""
        return materials.responses(
            lights[name], pairs.normal.astype(np.float64), pairs.to_viewer.astype(np.float64)
        )

    captured = {name: lit(name, seen) for name in CAPTURES}
    truth = {name: lit(name, test) for name in NOVEL}
    disc = Disc.of(TEST_VIEW, setting.pick(72, 24))
    pictures = [lit(name, disc.pairs) for name in NOVEL]
    found = []
    for b, brdf in enumerate(brdfs):
        fits = {"ngan": _everywhere(single_lobe_basis(), fit_reflectance(brdf)[None])}
        for basis in BASES:
            for name in CAPTURES:
                fits[f"{basis} {name}"] = _fitted(basis, lights[name], seen, captured[name][:, b])
        errors = {
            label: {light: _error(fit, lights[light], test, truth[light][:, b]) for light in NOVEL}
            for label, fit in fits.items()
        }
        found.append({"material": brdf.name, "errors": errors})
        shown = [fits["extended stpeters"], fits["ngan"]]
        _picture(
            disc, setting.folder / "fig8" / f"{brdf.name}.png", b, pictures, shown, [lights[x] for x in NOVEL]
        )
    return found


def _fitted(basis: str, light: Environment, pairs: Pairs, radiance: F64) -> Recovered:
    """One representative for the whole sphere, from one picture (N = n = 1: Eq. 6)."""
    generic = basis_by_name(basis)
    responses = generic_responses(generic, light.pyramid(), pairs.normal, pairs.to_viewer)
    offsets = np.arange(len(pairs.texel) + 1)
    problem = Problem(responses, radiance.astype(np.float32), offsets)
    fitted = problem.representatives(np.ones((problem.texels, 1)))
    return _everywhere(generic, fitted.representatives)


def _everywhere(basis: GenericBasis, representative: F64) -> Recovered:
    """One reflectance [1, J, 3] for the whole sphere."""
    return Recovered(basis, representative, np.ones((1, 1)), 1, "converged")


def _look(fit: Recovered, light: Environment, pairs: Pairs) -> F64:
    return rendered(fit, np.ones((len(pairs.texel), 1)), light, pairs)


def _error(fit: Recovered, light: Environment, pairs: Pairs, truth: F64) -> float:
    """NRMS of a picture's pixels."""
    return float(np.sqrt(((_look(fit, light, pairs) - truth) ** 2).sum() / (truth**2).sum()))


def _picture(
    disc: Disc, file: Path, b: int, truth: list[F64], fits: list[Recovered], lights: list[Environment]
) -> None:
    """Reference, ours and the parametric fit under both novel lights, in a row, at one exposure a light."""
    tiles = []
    for reference, light in zip(truth, lights, strict=True):
        exposure = exposure_of(reference[:, b])
        rows = [reference[:, b], *(_look(fit, light, disc.pairs) for fit in fits)]
        tiles += [disc.image(radiance, exposure) for radiance in rows]
    write_flat(file, np.concatenate(tiles, axis=1))


def contact_sheet(setting: Setting, names: list[str]) -> None:
    """All materials' rows on one sheet, ACROSS a line, each under its name."""
    rows = []
    for name in names:
        tile = read_coded(setting.folder / "fig8" / f"{name}.png")
        rows.append(np.concatenate([caption(name, tile.shape[1])[..., :3], tile]))
    rows += [np.full_like(rows[0], 255)] * (-len(rows) % ACROSS)
    lines = [np.concatenate(rows[i : i + ACROSS], axis=1) for i in range(0, len(rows), ACROSS)]
    sheet = np.concatenate(lines)
    write_small(setting.pictures / "fig8.jpg", sheet.astype(np.uint8))


def run(setting: Setting) -> Figures:
    """Measure, and put the pictures on a sheet."""
    figures = measure(setting)
    contact_sheet(setting, [r["material"] for r in figures["runs"]])
    return figures


def errors(figures: Figures, label: str, light: str | None = None) -> F64:
    """Novel-light NRMS of each material [B]: of one light, or the mean of both."""
    chosen = [light] if light else list(NOVEL)
    return np.array([np.mean([r["errors"][label][x] for x in chosen]) for r in figures["runs"]])


PROTOTYPE = {"paper": (0.070, 0.082), "extended": (0.042, 0.041)}
"""Medians under Uffizi and Grove that a prototype reached on 34 of the materials."""
ALIKE = (0.8, 1.25)
"""Ratio of a material's errors from the two capture lights that counts as no difference."""


def claims(figures: Figures) -> list[Claim]:
    """Good fits for all, whatever the capture light, and better than parametric ones."""
    ngan = errors(figures, "ngan")
    what = "MERL materials" if figures["measured"] else "stand-in materials"
    found = []
    for basis in BASES:
        first, second = (errors(figures, f"{basis} {name}") for name in CAPTURES)
        both = np.concatenate([first, second])
        better = float(np.mean(np.maximum(first, second) < ngan))
        words = (
            f"{100 * np.median(first):.1f} % from {WORDS[CAPTURES[0]]} and {100 * np.median(second):.1f} %"
        )
        words += f" from {WORDS[CAPTURES[1]]}"
        found.append(
            Claim(
                f"The generic basis works for all {what} ({basis} basis), better than single lobes.",
                f"median NRMS {words}, 90th percentile {100 * np.quantile(both, 0.9):.1f} %, worst "
                f"{100 * both.max():.0f} %; single lobe (Ngan et al. 2005) {100 * np.median(ngan):.1f} %; "
                f"better from either light for {100 * better:.0f} % of them",
                better > 0.9,
                "V-groove masking and a diffuse kernel that does not depend on the view cannot make the rims "
                "of measured materials (docs/basis.md): that is what the extended basis is for. The single "
                "lobe is fitted to the whole reflectance and has no picture to mislead it.",
            )
        )
        low, high = np.quantile(first / second, (0.1, 0.9))
        found.append(
            Claim(
                f"Quality does not depend significantly on the capture light ({basis} basis).",
                f"medians {words}; a material's two errors have a ratio of {low:.2f} to {high:.2f} "
                "(10th to 90th percentile)",
                bool(ALIKE[0] < low and high < ALIKE[1]),
                f"the medians are within {100 * abs(np.median(first) / np.median(second) - 1):.0f} % of each "
                "other.",
            )
        )
        if figures["measured"]:
            medians = [
                float(np.median([errors(figures, f"{basis} {c}", light) for c in CAPTURES]))
                for light in ("uffizi", "rnl")
            ]
            found.append(
                Claim(
                    f"Beyond the paper: medians below the prototype's ({basis} basis).",
                    f"Uffizi {100 * medians[0]:.1f} %, Grove {100 * medians[1]:.1f} %; the prototype's "
                    + ", ".join(f"{100 * x:.1f} %" for x in PROTOTYPE[basis]),
                    all(m < p for m, p in zip(medians, PROTOTYPE[basis], strict=True)),
                    "the prototype had 34 of the materials, these are all 100, and which light it captured "
                    "under is not on record; from Grace alone the medians are "
                    + " and ".join(
                        f"{100 * np.median(errors(figures, f'{basis} grace', x)):.1f} %"
                        for x in ("uffizi", "rnl")
                    )
                    + ".",
                )
            )
    return found


def tables(figures: Figures) -> list[Table]:
    """Quantiles by method, and the worst."""
    labels = {
        **{f"{b} {c}": f"{b}, from {WORDS[c]}" for b in BASES for c in CAPTURES},
        "ngan": "single lobe",
    }
    rows = []
    for label, words in labels.items():
        cells = []
        for light in NOVEL:
            e = 100 * errors(figures, label, light)
            cells += [f"{np.median(e):.1f}", f"{np.quantile(e, 0.9):.1f}"]
        rows.append((words, *cells))
    head = ("method", *(f"{WORDS[x]} {q}" for x in NOVEL for q in ("median", "90th")))
    listed_errors = [errors(figures, x) for x in ("extended stpeters", "paper stpeters", "ngan")]
    worst = np.argsort(-errors(figures, "extended stpeters"))[:10]
    listed = tuple(
        (
            figures["runs"][i]["material"],
            *(f"{100 * e[i]:.1f}" for e in listed_errors),
        )
        for i in worst
    )
    count = len(figures["runs"])
    return [
        Table(head, tuple(rows), f"novel-light NRMS in % over {count} materials"),
        Table(("the ten worst", "extended", "paper", "single lobe"), listed, "captured under St. Peter's"),
    ]


def plots(figures: Figures) -> list[Plot]:
    """The error of every material, ordered by that of ours, as at the top of the paper's figure."""
    kinds = {"single lobe": "ngan", "paper's basis": "paper stpeters", "extended basis": "extended stpeters"}
    order = np.argsort(errors(figures, "extended stpeters"))
    curves = {
        words: [(float(i), 100 * float(e)) for i, e in enumerate(errors(figures, label)[order])]
        for words, label in kinds.items()
    }
    return [Plot("fig8-errors", curves, "materials, ordered by ours", "novel-light NRMS in %")]


FIG8 = Experiment(
    "fig8",
    "Fig. 8: MERL materials from one picture",
    run,
    claims,
    tables,
    minutes=8,
    how="Each material on a sphere, rendered by dense quadrature, one picture of 1,250 pixels down to n.o = "
    "0.04; NRMS of such a picture from another view under both novel lights. The parametric fit knows the "
    "whole reflectance instead of a picture: one Lambertian and one Cook-Torrance lobe by Ngan et "
    "al.'s distance.",
    plots=plots,
    pictures=(("fig8.jpg", "Fig. 8: reference, ours, single lobe; under Grove, then Uffizi"),),
)
