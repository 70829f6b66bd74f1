import inspect

from bsa.core.task import Task


def test_the_signature_of_a_task_is_short() -> None:
    signature = str(inspect.signature(Task))
    assert "Domain('lithium-ion cell')" in signature
    assert len(signature) < 1500
