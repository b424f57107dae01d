"""A truth cannot be changed after its hash was published, nor guessed from it."""

import pytest

from benchmarks.hidden_effects.making.seal import is_sealed, salt_of, seal


def truth(**more):
    return {
        "name": "case_0001",
        "effects": {"shaking": 0.2},
        "salt": salt_of(7, "case_0001"),
        **more,
    }


def test_the_same_truth_has_the_same_seal():
    assert seal(truth()) == seal(dict(reversed(list(truth().items()))))
    assert is_sealed(truth(), seal(truth()))


def test_another_amplitude_breaks_the_seal():
    assert not is_sealed(truth(effects={"shaking": 0.2000001}), seal(truth()))


def test_the_salt_hides_the_truth():
    assert seal(truth()) != seal(truth(salt=salt_of(8, "case_0001")))
    assert salt_of(7, "case_0001") != salt_of(7, "case_0002")


def test_a_truth_without_salt_is_refused():
    with pytest.raises(ValueError, match="salt"):
        seal({"name": "case_0001"})
    assert not is_sealed({"name": "case_0001"}, "0" * 64)
