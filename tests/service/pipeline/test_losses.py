"""Report of saved states that could not be used: one message for each axis."""

from service.pipeline.restoring import Loss, loss_messages

A, B = "cell.axis1", "cell.axis2"
OTHER, DAMAGED = "it was saved with another model", "it is damaged"


def test_nothing_lost_is_no_message() -> None:
    assert list(loss_messages([])) == []


def test_one_message_names_all_that_is_lost() -> None:
    losses = [Loss(A, "history", OTHER, parameter) for parameter in ("kT", "1/Ja", "fm", "")]
    (message,) = loss_messages([Loss(A, "estimates", OTHER), *losses, Loss(A, "multimodel", OTHER)])
    assert message == (
        "cell.axis1: its checkpoint is not used and was quarantined: it was saved with another model (restarted: the"
        " estimates, the evidence of the multi-model detector and the long-term history of kT, 1/Ja and fm)"
    )


def test_axes_and_reasons_are_kept_apart() -> None:
    losses = [
        Loss(A, "estimates", DAMAGED),
        Loss(B, "multimodel", OTHER),
        Loss(A, "history", OTHER, "fm"),
        Loss("cell.axis3", "history", DAMAGED),
    ]
    assert list(loss_messages(losses)) == [
        "cell.axis1: its checkpoint is not used and was quarantined: it is damaged (restarted: the estimates); it was"
        " saved with another model (restarted: the long-term history of fm)",
        "cell.axis2: part of its checkpoint is not used and was quarantined: it was saved with another model"
        " (restarted: the evidence of the multi-model detector)",
        "cell.axis3: part of its checkpoint is not used and was quarantined: it is damaged (restarted: the long-term"
        " history)",
    ]
