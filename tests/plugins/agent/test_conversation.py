"""What a conversation with a model came to."""

from bsa.plugins.agent.conversation import Answer


def test_what_was_wrong_several_times_is_told_once() -> None:
    same = "the reply holds no JSON object. Hint: answer with one."
    assert Answer(None, (same,) * 3, None).complaint == f"{same} (3 attempts)"
    assert Answer(None, (same, "x.", same), None).complaint == f"{same} (2 attempts); x."
    assert Answer(None, (), None).complaint == ""
