"""Problems of files: in the program's own words, whatever pydantic calls them, and all of them at once."""

import pytest
from pydantic import BaseModel, Field, ValidationError
from pydantic_core import InitErrorDetails
from support.phrases import ERRORS, library_phrase, library_phrases

from framearray_cli.base.forms.problems import problems_of
from framearray_cli.base.forms.table import Table, check_with, fail
from framearray_cli.job.job import Job
from framearray_cli.tools.movie.pathfile import MoviePath, Segment

# Values that the schema does not describe, or describes in several ways.
PLACES = [
    (Job, ("camera", "fov")),
    (Job, ("camera", "keys")),
    (Job, ("light", "sources", 0)),
    (Job, ("scene", "materials")),
    (Job, ("output", "format")),
    (Job, ("nothing", "like", "it")),
    (Job, ()),
    (MoviePath, ("segments",)),
    (MoviePath, ("segments", 0, "camera")),
    (MoviePath, ("segments", 0, "axes")),
    (MoviePath, ("groups", "sun", "color")),
]
SOURCE = (Job, ("light", "sources", 0))
# Where pydantic makes errors of some types only.
ONLY = {
    "extra_forbidden": ([(model, place) for model, place in PLACES if place], ("x", 3)),
    "too_short": (PLACES, ([], ["x"])),
    "union_tag_invalid": ([SOURCE], ({"type": "x"}, {"type": 3})),
    "union_tag_not_found": ([SOURCE], ({}, "x", 3)),
}


def test_phrases_are_those_of_pydantic():
    assert {"Input should be", "Value error,", "Field required"} <= set(library_phrases())
    with pytest.raises(ValidationError) as caught:
        Segment.model_validate({"frames": "many"})
    assert library_phrase(str(caught.value)) is not None


@pytest.mark.parametrize("kind", sorted(ERRORS))
def test_no_error_of_pydantic_keeps_its_words(kind):
    """Every type of error, at places of all kinds."""
    context = dict(ERRORS[kind].get("example_context") or {})
    places, values = ONLY.get(kind, (PLACES, ({"frames": "many"}, ["x"], "x", 3)))
    for model, place in places:
        for value in values:
            detail = InitErrorDetails(type=kind, loc=place, input=value, ctx=context)
            try:
                error = ValidationError.from_exception_data("job", [detail])
            except TypeError:  # pydantic makes this kind of error in another way
                pytest.skip("cannot be made here")
            for problem in problems_of(error, model):
                assert library_phrase(problem) is None, problem


class Length(Table):
    whole: int = Field(default=1, gt=0, le=9)
    share: float = Field(default=1.0, gt=0, le=40_000)


@pytest.mark.parametrize(
    ("key", "value", "problem"),
    [
        ("whole", 10, "whole: expected a whole number above 0 and at most 9, got 10"),
        ("share", 360_000.0, "share: expected a number above 0 and at most 40000, got 360000.0"),
        ("share", 0.0, "share: expected a number above 0 and at most 40000, got 0.0"),
    ],
)
def test_both_bounds_are_named(key, value, problem):
    with pytest.raises(ValidationError) as caught:
        Length.model_validate({key: value})
    assert problems_of(caught.value, Length) == [problem]


def test_problems_between_keys_come_with_those_of_keys():
    with pytest.raises(ValidationError) as caught:
        Segment.model_validate(
            {"frames": 0, "seconds": 1.0, "ease": "x", "camera": [0, {}], "more": 1, "axes": {"light": 0}}
        )
    assert sorted(problem.partition(": ")[0] for problem in problems_of(caught.value, Segment)) == [
        "axes.light",
        "camera[1]",
        "ease",
        "expected either frames or seconds, got both",
        "frames",
        "more",
    ]


def test_a_check_that_passes_returns_the_value():
    assert check_with([], 3, lambda value: value) == 3
    with pytest.raises(ValidationError):
        check_with([((), "wrong")], 3, lambda value: value)


def test_an_error_of_ours_keeps_its_words():
    class Odd(BaseModel):
        pass

    with pytest.raises(ValidationError) as caught:
        fail([(("a", 0), "expected a {thing}, got none")])
    assert problems_of(caught.value, Odd) == ["a[0]: expected a {thing}, got none"]
