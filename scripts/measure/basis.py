# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Which generic basis do measured materials need? The experiment behind docs/basis.md.

A sphere of one measured material is captured under one light probe, fitted by a non-negative combination of
a candidate basis (relative error, channels separate: Eq. 6 with one representative), and compared under
other probes.

    python scripts/measure/basis.py --data ../shared/data --table choose
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from candidates import CANDIDATES, CHOSEN, Candidate, Cosines, diffuse, specular
from scipy.optimize import nnls
from sphere import (
    BINS,
    Pixels,
    Samples,
    directions,
    light_on,
    light_pyramid,
    ring_samples,
    seen,
    views_around,
)

from swatchwork.simulate import measured

CAPTURED = (  # materials of the project's real captures: the basis must not be chosen on them
    "pink-plastic",
    "hematite",
    "yellow-phenolic",
    "blue-metallic-paint",
    "red-metallic-paint",
    "white-paint",
    "green-plastic",
)
UP = np.array([0.0, 1.0, 0.0])  # all four probes are brightest overhead
TEST_ANGLES_DEG = [40.0, 80.0, 110.0, 140.0]  # of the view from overhead; beyond 90 is back-lit


# ---- scenes --------------------------------------------------------------------------------------
@dataclass
class Scene:
    """Pixels under one light, and their responses: kernels by key, materials by set and name; all [P, 3]."""

    pixels: Pixels
    kernels: dict[str, np.ndarray] = field(default_factory=dict)
    truth: dict[str, np.ndarray] = field(default_factory=dict)


def materials(data: Path) -> dict[str, measured.MeasuredBrdf]:
    """All the measured materials but those in our captures, by 'set/name'."""
    out: dict[str, measured.MeasuredBrdf] = {}
    for kind, file, read in (
        ("merl", "merl_nbrdf.npz", measured.read_neural_brdf),
        ("rgl", "rgl_isotropic_nbrdf.npz", measured.read_neural_brdf),
        ("npf", "merl_npf.npz", measured.read_npf),
    ):
        path = data / "merl" / file
        for name in measured.material_names(path):
            if name not in CAPTURED:
                out[f"{kind}/{name}"] = read(path, name)
    return out


def tables(s: Samples, todo: dict[str, object]) -> Iterator[tuple[str, np.ndarray]]:
    """f cos_i on the samples: 'masking/power/ndf' [35, S], diffuse kernels [1, S], materials [3, S]."""
    c = Cosines(s.i[:, 2], float(s.o[2]), s.h[:, 2], s.o_h)
    for key, what in todo.items():
        if isinstance(what, str):
            if "/" in what:
                g, power, ndf = what.split("/")
                yield key, specular(g, float(power), ndf, c)
            else:
                yield key, diffuse(what, c)[None]
        else:
            yield key, (what.evaluate(s.i, s.o) * c.i[:, None]).T  # type: ignore[attr-defined]


def respond(
    scenes: dict[tuple[str, str], Scene], pyramids: dict, todo: dict[str, object], density: float
) -> None:
    """Fill in the responses of kernels (strings) and materials (objects) for all scenes, bin by bin."""
    for b, cos_o in enumerate(BINS):
        s = ring_samples(float(cos_o), density)
        rows = {k: np.nonzero(v.pixels.bin == b)[0] for k, v in scenes.items()}
        lights = [light_on(s, scenes[k].pixels.frame[r], pyramids[k[1]]) for k, r in rows.items()]
        light = np.concatenate(lights)
        edges = np.cumsum([0] + [len(x) for x in lights])
        for key, table in tables(s, todo):
            table = np.ascontiguousarray(table, dtype=np.float32)
            if not isinstance(todo[key], str):  # a material: channel by channel
                value = np.einsum("psc,cs->pc", light, table)
                _store(scenes, rows, edges, value, key, "truth")
            else:
                value = np.matmul(table, light)  # [P, K, 3]
                for k in range(len(table)):
                    name = f"{key}/{k}" if len(table) > 1 else key
                    _store(scenes, rows, edges, value[:, k], name, "kernels")


def _store(scenes: dict, rows: dict, edges: np.ndarray, value: np.ndarray, key: str, where: str) -> None:
    for n, (scene, r) in enumerate(rows.items()):
        store = getattr(scenes[scene], where)
        if key not in store:
            store[key] = np.zeros((len(scenes[scene].pixels.bin), 3), np.float32)
        store[key][r] = value[edges[n] : edges[n + 1]]


