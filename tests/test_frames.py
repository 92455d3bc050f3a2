# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Whole photographs that cannot be what the others foretell of them."""

from __future__ import annotations

import json
import shutil
import warnings
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from swatchwork.capture import Capture, Photograph, read_capture, read_photograph
from swatchwork.errors import CaptureWarning, InputError
from swatchwork.keeping import IN_MEMORY, Array, Kept
from swatchwork.material import read_material
from swatchwork.observe import Lights, Observations, Rendering, SmallPicture, observe
from swatchwork.observe.pixels import pixel_map
from swatchwork.reconstruct import ReconstructOptions, frame_options, reconstruct, shadows_of, surface_of
from swatchwork.reflectance import basis_by_name
from swatchwork.simulate import simulate_capture, slip_exposure, spoil_capture, turn_light, turn_pose
from swatchwork.solve import SolveOptions
from swatchwork.streaming import (
    Diagnosis,
    Evidence,
    FrameOptions,
    blend_every_texel,
    diagnose,
    solve_on_subset,
)
from swatchwork.streaming.displaced import descend, misfit
from swatchwork.streaming.frames import _all_scales
from swatchwork.surface import Atlas, RayScene, SkyMasks, build_atlas
from swatchwork.workflow.cautions import left_out_by_frame
from swatchwork.workflow.pages import photograph_rows
from swatchwork.workflow.recovery import reconstruct_folder, recover
from swatchwork.workflow.viewing import verdicts_of

BAD = 2
QUICK = ReconstructOptions(48, texels=80, solve=SolveOptions(n=1, N=2))


class Stage:
    """A blob in nine photographs, with its surface and shadows made once."""

    def __init__(self, folder: Path) -> None:
        simulate_capture(folder, object_shape="blob", rows=32, k=9, test_views=1, size=96, noise_percent=1.0)
        self.folder, self.capture = folder, read_capture(folder)
        mesh, self.scene, _ = surface_of(self.capture, 64)
        self.atlas: Atlas = build_atlas(mesh, 64)
        self.sky: SkyMasks = shadows_of(self.scene, self.atlas)

    def rendering(self, capture: Capture) -> Rendering:
        return Rendering(observe(capture, self.atlas, self.scene), Lights.of_capture(capture), self.sky)

    def diagnosed(self, capture: Capture, options: FrameOptions | None = None) -> Diagnosis:
        basis, centre = basis_by_name("extended"), self.scene.centre
        return diagnose(self.rendering(capture), basis, capture, centre, options)


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Stage:
    return Stage(tmp_path_factory.mktemp("frames"))


def test_sound_photographs_are_not_named(stage: Stage) -> None:
    found = stage.diagnosed(stage.capture)
    assert found.suspects == () and found.in_words() == []
    assert not found.changes and all(frame.points > 30 for frame in found.frames)
    # Ten times what one photograph's noise does to a median of some hundred points.
    assert max(abs(np.log(frame.scale)) for frame in found.frames) < 0.05


@pytest.mark.filterwarnings("ignore::swatchwork.errors.CaptureWarning")
@pytest.mark.parametrize(
    ("fault", "kind", "words"),
    [
        (lambda c: slip_exposure(c, BAD, 2.0), "exposure", "times as bright as the other photographs"),
        (lambda c: turn_pose(c, BAD, 5.0, "object"), "pose", "with its camera moved around the object by"),
        (lambda c: turn_light(c, BAD, 15.0), "light", "with its light turned about the vertical by"),
    ],
)
def test_a_wrong_photograph_is_named(
    stage: Stage, fault: Callable[[Capture], Capture], kind: str, words: str
) -> None:
    found = stage.diagnosed(fault(stage.capture))
    assert [frame.name for frame in found.suspects] == ["images/0003.exr"]
    suspect = found.suspects[0]
    assert suspect.kind == kind and words in found.in_words()[0]
    if kind == "exposure":
        # The model's misfit, at a size of 96 pixels, is a few per cent.
        assert suspect.scale == pytest.approx(2.0, rel=0.08)
        assert found.scale[BAD] == suspect.scale and not found.left_out.any()
    else:
        # The search's last step is half a degree of a pose, 1.5 of the light.
        assert suspect.degrees == pytest.approx({"pose": 5.0, "light": 15.0}[kind], abs=1.6)
        np.testing.assert_array_equal(np.flatnonzero(found.left_out), [BAD])
        assert (found.scale == 1).all()


