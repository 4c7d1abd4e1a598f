import gc

import pytest

from stylesim.collecting import no_collection


def failing():
    with no_collection():
        assert not gc.isenabled()
        raise ValueError("x")


def test_the_collector_is_as_it_was_afterwards():
    with pytest.raises(ValueError, match="x"):
        failing()
    assert gc.isenabled()
    gc.disable()
    try:
        with no_collection():
            pass
        assert not gc.isenabled()
    finally:
        gc.enable()
