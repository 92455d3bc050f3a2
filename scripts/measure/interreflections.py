# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""What interreflections are worth on a capture that has them, what they cost, and a convex one as control.

    python scripts/measure/interreflections.py --captures ../shared/captures \\
        --json target/validation/interreflections.json
    python scripts/measure/interreflections.py --captures ../shared/captures --check \\
        --json target/validation/interreflections-check.json

One reconstruction of each capture, then rounds of solving and blending under the light that the object
sends to itself; beside them as many rounds without that light, for going on alone might gain as well. Each is
relit under test/'s light without and with interreflections, from its cameras at a third of their size.

Columns: NRMS in % over alpha > 0.5, of all pixels; of those whose texel's sky the object hides to more than
SHUT_IN (cosine-weighted), of the rest, and of those hidden to more than DEEP; CPU time up to there, over that
of the plain reconstruction in the same process (wall time says little on a busy machine); the process's peak
memory up to there, relighting included.
"""

from __future__ import annotations

import argparse
import resource
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import results
from captures import hidden_share, texels_of

from swatchwork.capture import Capture, Frame, read_capture, read_photograph
from swatchwork.interreflection import PLACES, bounced, indirect_share, surroundings
from swatchwork.keeping import IN_MEMORY, Array, Kept
from swatchwork.light import read_environment
from swatchwork.observe import stratified
from swatchwork.reconstruct import (
    Reconstruction,
    ReconstructOptions,
    reconstruct,
    shadows_of,
    surface_of,
    under_its_own_light,
)
from swatchwork.relight import render
from swatchwork.response import representative_responses
from swatchwork.streaming import blend_every_texel, solve_on_subset
from swatchwork.surface import build_atlas, padded
from swatchwork.workflow.pages import relit

NAMES = ("spot-merl-interreflect", "sphere-merl")
SHUT_IN, DEEP = 0.1, 0.3
"""Hidden shares of the sky. At the former indirect light is several percent of all light; at the latter it is
as much as the direct light in places, but of spot's test pixels not one in a hundred lies there."""
SMALLER = 3
"""Times that test frames are reduced."""
BOUNCES = (0, 2)
ROUNDS = 2


@dataclass(frozen=True)
class Target:
    """A test frame at a third of its size, and how much of each pixel's sky the object hides."""

    frame: Frame
    radiance: np.ndarray
    used: np.ndarray
    hidden: np.ndarray


