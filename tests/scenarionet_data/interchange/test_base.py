"""The report of losses."""

from scenarionet_data.interchange.base import Loss, Losses


def test_losses_of_one_kind_are_counted_together():
    losses = Losses()
    losses.leave_out("crosswalks", 2)
    losses.leave_out("crosswalks")
    losses.leave_out("lights", 0)
    losses.approximate("lanes", 3, 0.02, "m")
    losses.approximate("lanes", 1, 0.05, "m")
    assert losses.found() == (Loss("crosswalks", 3), Loss("lanes", 4, 0.05, "m"))
    total = Losses(losses.found())
    total.add(losses.found())
    assert total.found() == (Loss("crosswalks", 6), Loss("lanes", 8, 0.05, "m"))


def test_losses_are_sentences():
    assert str(Loss("crosswalks", 1200)) == "1,200 crosswalks left out"
    assert str(Loss("lanes", 4, 0.0512, "m")) == "4 lanes approximated, to 0.0512 m"