@pytest.mark.filterwarnings("ignore::swatchwork.errors.CaptureWarning")
def test_a_camera_turned_away_is_left_out(stage: Stage) -> None:
    """The mesh lies beside the object: that it is wrong must be said, what it is may be."""
    found = stage.diagnosed(turn_pose(stage.capture, BAD, 5.0, "camera"))
    assert [frame.name for frame in found.suspects] == ["images/0003.exr"]
    assert found.suspects[0].kind in ("pose", "disagrees")
    np.testing.assert_array_equal(np.flatnonzero(found.left_out), [BAD])


def test_scales_of_all_photographs(stage: Stage) -> None:
    factor = np.exp(np.random.default_rng(4).normal(0, 0.04, 9))
    capture = stage.capture
    for frame, of in enumerate(factor):
        capture = slip_exposure(capture, frame, float(of))
    found = stage.diagnosed(capture, FrameOptions(scale="all"))
    assert not found.left_out.any()
    truth = factor / np.exp(np.log(factor).mean())
    # Without it, photographs are off by 4 % (root mean square).
    assert np.sqrt(np.mean(np.log(found.scale / truth) ** 2)) < 0.015
    assert np.log(found.scale).mean() == pytest.approx(0, abs=1e-9)


@pytest.fixture(scope="module")
def littered(stage: Stage, tmp_path_factory: pytest.TempPathFactory) -> Callable[[float], Capture]:
    """The stage's capture with a share of its pixels outliers."""

    def of(share: float) -> Capture:
        folder = tmp_path_factory.mktemp("littered") / "capture"
        shutil.copytree(stage.folder, folder)
        spoil_capture(folder, share)
        return read_capture(folder)

    return of


@pytest.mark.filterwarnings("ignore::swatchwork.errors.CaptureWarning")
def test_a_wrong_photograph_is_named_among_outliers(
    stage: Stage, littered: Callable[[float], Capture]
) -> None:
    capture = littered(0.05)
    assert stage.diagnosed(capture).suspects == ()
    turned = stage.diagnosed(turn_pose(capture, BAD, 5.0, "object"))
    assert [(frame.name, frame.kind) for frame in turned.suspects] == [("images/0003.exr", "pose")]
    # The search's last step is half a degree.
    assert turned.suspects[0].degrees == pytest.approx(5, abs=1.6)
    slipped = stage.diagnosed(slip_exposure(littered(0.2), BAD, 2.0))
    assert [(frame.name, frame.kind) for frame in slipped.suspects] == [("images/0003.exr", "exposure")]
    assert slipped.suspects[0].scale == pytest.approx(2.0, rel=0.08) and not slipped.doubt


def test_too_many_contradictions_are_said() -> None:
    sound = Diagnosis((Evidence("a", 100, misfit=0.2),) * 5, FrameOptions())
    assert sound.doubt == "" and sound.as_dict()["doubt"] == ""
    spoilt = Diagnosis((Evidence("a", 100, misfit=0.8),) * 5, FrameOptions())
    assert "too many contradictions to judge" in spoilt.doubt and "0.80, expected at most" in spoilt.doubt
    assert spoilt.as_dict()["doubt"] == spoilt.doubt and spoilt.in_words() == []


def test_choices_that_exclude_one_another() -> None:
    with pytest.raises(InputError, match="--keep-suspects or --frame-scale all, not both"):
        FrameOptions("all", keep_suspects=True)
    paper = ReconstructOptions(solve=SolveOptions(search_order="paper"))
    assert frame_options(paper).keep_suspects and not frame_options(QUICK).keep_suspects
    with pytest.raises(InputError, match="--search-order paper or --frame-scale all, not both"):
        frame_options(replace(paper, frames=FrameOptions("all")))


