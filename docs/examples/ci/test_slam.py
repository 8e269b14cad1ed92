import pytest
from my_slam import MySlam


@pytest.mark.mobilia(track="rush-hour", level=0.5, seeds=2)
def test_it_holds_in_a_crowd(mobilia_stream):
    run = mobilia_stream.run(MySlam())
    assert not run.lost
    assert run.error_m < 0.3
