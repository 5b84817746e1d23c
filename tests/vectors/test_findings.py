"""Findings over all cases: kinds of stages in order, causes that explain most of them first."""

from refgi.vectors.causes import SEEN
from refgi.vectors.manifest import BugEntry, Cause, Piece, StageVerdict
from refgi.vectors.report import findings as found_in
from refgi.vectors.spec import kind_of


def verdict(case, stage, *causes, verdict="out", upstream="isolated"):
    told = tuple(Cause(cause=name, share=share) for name, share in causes)
    return StageVerdict(case=case, stage=stage, verdict=verdict, upstream=upstream, arrays=(), causes=told)


def findings(verdicts, tried=lambda _: set(), *, wired=False, differing=50):
    arrays = {"pairs.sum": Piece(start=0, count=1, differing=differing)}
    return found_in(verdicts, lambda one: {cause: BugEntry(
        cause=cause, shapes={}, arrays=arrays, wired=wired) for cause in tried(one)})


def test_maps_levels_and_rounds_are_one_kind():
    names = ("rsm.reflected_flux0", "rsm.reflected_flux12", "cluster.kmeans_assign3", "pairs.sum")
    assert [kind_of(name) for name in names] == [
        "rsm.reflected_flux", "rsm.reflected_flux", "cluster.kmeans_assign", "pairs.sum"]


def test_a_cause_that_fits_every_case_leads_one_that_fits_better_once():
    found = findings([
        verdict("a", "pairs.sum", verdict="within"),
        verdict("a", "rsm.reflected_flux0", ("chance", 1.0), ("bug", 0.92)),
        verdict("a", "rsm.reflected_flux1", ("bug", 0.95), ("other chance", 0.99)),
        verdict("b", "rsm.reflected_flux0", ("bug", 0.91)),
        verdict("b", "rsm.reflected_flux1", verdict="not-run"),
        verdict("b", "pairs.sum", ("of the sum", 1.0)),
    ])
    assert [(one.stage, one.first, one.wrong, one.ran) for one in found] == [
        ("rsm.reflected_flux", ("a", "rsm.reflected_flux0"), 3, 3), ("pairs.sum", ("b", "pairs.sum"), 1, 2)]
    assert [cause.cause for cause in found[0].causes] == ["bug", "chance", "other chance"]
    assert [(cause.explained, cause.tried) for cause in found[0].causes] == [(3, 3), (1, 3), (1, 3)]


def test_a_bug_counts_where_a_case_knows_it():
    """One that explains two of the two cases that know it leads a remark that fits three of five."""
    wrong = [verdict(case, "pairs.sum", *causes) for case, causes in (
        ("a", [("bug", 1.0), ("remark", 1.0)]), ("b", [("bug", 0.95), ("remark", 1.0)]), ("c", [("remark", 1.0)]),
        ("d", []), ("e", []))]
    found = findings(wrong, lambda one: {"bug"} if one.case in "ab" else set())
    assert [(one.cause, one.explained, one.tried) for one in found[0].causes] == [("bug", 2, 2), ("remark", 3, 5)]
    once = findings(wrong, lambda _: {"bug"})
    assert [one.cause for one in once[0].causes] == ["remark", "bug"]


def test_a_bug_that_a_case_refutes_stands_behind_one_that_none_does():
    """Two of the three cases that could tell it, against the one of one."""
    wrong = [verdict(case, "pairs.sum", *[("refuted", 1.0)] * (case in "ab"), *[("bug", 1.0)] * (case == "a"))
             for case in "abc"]
    found = findings(wrong, lambda one: {"refuted", "bug"} if one.case == "a" else {"refuted"})
    assert [(one.cause, one.explained, one.tried) for one in found[0].causes] == [("bug", 1, 1), ("refuted", 2, 3)]


def test_a_wiring_that_half_of_the_cases_refute_is_not_told():
    """A port binds one buffer, whatever the case; a bug in one of several branches shows where that is taken."""
    wrong = [verdict(case, "pairs.sum", *[("bound", 1.0)] * (case in "ab")) for case in "abcd"]
    told = [findings(wrong, lambda _: {"bound"}, wired=wired)[0].causes[0] for wired in (False, True)]
    assert [(one.cause, one.explained) for one in told] == [("bound", 2), ("no known cause fits", 0)]


def test_a_wiring_that_fits_a_handful_of_elements_stands_behind_other_causes():
    wrong = [verdict("a", "pairs.sum", ("bound", 1.0), ("bug", 0.95)), verdict("b", "pairs.sum")]
    for differing, first in ((50, "bound"), (6, "bug")):
        causes = findings(wrong, lambda one: {"bound"} if one.case == "a" else set(), wired=True,
                          differing=differing)[0].causes
        assert (causes[0].cause, len(causes)) == (first, 2)


def test_no_more_are_explained_than_were_tried():
    """One that a case does not know as a likely bug, and that holds for any array as well."""
    found = findings([verdict(case, "pairs.sum", ("upside down", 1.0)) for case in "abc"],
                     lambda one: {"upside down"} if one.case == "a" else set())
    assert [(one.explained, one.tried) for one in found[0].causes] == [(3, 3)]


def test_what_is_seen_without_a_hypothesis_stands_behind_a_bug_that_fits():
    wrong = [verdict(case, "pairs.sum", ("all elements are 0", SEEN), *[("bug", 1.0)] * (case in "abc"))
             for case in "abcde"]
    found = findings(wrong, lambda one: {"bug"} if one.case in "abc" else set())
    assert [one.cause for one in found[0].causes] == ["bug", "all elements are 0"]


def test_what_is_made_from_wrong_inputs_is_not_blamed():
    assert findings([verdict("a", "pairs.sum", upstream="dirty"),
                     verdict("a", "rsm.reflected_flux0", verdict="exact")]) == ()


def test_where_no_cause_explains_the_places_of_the_first_are_told():
    remark = ("no known cause fits: all lie at row 0", 0.0)
    found = findings([verdict("a", "pairs.sum", remark), verdict("b", "pairs.sum", ("no known cause fits", 0.0))])
    assert [cause.cause for cause in found[0].causes] == [remark[0]]
    found = findings([verdict("a", "pairs.sum", remark), verdict("b", "pairs.sum", ("bug", 1.0))])
    assert [(cause.cause, cause.explained, cause.tried) for cause in found[0].causes] == [("bug", 1, 2)]


def test_at_most_three_causes_are_told():
    assert len(findings([verdict("a", "pairs.sum", *((str(k), 1.0) for k in range(9)))])[0].causes) == 3
