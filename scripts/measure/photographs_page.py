# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The page's section on photographs.py, which itself needs Mitsuba; this does not."""

from __future__ import annotations

from typing import Any

import numpy as np
import results

Figures = dict[str, Any]
BOUNDS = {"lens": 0.3, "probe": 0.05, "degrees": 0.1, "distance": 0.002}
"""Pixels after the best turn, NRMS on a map of 128, degrees, share of the distance."""
PROBE = "nrms_128"
HEAD = ("way", "NRMS %", "inner %", "PSNR-L dB", "SSIM", "n, N")


def section(figures: Figures) -> str:
    """Words, bounds and tables."""
    rows = figures["rows"]
    true_poses = all(row["steps"]["poses"]["true"] for row in rows)
    width, height = figures["size"]
    poses = (
        "Poses are the true ones here; `swatchwork prepare register` was left out."
        if true_poses
        else "Poses are from clicks in the first photograph."
    )
    parts = [
        f"""Mitsuba renders a scan ({figures["triangles"]:,} triangles) painted with photographed metal and
rust, and a mirror ball, under {figures["light"]} through a distorted lens of {width} x {height} pixels.
A simulated camera (photons, read noise, saturation, response, coding) takes {figures["views"]} views at three
exposures, two balls at five, 12 boards at one; the public commands do the rest. {poses}
The material is compared under {figures["novel"]} in novel views with Mitsuba's renders of the true one.
*jpeg*: 8 bits, 4:2:2, quality 95, response recovered from the brackets; *linear16*: PNG of 16 bits, its
response given. The renders' own noise is {100 * figures["noise"]["object"]:.1f} % NRMS in the photographs and
{100 * figures["noise"]["test"]:.1f} % in what the material is compared with, and in all errors here.

{results.verdicts([verdict for row in rows for verdict in _verdicts(row)])}"""
    ]
    if figures["picture"]:
        parts.append(f"![photographs, poses, light, and renders]({figures['picture']})")
    parts += [_steps(rows), *(_ways(row) for row in rows)]
    return "\n\n".join(parts)


def _verdicts(row: Figures) -> list[results.Verdict]:
    steps, name = row["steps"], row["camera"]
    found = [
        (f"{name}: lens, worst over the picture", steps["lens"]["worst_after_turn_px"], BOUNDS["lens"], "px"),
        (f"{name}: probe, area means on 128 x 64", steps["probe"][PROBE], BOUNDS["probe"], "%"),
    ]
    if not steps["poses"]["true"]:
        degrees, distance = max(steps["poses"]["degrees"]), max(steps["poses"]["distance"])
        found.append((f"{name}: pose, worst frame's angle", degrees, BOUNDS["degrees"], "degrees"))
        found.append((f"{name}: pose, worst frame's place", distance, BOUNDS["distance"], "%"))
    return found


def _steps(rows: list[Figures]) -> str:
    """What each step's result is off by, a column for each camera."""

    def percent(value: float) -> str:
        return f"{100 * value:.2f} %"

    of = [row["steps"] for row in rows]
    lines = [
        ["board corners, rms left", *(f"{s['calibration_rms_px']:.3f} px" for s in of)],
        ["focal length", *(f"{100 * s['lens']['focal']:+.3f} %" for s in of)],
        ["lens, worst over the picture", *(f"{s['lens']['worst_px']:.3f} px" for s in of)],
        ["the same after the best turn", *(f"{s['lens']['worst_after_turn_px']:.3f} px" for s in of)],
        ["response, rms of its log", *(f"{s['response_rms_log']:.3f}" for s in of)],
        ["radiance on the object", *(percent(s["radiance_nrms"]) for s in of)],
        ["the same, means of 4 x 4 pixels", *(percent(s["radiance_of_blocks_nrms"]) for s in of)],
        ["radiance on the ball", *(percent(s["radiance_of_balls_nrms"]) for s in of)],
        ["ball's unit over the object's", *(_largest(s["balls_over_photographs"]) for s in of)],
        *(
            [f"probe, area means on {w} x {w // 2}", *(percent(s["probe"][f"nrms_{w}"]) for s in of)]
            for w in (64, 128, 256)
        ),
        [
            "the same on 128 x 64, perfect balls",
            *(percent(s["probe_of_perfect_balls"][PROBE]) for s in of),
        ],
        ["irradiance from the probe", *(percent(s["probe"]["irradiance_nrms"]) for s in of)],
        ["second ball's rotation, estimated", *(f"{s['second_ball_degrees']:.2f} degrees" for s in of)],
    ]
    if not of[0]["poses"]["true"]:
        lines.append(["pose, worst angle", *(f"{max(s['poses']['degrees']):.3f} degrees" for s in of)])
        lines.append(["pose, worst place", *(percent(max(s["poses"]["distance"])) for s in of)])
    table = results.table(["step", *(row["camera"] for row in rows)], lines, markdown=True)
    return f"""Each step against the truth (NRMS where it is a share of radiance). Radiance is after one
factor a channel, that of the photographs, which a camera's unit leaves open: the probe has the same, and it
cancels in the material. Both probes are averaged over the texels of one map, so that what the ball cannot
resolve is in neither; parts of the sphere that no ball shows would be left out, and two balls show all of it.

{table}"""


def _ways(row: Figures) -> str:
    ways = row["ways"]
    lines = []
    for name, way in ways.items():
        e = way["evaluation"]
        lines.append(
            [
                name,
                f"{100 * e['nrms']:.2f}",
                f"{100 * e['nrms_inner']:.2f}",
                f"{e['psnr_l']:.2f}",
                f"{e['ssim']:.4f}",
                f"{way['n']}, {way['N']}",
            ]
        )
    loss = ways["pictures"]["evaluation"]["nrms"] / ways["perfect"]["evaluation"]["nrms"] - 1
    prepare = ("calibrate", "linearize", "linearize balls", "register", "probe")
    seconds = sum(row["seconds"].get(step, 0) for step in prepare)
    return f"""*{row["camera"]}*, novel light and views: what the pictures cost is {100 * loss:+.1f} % of the
perfect capture's error. That is one run of each, the renders' noise is in both, and n and N are searched for
anew: where they differ, so do the materials for that reason too. Preparing took {seconds:.0f} s.

{results.table(list(HEAD), lines, markdown=True)}"""


def _largest(ratios: list[float]) -> str:
    return f"{ratios[int(np.argmax(np.abs(np.log(ratios))))]:.3f}"
