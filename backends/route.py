"""What a route to language models is: a kind of server, a service or a library, by which models are asked by name."""

from abc import ABC, abstractmethod
from dataclasses import dataclass

from ..core.messages import Backend
from .options import BackendOptions


@dataclass(frozen=True)
class NotReady:
    """Why a model cannot be asked by a route now.

    Attributes
    ----------
    detail : str
        The reason, ``"not downloaded"``.
    remedy : str
        The one command that would make it ready.
    made_ready_by_opening : bool
        Whether opening it does the same, so that it is opened for whoever names the route.
    unreachable : bool
        Whether nothing is there that could answer, so that a run stops before its first simulation. Otherwise the run
        only tells that the model may not answer: a server may have models that it does not list.
    """

    detail: str
    remedy: str
    made_ready_by_opening: bool = False
    unreachable: bool = False


class Route(ABC):
    """A route, made from its options.

    Parameters
    ----------
    options : BackendOptions
        What is set for the model: an instance of the ``config_type`` that the route's `Entry` declares.
    """

    takes_base_url: bool = False
    """Whether ``--base-url`` names its server; otherwise that option is refused."""

    on_own_machines: bool = False
    """Whether its models run on machines of the user, so that their tokens cost nothing."""

    def __init__(self, options: BackendOptions) -> None:
        self.options = options

    @abstractmethod
    def check(self, model: str) -> NotReady | None:
        """Why a model cannot be asked; None if it can. Looks for a second at most, and loads or asks no model."""

    @abstractmethod
    def open(self, model: str, name: str) -> Backend:
        """The model.

        Parameters
        ----------
        model : str
            Its name under this route: what follows the colon of ``--backend ROUTE:MODEL``, or what a preset says.
        name : str
            What the backend is to be called.

        Raises
        ------
        BsaError
            If the route cannot reach it; the hint says what would make it ready.
        """