def build_scenes() -> dict[tuple[str, str], Scene]:
    """Captures by one view (twice) and by six, under two lights; four test views under the other two."""
    scenes = {}
    for light in ("stpeters", "grace"):
        for n, angle in enumerate((60.0, 100.0)):
            scenes[f"one{n}", light] = Scene(seen(directions(800, 10 + n), views_around(UP, [angle], 20 + n)))
        scenes["six", light] = Scene(seen(directions(500, 12), directions(6, 22)))
    for light in ("uffizi", "rnl"):
        scenes["test", light] = Scene(seen(directions(500, 13), views_around(UP, TEST_ANGLES_DEG, 23)))
    return scenes


# ---- fits ----------------------------------------------------------------------------------------
@dataclass(frozen=True)
class FitOptions:
    noise: float = 0.01  # of the capture, relative
    ridge: float = 0.0  # on coefficients of columns of unit norm
    floor: float = 0.0  # of a texel's norm in gamma, in units of the median texel's


def gammas(scene: Scene, b: np.ndarray, floor: float) -> np.ndarray:
    """1 / ||s_hat_x||^2 of each pixel's texel, over its views and channels."""
    texel = scene.pixels.texel
    energy = np.bincount(texel, (b**2).sum(1))[texel]
    return 1 / np.maximum(energy, floor**2 * np.median(energy) + 1e-30)


def fit(a: np.ndarray, b: np.ndarray, gamma: np.ndarray, ridge: float) -> np.ndarray:
    """Non-negative coefficients [3, J] of responses [P, 3, J] for radiance [P, 3]."""
    j = a.shape[-1]
    w = np.sqrt(gamma)[:, None]
    out = []
    for c in range(3):
        r = np.linalg.qr(np.concatenate([w * a[:, c], w * b[:, c : c + 1]], axis=1), mode="r")
        scale = np.linalg.norm(r[:, :j], axis=0) + 1e-12
        left, right = r[:, :j] / scale, r[:, j]
        if ridge:
            left, right = np.concatenate([left, ridge * np.eye(j)]), np.concatenate([right, np.zeros(j)])
        x, _ = nnls(left, right, maxiter=30 * j)
        out.append(x / scale)
    return np.array(out)


def nrms(a: np.ndarray, b: np.ndarray, w: np.ndarray) -> float:
    return float(np.sqrt((w[:, None] * (a - b) ** 2).sum() / (w[:, None] * b**2).sum()))


def errors(
    scenes: dict, keys: list[str], capture: tuple[str, str], names: list[str], options: FitOptions
) -> dict:
    """NRMS by material: the fit (relative); by novel light: all pixels, rim (n.o < 0.2), back-lit views."""
    scene = scenes[capture]
    stacked = {k: np.stack([scenes[k].kernels[n] for n in keys], -1) for k in (capture, *TESTS)}
    rng = np.random.default_rng(0)
    out = {}
    for name in names:
        clean = scene.truth[name].astype(np.float64)
        b = clean * (1 + options.noise * rng.normal(size=clean.shape))
        gamma = gammas(scene, b, options.floor)
        x = fit(stacked[capture].astype(np.float64), b, gamma, options.ridge)
        row = [nrms(np.einsum("pcj,cj->pc", stacked[capture], x), b, gamma)]
        for test in TESTS:
            pixels, truth = scenes[test].pixels, scenes[test].truth[name]
            got = np.einsum("pcj,cj->pc", stacked[test], x)
            # Texels are spread evenly over the surface; n.o makes it evenly over the image.
            for part in (pixels.cosine > 0, pixels.cosine < 0.2, pixels.view >= 2):
                row.append(nrms(got[part], truth[part], pixels.cosine[part]))
        out[name] = row
    return out


