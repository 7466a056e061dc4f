"""Sums over chunks do not depend on how the work was divided: neither the tree of sums nor the studies that use it."""

import itertools
from pathlib import Path
from typing import NamedTuple

import numba
import numpy as np
import pytest
from helpers import COMPILED
from states import chunks_of, finished, numbers, resumed, same_numbers, snapshots

from spi.ensemble import loop
from spi.kinds import KINDS
from spi.kinds.plans import State
from spi.numerics.rng import LANES
from spi.running.run import load
from spi.statistics.tallies import CHUNK_WORK, Chunk, PathSet, Tally, chunk_blocks, digest
from spi.storage.stored import gathered
from spi.storage.sums import SUMS_VERSION

COUNTS = range(1, 41)
SIZE = 2  #: blocks of a whole chunk


class Sums(NamedTuple):
    """Sums of numbers of very different size, which depend on the order of addition, and their places in order."""

    paths: int
    seconds: float
    cpu_seconds: float
    sum: np.ndarray
    largest: float
    places: tuple

    def plus(self, later):
        return Sums(
            self.paths + later.paths,
            self.seconds + later.seconds,
            self.cpu_seconds + later.cpu_seconds,
            self.sum + later.sum,
            max(self.largest, later.largest),
            self.places + later.places,
        )


def values_of_block(block):
    generator = np.random.default_rng([7, block])
    return generator.standard_normal(3) * 10.0 ** generator.integers(-8, 8, 3)


def computed(chunk, blocks=None, known=None):
    """The sums of a chunk, or of its first so many blocks, block after block, from what is known on."""
    blocks = chunk.blocks if blocks is None else blocks
    done = 0 if known is None else known.paths // LANES
    total = np.zeros(3) if known is None else known.sum
    for block in range(chunk.first + done, chunk.first + blocks):
        total = total + values_of_block(block)
    paths = min(blocks * LANES, chunk.paths)
    return Sums(paths, 0.5, 0.25, total, float(np.abs(total).max()), (chunk.index,))


def path_set_of(count, short):
    """A path_set with so many chunks, the last of them short or not."""
    return PathSet(count * SIZE * LANES - (LANES + 7 if short else 0), SIZE)


def put(tally, path_set, chunk, sums):
    done = sums.paths == chunk.paths
    return tally.with_chunk(chunk, sums, done and chunk.index < path_set.whole)


def tally_of(path_set, order=None, tally=None):
    """A tally into which the chunks are put in some order; only those that are given."""
    tally, chunks = tally or Tally.empty(), path_set.chunks(0)
    for i in range(len(chunks)) if order is None else order:
        tally = put(tally, path_set, chunks[i], computed(chunks[i]))
    return tally


def bits(sums):
    return sums.paths, sums.sum.tobytes(), sums.largest, sums.places


def by_hand(found):
    """The sums of neighbouring chunks in pairs, those of pairs in pairs and so on; what is left over comes last."""
    roots, first = [], 0
    while first < len(found):
        size = 1
        while 2 * size <= len(found) - first:
            size *= 2
        level = found[first : first + size]
        while len(level) > 1:
            level = [a + b for a, b in zip(level[::2], level[1::2], strict=True)]
        roots += level
        first += size
    total = roots[0]
    for root in roots[1:]:
        total = total + root
    return total


