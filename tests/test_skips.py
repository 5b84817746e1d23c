"""Property tests of skips by name: on unless a block switches them off, counted where a block asks for it."""

import re
from pathlib import Path
from threading import Thread

import pytest

from refgi.errors import InputError
from refgi.skips import SKIPS, Count, count_skips, left_out, without_skip


def uncounted():
    raise AssertionError("counted though nobody asked")


def test_the_page_lists_every_skip_with_its_meaning():
    page = (Path(__file__).parents[1] / "docs" / "skips.md").read_text("utf-8")
    listed = re.findall(r"^\| `([a-z_]+\.[a-z_]+)` \| (.*) \|$", page, re.MULTILINE)
    assert listed[: len(SKIPS)] == [(name, skip.meaning) for name, skip in SKIPS.items()]


def test_all_skips_are_on_and_count_nothing():
    assert SKIPS
    assert all(left_out(name, uncounted) for name in SKIPS)


def test_blocks_switch_off_what_they_name_and_nest():
    one, two, three = list(SKIPS)[:3]

    def on():
        return [left_out(name, uncounted) for name in (one, two, three)]

    with without_skip(one):
        assert on() == [False, True, True]
        with without_skip(two, three):
            assert on() == [False, False, False]
        assert on() == [False, True, True]
    assert on() == [True, True, True]
    with pytest.raises(ZeroDivisionError), without_skip(one):
        1 / 0  # noqa: B018
    assert on() == [True, True, True]


def test_another_thread_keeps_its_skips():
    name, seen = next(iter(SKIPS)), []
    with without_skip(name):
        thread = Thread(target=lambda: seen.append(left_out(name, uncounted)))
        thread.start()
        thread.join()
    assert seen == [True]


def test_a_name_that_there_is_not_is_refused():
    with pytest.raises(InputError, match=r"skip: expected one of frame\.buffers, .*, got 'frame\.bufers'"), \
            without_skip("frame.bufers"):
        pass


def test_counts_add_up_whether_a_skip_is_on_or_off():
    one, two = list(SKIPS)[:2]
    with count_skips() as outer:
        assert left_out(one, lambda: (2, 5))
        with count_skips() as inner, without_skip(one):
            assert not left_out(one, lambda: (7, 7))
        assert left_out(one, lambda: (1, 4))
    assert (outer, inner) == ({one: Count(3, 9)}, {one: Count(7, 7)})
    assert two not in outer
    assert left_out(one, uncounted)