def report(
    scenes: dict,
    label: str,
    candidate: Candidate,
    light: str,
    names: list[str],
    options: FitOptions = FitOptions(),
) -> None:
    """One line of a Markdown table."""
    cells = []
    for captures in (["one0", "one1"], ["six"]):
        rows = [
            r for c in captures for r in errors(scenes, candidate.keys, (c, light), names, options).values()
        ]
        half, tail = 100 * np.median(rows, axis=0), 100 * np.percentile(rows, 90, axis=0)
        cells += [f"{half[0]:.1f}"]
        cells += [f"{half[k]:.1f} / {tail[k]:.1f}" for k in (1, 4)]
        cells += [f"{half[k]:.0f}, {half[k + 3]:.0f}" for k in (2, 3)]
    print(f"| {label} | {len(candidate.keys)} | " + " | ".join(cells) + " |", flush=True)


HEADER = """
| candidate | J | 1 view: fit | Uffizi | Grove | rim | back-lit \
| 6 views: fit | Uffizi | Grove | rim | back-lit |
|---|---|---|---|---|---|---|---|---|---|---|---|"""
TESTS = (("test", "uffizi"), ("test", "rnl"))
FINALISTS = (
    "paper",
    "V-groove, Smith 0.5 + old diffuse",
    "Smith 0.2, 0.7 + old diffuse",
    "Smith 0.3, powers 5 2 0 + 5 diffuse, 12",
    "Smith 0.2, 1 + 5 diffuse, 12",
    "Smith 0.2, 1 + 6 diffuse of fifth powers, 12",
    CHOSEN,
    "the same, 18 sigmas",
)


def subset(scenes: dict, prefix: str, residues: tuple[int, ...] = (0, 1, 2, 3)) -> list[str]:
    """Materials of a set whose place in the alphabet has one of these residues modulo 4."""
    names = [n for n in sorted(scenes[TESTS[0]].truth) if n.startswith(prefix)]
    return [n for k, n in enumerate(names) if k % 4 in residues]


def table_choose(scenes: dict) -> None:
    print("\nMERL, half of the materials, captured under St. Peter's" + HEADER)
    for label, candidate in CANDIDATES.items():
        report(scenes, label, candidate, "stpeters", subset(scenes, "merl", (0, 1)))


def table_confirm(scenes: dict) -> None:
    for title, light, prefix, residues in (
        ("MERL, the other half, captured under Grace", "grace", "merl", (2, 3)),
        ("RGL, all, captured under St. Peter's", "stpeters", "rgl", (0, 1, 2, 3)),
        ("NPF, all, captured under Grace", "grace", "npf", (0, 1, 2, 3)),
    ):
        print(f"\n{title}" + HEADER)
        for label in FINALISTS:
            report(scenes, label, CANDIDATES[label], light, subset(scenes, prefix, residues))


def table_regularise(scenes: dict) -> None:
    print("\nThe chosen basis, MERL, half of the materials, St. Peter's" + HEADER)
    for options in (
        *(FitOptions(noise=n) for n in (0, 0.01, 0.03)),
        *(FitOptions(ridge=r) for r in (0.001, 0.01, 0.03, 0.1)),
        *(FitOptions(floor=f) for f in (0.1, 0.3, 1.0, 3.0)),
        FitOptions(noise=0.03, ridge=0.03),
    ):
        label = f"noise {options.noise:g}, ridge {options.ridge:g}, floor {options.floor:g}"
        report(scenes, label, CANDIDATES[CHOSEN], "stpeters", subset(scenes, "merl", (0, 1)), options)


def table_worst(scenes: dict) -> None:
    print(
        "\nThe ten worst of MERL, six views under St. Peter's, chosen basis, NRMS %:\n"
        "| material | fit | Uffizi | Grove | rim, Uffizi | rim, Grove | best possible |\n"
        "|---|---|---|---|---|---|---|"
    )
    keys = CANDIDATES[CHOSEN].keys
    rows = errors(scenes, keys, ("six", "stpeters"), subset(scenes, "merl"), FitOptions())
    # What the basis can say at all: fitted to the novel images themselves, with the weights of their NRMS.
    for name, row in sorted(rows.items(), key=lambda item: -(item[1][1] + item[1][4]))[:10]:
        best = []
        for test in TESTS:
            a = np.stack([scenes[test].kernels[n] for n in keys], -1).astype(np.float64)
            b, w = scenes[test].truth[name].astype(np.float64), scenes[test].pixels.cosine
            best.append(nrms(np.einsum("pcj,cj->pc", a, fit(a, b, w / (b**2).mean(), 0.0)), b, w))
        values = " | ".join(f"{100 * row[k]:.1f}" for k in (0, 1, 4, 2, 5))
        print(f"| {name} | {values} | {100 * best[0]:.1f}, {100 * best[1]:.1f} |")


