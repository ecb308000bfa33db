"""What a start without the last run's state says: once for each axis."""

from __future__ import annotations

from service.pipeline.restore_report import BANK, ESTIMATES, HISTORY, Loss, losses_in_words

A, B = "cell.axis1", "cell.axis2"
OTHER, DAMAGED = "it was saved with another model", "it is damaged"


def test_nothing_lost_is_nothing_said() -> None:
    assert list(losses_in_words([])) == []


def test_one_message_names_all_that_is_lost() -> None:
    losses = [Loss(A, HISTORY, OTHER, of) for of in ("kT", "1/Ja", "fm", "")]
    (message,) = losses_in_words([Loss(A, ESTIMATES, OTHER), *losses, Loss(A, BANK, OTHER)])
    assert message == (
        "cell.axis1: its checkpoint is not used and quarantined: it was saved with another model; what restarts: the"
        " estimates, the evidence of the bank of hypotheses and the slow history of kT, 1/Ja and fm"
    )


def test_axes_and_reasons_are_not_mixed_up() -> None:
    losses = [Loss(A, ESTIMATES, DAMAGED), Loss(B, BANK, OTHER), Loss(A, HISTORY, OTHER, "fm")]
    assert list(losses_in_words(losses)) == [
        "cell.axis1: its checkpoint is not used and quarantined: it is damaged; what restarts: the estimates."
        " Also: it was saved with another model; what restarts: the slow history of fm",
        "cell.axis2: part of its checkpoint is not used and quarantined: it was saved with another model;"
        " what restarts: the evidence of the bank of hypotheses",
    ]


def test_what_was_being_gathered_alone() -> None:
    (message,) = losses_in_words([Loss(A, HISTORY, DAMAGED)])
    assert message.endswith("it is damaged; what restarts: the slow history")
