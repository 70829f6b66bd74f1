"""What the records say where the numerical fit stands: what they do not fix, and what cannot be told apart."""

from ....core.inference.identifiability import effective_noise, identify
from ....core.inference.residual_errors import NOISE_FLOOR
from ....core.parameters import Candidate, ParameterSpace
from ....core.trajectory import FloatArray


def settled_questions(
    jacobian: FloatArray, residual: FloatArray, space: ParameterSpace, candidate: Candidate
) -> dict[str, list[str] | list[list[str]]]:
    """What the records do not fix where the fit stands: left open, merely narrowed down, or told only together."""
    noise = effective_noise(residual, len(space), NOISE_FLOOR)
    found = identify(jacobian, residual, space, candidate, noise)
    return {
        "leaves_open": list(found.open),
        "narrows": list(found.loose),
        "only_together": [list(group) for group in found.correlated],
    }