def table_model(scenes: dict) -> None:
    """Materials of the paper's own model, whose V-groove masking the chosen basis does not have."""
    print("\nThe paper's model, sigma x tau, diffuse 0.3 under tau = 0.05, St. Peter's" + HEADER)
    for scene in scenes.values():
        k = scene.kernels
        for s in (8, 16, 22, 27, 31):
            for tau, ground in ((0.05, 0.3), (0.5, 0.0)):
                lobe = tau * k[f"vgroove/0/beckmann/{s}"] + (1 - tau) * k[f"vgroove/5/beckmann/{s}"]
                scene.truth[f"model/{s}/{tau}"] = lobe + ground * k["lambert"]
    for label in (
        "paper",
        CHOSEN,
        "the same, 18 sigmas",
        "the same, and V-groove",
        "the same, and V-groove, powers 5 0",
    ):
        report(scenes, label, CANDIDATES[label], "stpeters", subset(scenes, "model"))


def check_quadrature(data: Path, density: float = 2.0) -> None:
    """Materials and chosen kernels by the samples used here against twice the rings and azimuths."""
    pyramid = light_pyramid(data / "envmaps/latlong/stpeters_1024x512.hdr")
    todo: dict[str, object] = {f: f for f in CANDIDATES[CHOSEN].families}
    todo.update(list(materials(data).items())[::5])
    pixels = seen(directions(150, 5), views_around(UP, [60.0, 120.0], 6))
    results = []
    for d in (1.0, density):
        scene = {("check", "stpeters"): Scene(pixels)}
        respond(scene, {"stpeters": pyramid}, todo, d)
        results.append(scene["check", "stpeters"])
    w = pixels.cosine
    for title, pick in (("materials", "truth"), ("kernels", "kernels")):
        a, b = (getattr(r, pick) for r in results)
        off = np.array([nrms(a[k], b[k], w) for k in b])
        print(
            f"{title}: NRMS against a {density:g} times denser quadrature, median {np.median(off):.4f}, "
            f"90th percentile {np.percentile(off, 90):.4f}, worst {off.max():.4f}"
        )


def table_denser(data: Path) -> None:
    """The finalists once more with twice the rings and azimuths, on every sixth material."""
    scenes = build_scenes()
    todo: dict[str, object] = {f: f for label in FINALISTS for f in CANDIDATES[label].families}
    todo.update([item for item in materials(data).items() if item[0].startswith("merl")][::6])
    for density in (1.0, 2.0):
        respond(scenes, pyramids(data), todo, density)
        print(f"\nMERL, every sixth, St. Peter's, quadrature density {density:g}" + HEADER)
        for label in FINALISTS:
            report(scenes, label, CANDIDATES[label], "stpeters", subset(scenes, "merl"))


def pyramids(data: Path) -> dict[str, list[np.ndarray]]:
    names = ("stpeters", "grace", "rnl", "uffizi")
    return {n: light_pyramid(data / f"envmaps/latlong/{n}_1024x512.hdr") for n in names}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, required=True, help="folder with envmaps/latlong and merl")
    parser.add_argument(
        "--table",
        choices=["choose", "confirm", "regularise", "worst", "model", "quadrature", "denser"],
        nargs="+",
        required=True,
    )
    args = parser.parse_args()
    start = time.time()
    if "quadrature" in args.table:
        check_quadrature(args.data)
    if "denser" in args.table:
        table_denser(args.data)
    rest = [t for t in args.table if t not in ("quadrature", "denser")]
    if rest:
        scenes = build_scenes()
        todo: dict[str, object] = {f: f for c in CANDIDATES.values() for f in c.families}
        todo.update(materials(args.data))
        respond(scenes, pyramids(args.data), todo, 1.0)
        for table in rest:
            printers = {
                "choose": table_choose,
                "confirm": table_confirm,
                "regularise": table_regularise,
                "worst": table_worst,
                "model": table_model,
            }
            printers[table](scenes)
    print(f"\n{time.time() - start:.0f} s")


if __name__ == "__main__":
    main()