def test_a_frame_that_cannot_be_compared_keeps_its_exposure() -> None:
    shown = [SimpleNamespace(exposure=np.full(size, off)) for size, off in ((50, 0.3), (50, 0.1), (5, 3.0))]
    model = SimpleNamespace(fitted=None)
    court = SimpleNamespace(each=lambda model: shown, foretold=SimpleNamespace(fit=lambda *given: model))
    found = _all_scales(court, model, np.ones(3, bool), [Evidence(str(i)) for i in range(3)])  # type: ignore[arg-type]
    np.testing.assert_allclose(np.log([frame.scale for frame in found]), [0.1, -0.1, 0.0], atol=1e-12)


def evidence(kinds: list[str]) -> tuple[Evidence, ...]:
    return tuple(Evidence(f"{i}.exr", 100, 1.5, kind=kind) for i, kind in enumerate(kinds))  # type: ignore[arg-type]


def test_what_is_done_with_suspects() -> None:
    found = evidence(["", "exposure", "pose", "", ""])
    by_default = Diagnosis(found, FrameOptions())
    np.testing.assert_array_equal(by_default.scale, [1, 1.5, 1, 1, 1])
    np.testing.assert_array_equal(by_default.left_out, [False, False, True, False, False])
    never = Diagnosis(found, FrameOptions(scale="off"))
    assert (never.scale == 1).all() and never.left_out.tolist() == [False, True, True, False, False]
    every = Diagnosis(found, FrameOptions(scale="all"))
    np.testing.assert_array_equal(every.scale, [1.5, 1.5, 1, 1.5, 1.5])
    fewer = Diagnosis(found[:3], FrameOptions(scale="all"))
    assert not fewer.changes and "3 photographs, expected at least 4" in fewer.in_words()[-1]
    kept = Diagnosis(found, FrameOptions(keep_suspects=True))
    assert not kept.changes and all("it was kept" in words for words in kept.in_words())
    few = Diagnosis(found[:3], FrameOptions())
    assert not few.changes and "too few to do without" in few.in_words()[0]
    assert [row.done for row in photograph_rows(by_default)] == ["", "scaled by 1 / 1.5", "left out", "", ""]
    again = Diagnosis.of(IN_MEMORY.kept("frames", by_default.arrays))
    assert again == by_default and json.loads(json.dumps(again.as_dict()))["frames"][2]["done"] == "left out"


def test_two_photographs_cannot_be_told_apart(stage: Stage) -> None:
    found = stage.diagnosed(slip_exposure(stage.capture, 0, 3.0).first(2))
    assert found.suspects == () and not any(frame.points for frame in found.frames)
    assert photograph_rows(found) == ()


def test_corrected_observations(stage: Stage) -> None:
    given = stage.rendering(stage.capture).observations
    scale, out = np.ones(9), np.zeros(9, bool)
    scale[1], out[4] = 2.0, True
    found: Observations = given.corrected(scale, out)
    texels = given.seen.astype(np.int64)
    before, after = given.pairs(texels), found.pairs(texels)
    there = before.frame != 4
    np.testing.assert_array_equal(after.frame, before.frame[there])
    factor = np.where(after.frame == 1, 2.0, 1.0).astype(np.float32)
    np.testing.assert_array_equal(after.radiance, before.radiance[there] / factor[:, None])
    np.testing.assert_array_equal(
        found.coverage, np.bincount(after.texel, minlength=len(found.coverage)).astype(np.uint16)
    )
    assert len(found) == len(after)
    with pytest.raises(InputError, match="all photographs are left out"):
        given.corrected(scale, np.ones(9, bool))