# --- path sets -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("samples", [1, 63, 64, 65, 127, 128, 129, 1000, 1024])
@pytest.mark.parametrize("size", [1, 2, 8])
def test_the_chunks_of_a_path_set_have_all_its_paths(samples, size):
    path_set = PathSet(samples, size)
    chunks = path_set.chunks(3)
    assert [chunk.index for chunk in chunks] == list(range(len(chunks))) and {chunk.path_set for chunk in chunks} == {3}
    assert chunks[0].first == 0 and chunks[-1].end == samples
    assert all(a.end == b.first * LANES for a, b in itertools.pairwise(chunks))
    assert sum(chunk.paths for chunk in chunks) == samples
    assert sum(chunk.blocks for chunk in chunks) == -(-samples // LANES)
    assert all(chunk.blocks == size for chunk in chunks[:-1]) and 1 <= chunks[-1].blocks <= size
    assert path_set.whole == sum(chunk.paths == size * LANES for chunk in chunks)


@pytest.mark.parametrize("dimension", [1, 3, 8, 24, 16128])
@pytest.mark.parametrize("steps", [0, 1, 7, 2**10, 10**6, 2**40])
def test_the_size_of_a_chunk_is_the_largest_power_of_two_within_the_work_of_a_chunk(steps, dimension):
    blocks, work = chunk_blocks(steps, dimension), LANES * max(steps, 1) * dimension**2
    assert blocks & (blocks - 1) == 0
    assert blocks == 1 or blocks * work <= CHUNK_WORK
    assert 2 * blocks * work > CHUNK_WORK


def test_the_size_of_a_chunk_is_part_of_the_layout_of_sums():
    """Another rule needs another version in ``storage/sums.py``, or sums would be put together that do not fit."""
    sizes = [chunk_blocks(steps, d) for steps, d in ((1, 3), (512, 3), (2**16, 3), (2**10, 8), (2**10, 24))]
    assert (SUMS_VERSION, sizes) == (8, [2**22, 2**13, 2**6, 2**10, 2**6])


# --- the tree of sums ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("short", [False, True])
def test_the_total_is_that_of_a_fixed_tree_in_whatever_order_chunks_come(short):
    differ = 0
    for count in COUNTS:
        path_set = path_set_of(count, short)
        chunks = [computed(chunk).sum for chunk in path_set.chunks(0)]
        wanted = tally_of(path_set).total(path_set)
        # the short chunk comes after all whole ones
        expected = by_hand(chunks[: path_set.whole]) if path_set.whole else chunks[-1]
        if short and path_set.whole:
            expected = expected + chunks[-1]
        assert wanted.sum.tobytes() == expected.tobytes()
        assert wanted.paths == path_set.samples and wanted.places == tuple(range(count))
        for key in range(4):
            order = np.random.default_rng([key, count]).permutation(count)
            tally = tally_of(path_set, order)
            assert bits(tally.total(path_set)) == bits(wanted)
            assert bits(tally.so_far()) == bits(wanted)
            assert tally.seconds == pytest.approx(0.5 * count, rel=1e-14)
            # Negative control: one after the other in this order gives other bits.
            in_turn = chunks[order[0]]
            for i in order[1:]:
                in_turn = in_turn + chunks[i]
            differ += in_turn.tobytes() != wanted.sum.tobytes()
    assert differ > 0.8 * 4 * len(COUNTS)


@pytest.mark.parametrize("short", [False, True])
def test_tallies_of_parts_are_merged_in_any_order(short):
    for count in COUNTS:
        path_set = path_set_of(count, short)
        wanted = bits(tally_of(path_set).total(path_set))
        for key, parts in enumerate((1, 2, 3, 7)):
            generator = np.random.default_rng([key, count])
            # neighbours, as shards have them; or whatever comes
            owner = np.arange(count) * parts // count if key % 2 else generator.integers(0, parts, count)
            tallies = [tally_of(path_set, np.flatnonzero(owner == part)) for part in range(parts)]
            merged = Tally.empty()
            for part in generator.permutation(parts):
                merged = merged.merged(tallies[part])
            assert bits(merged.total(path_set)) == wanted
            assert set(merged.nodes) == set(tally_of(path_set).nodes)
            # once more, or with what is known of the same chunks in larger or smaller subtrees, changes nothing
            for again in (*tallies, merged):
                assert bits(merged.merged(again).total(path_set)) == wanted
                assert bits(again.merged(merged).total(path_set)) == wanted


def test_tallies_that_know_the_same_chunks_are_merged():
    """Parts that overlap, where one knows the sum of chunks that the other knows one by one."""
    path_set = path_set_of(13, True)
    wanted = bits(tally_of(path_set).total(path_set))
    generator = np.random.default_rng(5)
    for _ in range(100):
        known = [np.flatnonzero(generator.random(13) < share) for share in (0.7, 0.5)]
        missing = np.setdiff1d(np.arange(13), np.concatenate(known))
        a, b = (tally_of(path_set, generator.permutation(part)) for part in known)
        merged = a.merged(b)
        assert [chunk.index for chunk in path_set.chunks(0) if not merged.has(chunk)] == missing.tolist()
        assert merged.so_far().paths == sum(path_set.chunks(0)[i].paths for i in np.union1d(*known))
        assert bits(tally_of(path_set, missing, merged).total(path_set)) == wanted


def test_only_the_roots_are_kept():
    for count in (*COUNTS, 255, 256, 1000):
        path_set = path_set_of(count, False)
        tally = tally_of(path_set)
        assert len(tally.nodes) == count.bit_count() <= np.log2(count) + 1 and not tally.short
        found = tally.total(path_set)
        assert found.paths == path_set.samples and found.places == tuple(range(count))
    # on the way there are more if chunks come in another order, but never more than chunks
    assert len(tally_of(path_set, range(0, 1000, 2)).nodes) == 500


@pytest.mark.parametrize("few", [1, LANES - 1, LANES, LANES + 1, 2 * LANES, 3 * LANES, 1000, 1024, 4000])
@pytest.mark.parametrize("more", [64, 129, 1024, 1025, 3000, 4096, 5000])
def test_a_path_set_with_more_paths_goes_on_from_one_with_fewer(few, more):
    """Whole chunks are kept; and of the last one what is known if that ends with a block."""
    before, after = PathSet(few, SIZE), PathSet(more, SIZE)
    tally = tally_of(before).within(after)
    wanted = bits(tally_of(after).total(after))
    missing = [chunk for chunk in after.chunks(0) if not tally.has(chunk)]
    if more >= few:
        assert len(missing) == len(after.chunks(0)) - before.whole - (few == more and few % (SIZE * LANES) > 0)
    for chunk in missing:
        known = tally.known(chunk)
        if chunk.index == before.whole and few % (SIZE * LANES) and few % LANES == 0 and few < more:
            assert known is not None and known.paths == few - before.whole * SIZE * LANES
        else:
            assert known is None
        tally = put(tally, after, chunk, computed(chunk, known=known))
    assert bits(tally.total(after)) == wanted
    assert bits(tally.so_far()) == wanted  # nothing else is left in it


def test_a_chunk_goes_on_from_its_middle():
    path_set = PathSet(7 * 4 * LANES - 5, 4)
    wanted = bits(tally_of(path_set).total(path_set))
    for middle in (1, 2, 3):
        tally = Tally.empty()
        for chunk in path_set.chunks(0)[::-1]:
            tally = put(tally, path_set, chunk, computed(chunk, middle))
            assert not tally.has(chunk)
            assert tally.known(chunk).paths == middle * LANES
            with pytest.raises(KeyError):
                tally.total(path_set)
        assert tally.so_far().paths == 7 * middle * LANES
        for chunk in path_set.chunks(0):
            tally = put(tally, path_set, chunk, computed(chunk, known=tally.known(chunk)))
            assert tally.has(chunk) and tally.known(chunk) is None
        assert bits(tally.total(path_set)) == wanted


def test_of_two_sums_of_a_chunk_the_one_with_more_paths_is_kept():
    path_set = PathSet(3 * 4 * LANES, 4)
    chunk = path_set.chunks(0)[1]
    one, two, whole = (put(Tally.empty(), path_set, chunk, computed(chunk, blocks)) for blocks in (1, 3, 4))
    assert one.merged(two).known(chunk).paths == two.merged(one).known(chunk).paths == 3 * LANES
    for tally in (one.merged(whole), whole.merged(one)):
        assert tally.has(chunk) and tally.known(chunk) is None and not tally.short


def test_what_is_missing_is_a_key_error():
    for short in (False, True):
        for count in COUNTS:
            path_set = path_set_of(count, short)
            for left_out in {0, count // 2, count - 1}:
                tally = tally_of(path_set, [i for i in range(count) if i != left_out])
                assert [chunk.index for chunk in path_set.chunks(0) if not tally.has(chunk)] == [left_out]
                with pytest.raises(KeyError):
                    tally.total(path_set)
    with pytest.raises(KeyError):
        Tally.empty().total(path_set)
    assert Tally.empty().so_far() is None and Tally.empty().seconds == 0.0


def test_what_belongs_to_unwanted_paths_is_left_out():
    """Also if it begins just where the wanted paths end; and a last chunk of other paths does not pass for this one."""
    many = PathSet(3 * SIZE * LANES + LANES + 7, SIZE)
    known = tally_of(many)
    for chunks, kept in ((3, 3), (2, 2), (1, 0)):  # the sum of the first two chunks is only known together
        few = PathSet(chunks * SIZE * LANES, SIZE)
        tally = known.within(few)
        assert (
            not tally.short and sum(chunk.paths for chunk in few.chunks(0) if tally.has(chunk)) == kept * SIZE * LANES
        )
        assert (tally.so_far().paths if kept else tally.so_far()) == (kept * SIZE * LANES or None)
    other = PathSet(many.samples - 1, SIZE)
    assert not known.within(other).short and not known.has(other.chunks(0)[-1])
    with pytest.raises(KeyError):
        known.total(other)


def test_a_tally_does_not_change_any_more():
    path_set = path_set_of(11, True)
    tallies, kept = [Tally.empty()], []
    for chunk in path_set.chunks(0):
        kept.append((dict(tallies[-1].nodes), dict(tallies[-1].short)))
        tallies.append(put(tallies[-1], path_set, chunk, computed(chunk)))
        tallies[-1].merged(tallies[0])
        tallies[0].merged(tallies[-1])
        tallies[-1].within(PathSet(3 * LANES, SIZE))
    assert [(tally.nodes, tally.short) for tally in tallies[:-1]] == kept


# --- digests ---------------------------------------------------------------------------------------------------------


def test_a_digest_is_that_of_all_numbers_but_times():
    sums = computed(Chunk(0, 3, 6, 8 * LANES))
    told = digest(sums)
    assert len(told) == 32 and told == digest(computed(Chunk(0, 3, 6, 8 * LANES)))
    assert told == digest(sums._replace(seconds=9.0, cpu_seconds=8.0))
    last = sums.sum.copy()
    last[-1] = np.nextafter(last[-1], np.inf)
    others = [
        sums._replace(paths=sums.paths + 1),
        sums._replace(sum=last),
        sums._replace(sum=sums.sum[::-1]),
        sums._replace(sum=sums.sum.reshape(1, 3)),
        sums._replace(sum=sums.sum.astype(np.float32)),
        sums._replace(sum=sums.sum[:2]),
        sums._replace(sum=np.array([0.0, 0.0, 0.0])),
        sums._replace(sum=np.array([0.0, 0.0, -0.0])),
        sums._replace(largest=np.nextafter(sums.largest, 0.0)),
        sums._replace(places=(4,)),
        sums._replace(places=("a",)),
        sums._replace(places=("b",)),
    ]
    assert len({told, *map(digest, others)}) == 1 + len(others)
    turned = sums._replace(sum=np.array([sums.sum, sums.sum]).T[:, 0])  # not contiguous in memory
    assert digest(turned) == told


# --- studies of several chunks ---------------------------------------------------------------------------------------

MODEL = """\
model: {name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3]}
initial: [cos(1.1), 0, sin(1.1)]
schemes: [splitting]
"""
STEPS = "final_time: 1\nsteps: [2^-1, 2^-2]\nreference_step: 2^-3\n"
SAMPLES = 330 if COMPILED else 130
WEAK = "kind: weak\nfunctions: {a: y1, b: y2^2}\n" + STEPS
SPECS = {
    "strong": f"kind: strong\nsamples: {SAMPLES}\n" + STEPS,
    "plain": f"estimators: [plain]\nsamples: {SAMPLES}\nprefixes: [1, 100, {SAMPLES}]\n" + WEAK,
    "multilevel": "estimators: [multilevel]\nseconds: 0.003\n" + WEAK,
    "stability": f"kind: stability\nsamples: {SAMPLES}\n" + STEPS,
    "quasi": "estimators: [quasi]\nsamples: 512\n" + WEAK,
    "growth": f"kind: growth\nsamples: {SAMPLES}\nsteps: [1/8, 1/4]\nstep_count: 384\n",
    "averages": f"kind: equilibrium\nsamples: {SAMPLES}\nsteps: [1/4]\nfinal_time: 96\nfunctions: {{z: y3, H: H}}\n",
    "statistics": f"kind: statistics\nsamples: {SAMPLES}\nfinal_time: 1\nstep: 1/8\nautocorrelation: {{a: 1/2}}\n"
    "functions: {a: y1^2, out: {passage: y1 < 0.4}, b: y3}\nstatistics: [mean, covariance, quantiles, histogram]\n"
    "density: {of: [a, b], cells: 8}\n",
    "lyapunov": f"kind: lyapunov\nsamples: {SAMPLES}\nfinal_time: 1\nstep: 1/8\nevery: 3\n",
}
if not COMPILED:
    for name in ("multilevel", "growth", "averages"):
        del SPECS[name]  # which take too many steps


@pytest.fixture(params=SPECS)
def plan(request, tmp_path):
    """The plan of a study whose chunks have one block each, or one round."""
    model = MODEL + ("sweep: {s: [0.5, 2]}\n" if request.param == "stability" else "")
    if request.param == "stability":
        model = model.replace("[1, 2, 3]", "[1, 2, 3], sigma: [s, s, s]")
    Path(tmp_path / "s.yaml").write_text(model + SPECS[request.param], encoding="utf-8")
    case = load(tmp_path / "s.yaml").cases[0]
    study = KINDS[load(tmp_path / "s.yaml").kind].study
    with chunks_of(1):
        yield study.plan(case, study.parts(case)[0])


def numbers_of_group(plan, state):
    """What a state gives in the end, but times."""
    found = gathered([plan.results(state)])[0].group()
    return {name: values for name, values in found.arrays.items() if not name.endswith(("seconds", "ns_per_step"))}


def test_the_bits_do_not_depend_on_batches(plan):
    whole = finished(plan)
    assert all(len(path_set.chunks(0)) >= 2 for path_set in whole.path_sets)
    assert not whole.missing()
    for most in (1, 2, 3, 1000):
        assert same_numbers(finished(plan, most), whole)


@pytest.mark.skipif(numba.config.NUMBA_NUM_THREADS < 2, reason="one thread only")
@pytest.mark.skipif(not COMPILED, reason="one thread only")
def test_the_bits_do_not_depend_on_threads(plan):
    states = []
    for threads in (1, 2):
        with loop.limited_threads(threads):
            states.append(finished(plan))
    assert same_numbers(*states)


def test_the_bits_do_not_depend_on_interruptions(plan):
    whole, found = finished(plan), snapshots(plan)
    for plain in found[:: max(1, len(found) // 2)]:
        assert same_numbers(resumed(plan, plain, 2), whole)
    assert not same_numbers(found[len(found) // 2], whole)


def test_the_bits_do_not_depend_on_who_computes_which_chunk(plan):
    """Each chunk alone, in any order, into one of two states that are then put together."""
    whole = finished(plan)
    states = [State(plan), State(plan)]
    for state in states:
        state.extra = whole.extra
    chunks = [chunk for number, path_set in enumerate(whole.path_sets) for chunk in path_set.chunks(number)]
    for i in np.random.default_rng(3).permutation(len(chunks)):
        for added in plan.advance([chunks[i]], None):
            for chunk, known in added:
                states[i % 2].put(chunk, known)
    assert all(state.missing() for state in states)
    for number in states[1].tallies:
        states[0].merge(number, states[1].plain(number))
    assert same_numbers(states[0], whole)
    a, b = (numbers_of_group(plan, state) for state in (states[0], whole))
    assert a.keys() == b.keys() and all(np.array_equal(a[name], b[name], equal_nan=True) for name in a)


def test_chunks_change_no_more_than_roundings(plan):
    """What one chunk of all paths gives; it would notice a chunk that is lost, taken twice or put in another place."""
    whole = finished(plan)
    totals = [whole.total(number) for number in range(len(whole.path_sets))]
    with chunks_of(2**20):
        path_sets = plan.path_sets(whole.extra)
    for number, path_set in enumerate(path_sets):
        (chunk,) = path_set.chunks(number)
        *_, ((_, sums),) = plan.advance([chunk], None)
        a, b = numbers(sums), numbers(totals[number])
        assert a.keys() == b.keys()
        for name, values in a.items():
            if values.dtype.kind == "f":
                np.testing.assert_allclose(values, b[name], rtol=1e-11, atol=1e-13 * np.abs(values).max(initial=0.0))
            else:
                assert np.array_equal(values, b[name])
