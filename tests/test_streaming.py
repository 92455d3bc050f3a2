# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The subset that the solver runs on, its growth, and the memory it may take."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from swatchwork.arrays import I64
from swatchwork.capture import read_capture
from swatchwork.errors import InputError
from swatchwork.light import Environment
from swatchwork.observe import Lights, Rendering, rendering
from swatchwork.reconstruct import ReconstructOptions, reconstruct
from swatchwork.reflectance import basis_by_name
from swatchwork.simulate import simulate_capture
from swatchwork.solve import Problem, SolveOptions, resume, solve
from swatchwork.streaming import Budget, blend_every_texel, neighbours, subset
from swatchwork.surface import SkyMasks


@pytest.fixture(scope="module")
def capture(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("streaming")
    simulate_capture(folder, object_shape="blob", rows=32, k=4, test_views=1, size=72, materials=2, seed=3)
    return folder


def mixed(texels: int, odd: I64, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, I64]:
    """Responses, radiance and offsets of texels that show one material, or another where ``odd``."""
    views, kernels = 4, 6
    responses = rng.random((texels * views, kernels, 3)).astype(np.float32)
    one, two = np.array([1, 0, 0.5, 0, 0, 0.1]), np.array([0, 3.0, 0, 0.2, 1, 0])
    material = np.where(np.isin(np.arange(texels), odd)[:, None], two, one)
    radiance = np.einsum("pjc,pj->pc", responses, np.repeat(material, views, axis=0)).astype(np.float32)
    return responses, radiance, np.arange(texels + 1) * views


def test_shares_are_as_good_as_repeats() -> None:
    rng = np.random.default_rng(1)
    responses, radiance, offsets = mixed(40, np.arange(35, 40), rng)
    radiance *= rng.uniform(0.9, 1.1, radiance.shape).astype(np.float32)
    share = np.where(np.arange(40) < 20, 1.0, 0.5)
    # Every texel of share 1 twice, the others once.
    twice = np.concatenate([np.repeat(np.arange(20), 2), np.arange(20, 40)])
    pairs = (offsets[twice][:, None] + np.arange(4)).ravel()
    shared = Problem(responses, radiance, offsets, share)
    repeated = Problem(responses[pairs], radiance[pairs], np.arange(61) * 4)
    weights = rng.dirichlet([1, 1], 40)
    a, b = shared.representatives(weights), repeated.representatives(weights[twice])
    # Two orders of summation.
    np.testing.assert_allclose(a.representatives, b.representatives, atol=1e-9)
    error = rng.random(40)
    assert shared.mean(error) == pytest.approx(repeated.mean(error[twice]), rel=1e-12)
    np.testing.assert_allclose(shared.relative(error)[twice], repeated.relative(error[twice]), rtol=1e-12)


def test_a_solution_goes_on_where_another_material_shows() -> None:
    rng = np.random.default_rng(2)
    responses, radiance, offsets = mixed(300, np.arange(280, 300), rng)
    known = offsets[:201]
    options = SolveOptions(n=1)
    first = solve(Problem(responses[: known[-1]], radiance[: known[-1]], known), options)
    assert first.N == 1
    more = resume(Problem(responses, radiance, offsets), first, options)
    assert (more.n, more.N) == (1, 2) and more.data < 1e-6 * max(first.data, 1e-3)
    assert more.history[: len(first.history)] == first.history


def test_a_detail_that_the_subset_missed_joins_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A spot of a red material on less than a hundredth of the surface.

    With one representative a texel, rims and creases of the mesh ask for some of their own: the search may
    have as many as it asks for before the spot is seen.
    """
    from swatchwork.observe import observations

    simulate_capture(tmp_path, rows=24, k=4, test_views=1, size=144, materials=2, blended=1, sharp=True)
    middle, sampled = np.array([1.0, 0.0, 0.0]), observations._sampled

    def spotted(*args: Any) -> dict[str, np.ndarray]:
        found = sampled(*args)
        near = np.linalg.norm(args[2].position(found["texel"]) - middle, axis=1) < 0.2
        found["radiance"][near] *= np.float32([6, 0.1, 0.1])
        return found

    monkeypatch.setattr(observations, "_sampled", spotted)
    capture, options = (
        read_capture(tmp_path),
        ReconstructOptions(64, texels=100, solve=SolveOptions(n=1, max_N=12)),
    )
    found = reconstruct(capture, options)
    monkeypatch.setattr(subset, "ROUNDS", 0)
    blind = reconstruct(capture, options)
    assert found.solution.N > blind.solution.N and len(found.solution.weights) > len(blind.solution.weights)
    spot = np.linalg.norm(found.observations.atlas.position(slice(None)) - middle, axis=1) < 0.16
    spot &= found.observations.coverage > 0
    assert 10 < spot.sum() < 0.01 * len(spot)
    # Its texels are hardly a pixel wide, so that its rim is blurred on every photograph.
    pixel = found.observations.atlas.pixel[spot]
    assert np.mean(found.blend.residual.flat[pixel]) < 0.9 * np.mean(blind.blend.residual.flat[pixel])


def test_tiles_of_any_size_give_the_same_blend(capture: Path) -> None:
    options = ReconstructOptions(48, texels=100, solve=SolveOptions(n=2, N=2))
    found = reconstruct(read_capture(capture), options)

    class Small(Budget):
        def tile(self, representatives: int) -> int:
            return 300

    again = blend_every_texel(found.rendering, found.basis, found.solution, budget=Small())
    for name in ("index", "weight", "residual"):
        np.testing.assert_array_equal(getattr(again, name), getattr(found.blend, name))


def test_tiles_are_cut_at_even_counts_of_pairs(capture: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found = reconstruct(
        read_capture(capture), ReconstructOptions(48, texels=60, solve=SolveOptions(n=1, N=1))
    )
    seen, counts = found.observations.seen, found.observations.coverage
    for pairs in (1, 2, 50, 333, 1 << 30):
        total = np.cumsum(counts[seen], dtype=np.int64)
        cuts = np.searchsorted(total, np.arange(pairs, total[-1], pairs), side="right")
        plain = [part for part in np.split(seen, np.unique(cuts)) if len(part)]
        for counted in (1, 7, 1 << 18):
            monkeypatch.setattr(rendering, "COUNTED", counted)
            tiles = list(found.rendering.tiles(seen, pairs))
            assert len(tiles) == len(plain)
            for tile, expected in zip(tiles, plain, strict=True):
                np.testing.assert_array_equal(tile, expected)


def test_unseen_texels_take_the_blend_of_a_near_seen_one(
    capture: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where the seen ones are thinned, as those of a large atlas are."""
    read = read_capture(capture).first(1)
    found = reconstruct(read, ReconstructOptions(48, texels=60, solve=SolveOptions(n=1, N=2)))
    atlas, seen = found.observations.atlas, found.observations.seen
    unseen = np.flatnonzero(found.observations.coverage == 0)
    assert len(unseen) > 100
    apart = np.linalg.norm(atlas.position(unseen)[:, None] - atlas.position(seen)[None], axis=2)
    index = found.blend.index.reshape(-1, 1)[atlas.pixel]
    np.testing.assert_array_equal(index[unseen], index[seen[apart.argmin(axis=1)]])
    monkeypatch.setattr(neighbours, "MANY", len(seen) // 4)
    thinned = neighbours.nearest(atlas, seen, unseen)
    nearest = np.linalg.norm(atlas.position(unseen) - atlas.position(thinned), axis=1)
    # Every fourth texel along a row is taken, so that the nearest of those is up to a few texels further.
    texel = np.sqrt(np.median(atlas.footprint(slice(None))))
    assert np.quantile(nearest - apart.min(axis=1), 0.95) < 4 * texel
    # Where few of the unseen are looked for, the others take what their neighbours found.
    monkeypatch.setattr(neighbours, "MANY", 1 << 18)
    monkeypatch.setattr(neighbours, "SOME", len(unseen) // 9)
    from_neighbours = neighbours.nearest(atlas, seen, unseen)
    nearest = np.linalg.norm(atlas.position(unseen) - atlas.position(from_neighbours), axis=1)
    least = apart.min(axis=1)
    close = least < 2 * 3 * texel
    np.testing.assert_allclose(nearest[close], least[close], rtol=1e-12)
    # A neighbour is three texels away, and its nearest at most twice that further than one's own.
    assert (
        np.quantile(nearest - least, 0.99) < 6 * texel
        and (from_neighbours != seen[apart.argmin(axis=1)]).any()
    )


def test_light_that_turns_is_the_surface_turned(capture: Path) -> None:
    """Frames that turn one light give what as many lights, each turned and prepared by itself, would."""
    found = reconstruct(
        read_capture(capture), ReconstructOptions(48, texels=60, solve=SolveOptions(n=1, N=1))
    )
    light: Environment = found.rendering.lights.of(0)
    angle = np.radians([0, 37.0, 90, 200])
    turn = np.stack(
        [[[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]] for a in angle]
    )  # about z
    frames = np.arange(4, dtype=np.int32)
    one = Lights((light,), np.zeros(4, np.int32), turn)
    each = Lights(tuple(light.rotated(r) for r in turn), frames, np.broadcast_to(np.eye(3), (4, 3, 3)).copy())
    basis = basis_by_name("extended")
    sky = found.rendering.sky
    assert len(sky.words), "some of it must be shadowed"
    responses = []
    for lights in (one, each):
        rendering = Rendering(found.observations, lights, sky)
        pairs = rendering.pairs(found.observations.seen)
        responses.append(rendering.generic(basis, pairs))
    # Where nothing is shadowed, nothing is turned.
    convex = SkyMasks(sky.words[:0], np.full_like(sky.of_texel, -1))
    assert Rendering(found.observations, one, convex).generic(basis, pairs).shape == responses[0].shape
    clear = sky.of_texel[pairs.seen.texel] < 0

    def off(rows: np.ndarray) -> float:
        a, b = (r[rows] for r in responses)
        return float(np.sqrt(((a - b) ** 2).sum() / (b**2).sum()))

    # The light is filtered on another grid; masks besides turn to the nearest of 64 x 64 cells.
    assert off(clear) < 0.02 and off(~clear) < 0.05
    np.testing.assert_allclose(one.of(2).radiance, light.radiance)


def test_what_memory_allows() -> None:
    assert Budget(4.0).tile(18) >= Budget(1.0).tile(18) > 4096
    assert Budget(4.0).subset(77) > 3 * Budget(1.0).subset(77)
    with pytest.raises(InputError, match=r"memory = 0\.3 GB; expected more than"):
        Budget(0.3)


def test_a_subset_beyond_the_memory_is_refused(capture: Path) -> None:
    options = ReconstructOptions(64, texels=2000, memory=0.601)
    with pytest.raises(InputError, match=r"texels, \d+ measured .* pairs, for the search; expected at most"):
        reconstruct(read_capture(capture), options)