def targets(test: Capture, found: Reconstruction) -> list[Target]:
    scene = relit(found)
    hidden = hidden_share(scene, found.observations.atlas.normal(slice(None)))
    made = []
    for frame in test.frames:
        photograph, c = read_photograph(frame), frame.camera
        s, size = SMALLER, (c.width // SMALLER, c.height // SMALLER)
        camera = replace(c, width=size[0], height=size[1], fx=c.fx / s, fy=c.fy / s, cx=c.cx / s, cy=c.cy / s)
        radiance, alpha = (
            cv2.resize(image, size, interpolation=cv2.INTER_AREA)
            for image in (photograph.radiance, photograph.alpha)
        )
        half = replace(frame, camera=camera)
        texel = texels_of(scene, half)
        share = np.where(texel >= 0, hidden[texel], 0.0)
        made.append(Target(half, radiance.reshape(-1, 3).astype(np.float64), alpha.ravel() > 0.5, share))
    return made


def errors(found: Reconstruction, test: Capture, seen: list[Target], bounces: int) -> dict[str, float]:
    """NRMS of the parts of the pixels."""
    scene, light = relit(found), read_environment(test.environment)
    indirect = scene.indirect(light, bounces)
    sums = {name: np.zeros(2) for name in ("all", "shut_in", "open", "deep")}
    for target in seen:
        image = render(scene, target.frame.camera, light, 1, indirect)[..., :3].reshape(-1, 3)
        off, of = ((image - target.radiance) ** 2).sum(axis=1), (target.radiance**2).sum(axis=1)
        shut_in = target.hidden > SHUT_IN
        for name, part in zip(sums, (True, shut_in, ~shut_in, target.hidden > DEEP), strict=True):
            here = target.used & part
            sums[name] += off[here].sum(), of[here].sum()
    return {name: float(np.sqrt(a / b)) if b > 0 else 0.0 for name, (a, b) in sums.items()}


def gone_on(found: Reconstruction, options: ReconstructOptions) -> Reconstruction:
    """The control: a further round of solving and blending, without indirect light."""
    solution = solve_on_subset(
        found.rendering, found.basis, options.texels, options.solve, start=found.solution
    )
    return replace(found, solution=solution, blend=blend_every_texel(found.rendering, found.basis, solution))


class Once:
    """A keeper: more rounds go on from the parts of fewer."""

    def __init__(self) -> None:
        self.parts: dict[str, Kept] = {}

    def kept(self, name: str, make: Callable[[], Mapping[str, Array]]) -> Kept:
        if name not in self.parts:
            self.parts[name] = IN_MEMORY.kept(name, make)
        return self.parts[name]


def noise(found: Reconstruction) -> dict[str, float]:
    """How the light shown to the photographs changes with the places that it is gathered at.

    Two sets of places, of 80 and 75 % of those in use: each is off by 1 / sqrt(2) of their difference, and by
    somewhat more than all of them would be.
    """
    most = min(PLACES, len(found.observations.atlas))
    surface, sky = found.surface, found.rendering.sky
    known = found.basis, found.solution.representatives
    pairs = found.rendering.pairs(stratified(found.observations, 2000, 1))
    seen, blend = pairs.seen, surface.blend(pairs.seen.texel)
    direct = np.einsum("pn,pnc->p", blend, found.rendering.under(None).representatives(*known, pairs))
    shown = []
    for places in (int(0.8 * most), int(0.75 * most)):
        around = surroundings(found.scene, surface.atlas, sky, found.blend.texel_of_pixel, places=places)
        light, respond = bounced(surface, around), partial(representative_responses, *known)
        where = seen.frame, seen.texel, seen.normal, seen.to_viewer
        responses = light.responses(*where, found.solution.N, respond)
        shown.append(direct + np.einsum("pn,pnc->p", blend, responses) * pairs.weight)
    off = np.abs(shown[0] - shown[1]) / np.sqrt(2)
    relative = np.quantile(off / shown[0], [0.5, 0.9, 0.99])
    total = float(np.sqrt((off**2).sum() / (shown[0] ** 2).sum()))
    return {"nrms": total} | dict(zip(("median", "tenth", "hundredth"), map(float, relative), strict=True))


def measure(folder: Path, resolution: int) -> list[dict[str, Any]]:
    """A row for each fit and each number of bounces in relighting."""
    capture, test = read_capture(folder), read_capture(folder / "test")
    options = ReconstructOptions(resolution=resolution)
    rows: list[dict[str, Any]] = []
    spent, seen, first = 0.0, None, 0.0

    def note(fit: str, found: Reconstruction, seconds: float) -> None:
        nonlocal spent, seen, first
        spent += seconds
        first = first or seconds
        seen = seen or targets(test, found)
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1e6 if sys.platform == "darwin" else 1e3)
        for bounces in BOUNCES:
            cost = {"cpu_ratio": spent / first, "cpu_s": spent, "peak_mb": peak}
            kind = {"capture": folder.name, "fit": fit, "bounces": bounces}
            size = {"n": found.solution.n, "N": found.solution.N, "data": found.solution.data}
            rows.append(kind | size | cost | errors(found, test, seen, bounces))
            print(results.table(HEAD, [cells(rows[-1])]).splitlines()[1], flush=True)

    start = time.process_time()
    plain = found = reconstruct(capture, options)
    note("plain", plain, time.process_time() - start)
    keeper = Once()
    for rounds in range(1, ROUNDS + 1):
        start = time.process_time()
        found = under_its_own_light(plain, replace(options, interreflections=rounds), keeper=keeper)
        note(f"rounds: {rounds}", found, time.process_time() - start)
    assert found.indirect is not None
    if len(found.indirect.around):
        rows[0]["indirect"] = vars(indirect_share(found.rendering, found.surface))
    spent, on = first, plain
    start = time.process_time()
    for _ in range(ROUNDS):
        on = gone_on(on, options)
    note(f"as many without light: {ROUNDS}", on, time.process_time() - start)
    return rows


SHARES = ("median", "ninth_tenth", "last_hundredth")
HEAD = ["capture", "fit", "bounces in relight", "n, N", "NRMS", "shut in", "open", "deep", "cpu ratio", "MB"]


def cells(r: dict[str, Any]) -> list[str]:
    """A row of the table."""
    parts = [f"{100 * r[name]:.2f}" if r[name] > 0 else "-" for name in ("all", "shut_in", "open", "deep")]
    size = f"{r['n']}, {r['N']}"
    return [
        r["capture"],
        r["fit"],
        str(r["bounces"]),
        size,
        *parts,
        f"{r['cpu_ratio']:.2f}",
        f"{r['peak_mb']:.0f}",
    ]


def checked(captures: Path, resolution: int) -> dict[str, Any]:
    """The noise of the first capture's indirect light, and at how many places the last one sees itself."""
    options = ReconstructOptions(resolution=resolution)
    found = reconstruct(read_capture(captures / NAMES[0]), options)
    around = surroundings(found.scene, found.surface.atlas, found.rendering.sky, found.blend.texel_of_pixel)
    lit = found.rendering.under(bounced(found.surface, around))
    mesh, scene, _ = surface_of(read_capture(captures / NAMES[-1]), resolution)
    atlas = build_atlas(mesh, resolution)
    convex = surroundings(scene, atlas, shadows_of(scene, atlas), padded(atlas))
    return {"noise": noise(replace(found, rendering=lit)), "places_of_convex": len(convex)}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--captures", type=Path, required=True, help="folder of capture folders")
    parser.add_argument("--only", nargs="+", choices=NAMES, default=NAMES[:1])
    parser.add_argument("--resolution", type=int, default=128, help="of the atlas")
    parser.add_argument("--json", type=Path, help="write the figures here")
    parser.add_argument("--check", action="store_true", help="noise and convex control alone, by themselves")
    args = parser.parse_args()
    if args.check:
        figures = checked(args.captures, args.resolution)
        print(figures)
        results.write(args.json, {"resolution": args.resolution} | figures)
        return
    rows: list[dict[str, Any]] = []
    for name in args.only:
        rows += measure(args.captures / name, args.resolution)
        results.write(args.json, {"resolution": args.resolution, "rows": rows})
    print(results.table(HEAD, [cells(r) for r in rows]))


if __name__ == "__main__":
    main()
