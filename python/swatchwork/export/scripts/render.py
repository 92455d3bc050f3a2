# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Render frames of this folder's scene with Mitsuba 3 (pip install mitsuba).

    python render.py                       the first frame, into renders/
    python render.py --frame all --spp 512

One EXR a frame under the frame's own name: linear, RGB premultiplied by alpha; direct light with shadows,
or with --depth 3 and above light that bounces between parts too. The default variant needs LLVM's shared
library (libllvm 17 or newer); --variant cuda_ad_rgb needs an NVIDIA GPU, scalar_rgb nothing, and a day.
"""

import argparse
import json
from pathlib import Path

import mitsuba as mi

HERE = Path(__file__).resolve().parent


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--frame", default="0", help="number of a frame in frames.json, or all")
    parser.add_argument("--spp", type=int, default=256, help="samples a pixel")
    parser.add_argument("--depth", type=int, default=2, help="2: direct light; -1: every bounce")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--variant", default="llvm_ad_rgb")
    parser.add_argument("--output", type=Path, default=HERE / "renders")
    args = parser.parse_args()
    mi.set_variant(args.variant)
    import swatchwork_bsdf  # noqa: F401  registers the plugin, for the variant in force

    frames = json.loads((HERE / "frames.json").read_text(encoding="utf-8"))["frames"]
    chosen = range(len(frames)) if args.frame == "all" else [int(args.frame)]
    scenes = {}
    for number in chosen:
        frame = frames[number]
        light = frame["environment"], frame["world_from_environment"]
        if light not in scenes:
            scenes[light] = mi.load_file(
                str(HERE / "scene.xml"),
                depth=args.depth,
                environment=light[0],
                world_from_environment=light[1],
            )
        image = mi.render(scenes[light], sensor=number, spp=args.spp, seed=args.seed)
        path = args.output / f"{frame['name']}.exr"
        path.parent.mkdir(parents=True, exist_ok=True)
        mi.Bitmap(image).write(str(path))
        print(path)


if __name__ == "__main__":
    main()