def test_a_small_picture_shows_what_the_photograph_does(stage: Stage) -> None:
    frame = stage.capture.frames[0]
    photograph, scene = read_photograph(frame), RayScene([stage.scene.meshes[0]])
    pixels = pixel_map(scene, frame.camera)
    valid = photograph.valid.copy()
    valid[:, :40] = False
    halved = Photograph(photograph.radiance, photograph.alpha, valid)
    small = SmallPicture.of(halved, frame.camera, pixels, scene.meshes[0].vertices)
    at = frame.camera.pixel_centres()
    radiance, cover = small.look(at)
    known = np.isfinite(cover)
    # A picture smaller than SIDE is not shrunk: at pixel centres it is the photograph.
    assert known.reshape(96, 96)[:, 44:90].mean() > 0.5 and not known.reshape(96, 96)[:, :40].any()
    whole = known & (photograph.alpha.ravel() == 1)
    assert whole.sum() > 500
    np.testing.assert_allclose(radiance[whole], photograph.radiance.reshape(-1, 3)[whole], rtol=1e-4)
    np.testing.assert_allclose(cover[known], photograph.alpha.ravel()[known], atol=1e-4)


def test_misfit_and_search() -> None:
    difference = np.concatenate([np.zeros(60), np.full(20, 5.0), np.full(20, np.nan)])
    assert misfit(difference) == pytest.approx(0.25, abs=1e-3)
    assert misfit(difference, np.arange(100) < 20) == pytest.approx(40 / 80, abs=1e-3)
    assert np.isnan(misfit(difference[:10]))
    found = descend(lambda x: float(((x - [3.0, -1.5]) ** 2).sum()), np.zeros(2), (2.0, 1.0, 0.5))
    assert found.misfit == 0 and found.degrees == pytest.approx(np.hypot(3, 1.5)) and found.gain == 1


def test_the_clean_answer_is_the_plain_one(stage: Stage) -> None:
    found = reconstruct(stage.capture, QUICK)
    mesh, scene, resolution = surface_of(stage.capture, QUICK.resolution)
    atlas = build_atlas(mesh, resolution)
    observed = observe(stage.capture, atlas, scene)
    rendering = Rendering(observed, Lights.of_capture(stage.capture), shadows_of(scene, atlas))
    plain = solve_on_subset(rendering, found.basis, QUICK.texels, QUICK.solve)
    np.testing.assert_array_equal(found.solution.representatives, plain.representatives)
    blend = blend_every_texel(rendering, found.basis, plain, QUICK.solve.search, QUICK.solve.seed)
    for name in ("index", "weight", "residual"):
        np.testing.assert_array_equal(getattr(found.blend, name), getattr(blend, name))


class Remembering:
    """A keeper that holds on to every part, and stops before one."""

    def __init__(self) -> None:
        self.parts: dict[str, Kept] = {}
        self.made: list[str] = []
        self.stop = ""

    def kept(self, name: str, make: Callable[[], Mapping[str, Array]]) -> Kept:
        if name == self.stop:
            raise KeyboardInterrupt
        if name not in self.parts:
            self.made.append(name)
            self.parts[name] = IN_MEMORY.kept(name, make)
        return self.parts[name]


@pytest.mark.filterwarnings("ignore::swatchwork.errors.CaptureWarning")
def test_left_out_with_outliers_and_interreflections_resumed(
    stage: Stage, littered: Callable[[float], Capture]
) -> None:
    capture = turn_pose(littered(0.1), BAD, 5.0, "object")
    options = ReconstructOptions(
        48, texels=300, solve=SolveOptions(n=2, N=4, tolerance=0.05), interreflections=1
    )
    keeper = Remembering()
    whole = reconstruct(capture, options, keeper=keeper)
    np.testing.assert_array_equal(np.flatnonzero(whole.frames.left_out), [BAD])
    assert whole.solution.outliers is not None and whole.indirect is not None
    assert BAD not in whole.rendering.pairs(whole.observations.seen.astype(np.int64)).seen.frame
    shares = whole.blend.left_out_by_frame
    # A tenth of the pixels, and the samples that they have a part in.
    assert shares is not None and np.delete(shares, BAD).min() > 0.05
    assert left_out_by_frame(whole)["left_out_by_frame"][BAD] is None
    half = Remembering()
    half.stop = "bounce-1-solve"
    with pytest.raises(KeyboardInterrupt):
        reconstruct(capture, options, keeper=half)
    half.stop, before = "", list(half.made)
    again = reconstruct(capture, options, keeper=half)
    assert before + half.made[len(before) :] == keeper.made and "frames" in before
    np.testing.assert_array_equal(again.solution.representatives, whole.solution.representatives)
    for name in ("index", "weight", "residual", "undecided"):
        np.testing.assert_array_equal(getattr(again.blend, name), getattr(whole.blend, name))


def test_it_is_said_in_terminal_report_and_record(stage: Stage, tmp_path: Path) -> None:
    file = stage.folder / "transforms.json"
    whole = file.read_text(encoding="utf-8")
    document = json.loads(whole)
    document["frames"][BAD]["exposure"] = 0.5
    file.write_text(json.dumps(document), encoding="utf-8")
    by_hand = replace(QUICK, frames=FrameOptions("off"))
    try:
        with pytest.warns(CaptureWarning, match=r"0003\.exr .* it was left out"):
            without = recover(stage.folder, tmp_path / "without", by_hand, views=5, viewer=False)
        with pytest.warns(CaptureWarning, match=r"0003\.exr is [12]\.\d+ times .* it was scaled to them"):
            reconstruct_folder(stage.folder, tmp_path / "out", QUICK, viewer=False)
    finally:
        file.write_text(whole, encoding="utf-8")
    report = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "The photographs against each other" in report and "its exposure, scaled by" in report
    record = json.loads((tmp_path / "out" / "svbrdf.json").read_text(encoding="utf-8"))["solver"]
    of = record["photographs"]["frames"][BAD]
    assert (of["kind"], of["done"]) == ("exposure", "scaled")
    # The page of the viewer takes both from there.
    material = read_material(tmp_path / "out")
    assert verdicts_of(material)["images/0003.exr"] == (of["scale"], False)
    assert verdicts_of(without.material)["images/0003.exr"] == (1.0, True)
    assert verdicts_of(replace(material, solver={})) == {}
    # Of five frames, pages show the first, third (were it not left out) and fourth.
    assert [view.name for view in without.report.views] == [f"images/000{number}.exr" for number in (1, 2, 5)]
    summary = without.summary
    assert (summary.views, summary.views_left_out) == (4, 1)
    assert [suspect["name"] for suspect in summary.as_dict()["suspects"]] == ["images/0003.exr"]
    assert "4 photographs, 1 more left out" in summary.in_words()
    assert "1 more left out" in (tmp_path / "without" / "report.html").read_text(encoding="utf-8")


def test_faults_are_what_they_say(stage: Stage) -> None:
    capture = stage.capture
    before, camera = read_photograph(capture.frames[1]), capture.frames[1].camera
    after = read_photograph(slip_exposure(capture, 1, 2.0).frames[1])
    np.testing.assert_allclose(after.radiance, 2 * before.radiance, rtol=1e-6)
    about_object = turn_pose(capture, 1, 5.0, "object").frames[1].camera
    a, b = camera.position, about_object.position
    cosine = a @ b / (np.linalg.norm(a) * np.linalg.norm(b))
    assert np.degrees(np.arccos(cosine)) == pytest.approx(5, abs=1e-6)
    # The object's centre stays where it was in the picture.
    np.testing.assert_allclose(about_object.project(np.zeros((1, 3)))[0], [[48, 48]], atol=1e-9)
    about_camera = turn_pose(capture, 1, 5.0, "camera").frames[1].camera
    np.testing.assert_allclose(about_camera.position, a, atol=1e-12)
    shift = np.linalg.norm(about_camera.project(np.zeros((1, 3)))[0] - 48)
    assert shift == pytest.approx(camera.fx * np.tan(np.radians(5)), rel=1e-6)
    turned = turn_light(capture, 1, 15.0).frames[1].environment
    given = capture.frames[1].environment
    assert turned is not None and given is not None
    trace = np.trace(turned.world_from_environment @ given.world_from_environment.T)
    assert np.degrees(np.arccos((trace - 1) / 2)) == pytest.approx(15)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert turn_light(capture, 1, 15.0).frames[0] is capture.frames[0]
