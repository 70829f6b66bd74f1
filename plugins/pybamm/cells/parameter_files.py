"""Parameter sets in files: BPX, PyBaMM's own JSON, and what a calibration found.

Files are untrusted. No text of theirs is run: expressions of BPX are parsed and computed here, in place of the
source file that the ``bpx`` package would write and import, and the nodes of PyBaMM's JSON may name expression classes
only, for PyBaMM imports whatever they name.
"""

import ast
import json
import operator
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np

from ....core.encoding import decode_parameter
from ....core.errors import BsaError
from ....core.extras import require
from ....core.parameters import ParameterSpace
from ....core.printable import listed, shown
from ....core.shape import shaped
from ....core.task import CellModel, ParameterFile
from .nameplate import CAPACITY, nominal_capacity_ah
from .parameter_sets import CUT_OFFS, WHOLE_SET, pybamm, take_arguments, why_no_full_cell
from .state_of_charge import changed_values

_LONGEST_EXPRESSION = 10_000
_DEEPEST_EXPRESSION = 100

_OPERATORS: dict[type[ast.AST], Callable[..., Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
}
_FUNCTIONS = ("exp", "tanh", "cosh")
"""What a BPX expression may call."""

_NODES = {
    "scalar": ("Scalar", "Constant"),
    "binary_operators": (
        *("Addition", "Subtraction", "Multiplication", "Division", "Power", "Minimum", "Maximum", "Modulo"),
        *("EqualHeaviside", "NotEqualHeaviside", "MatrixMultiplication"),
    ),
    "unary_operators": ("Negate", "AbsoluteValue", "Sign", "Floor", "Ceiling"),
    "functions": (
        *("Exp", "Tanh", "Cosh", "Sinh", "Sqrt", "Log", "Log10"),
        *("Arcsinh", "Arctan", "Sin", "Cos", "Erf", "Max", "Min"),
    ),
    "interpolant": ("Interpolant",),
    "parameter": ("Parameter", "FunctionParameter"),
    "operations.serialise": ("ExpressionFunctionParameter",),
}
_ALLOWED = {f"pybamm.expression_tree.{module}.{name}" for module, names in _NODES.items() for name in names} | {
    "builtins.float",
    "builtins.tuple",
    "numpy.ndarray",
}
"""Classes that a node of PyBaMM's JSON may name: numbers, arguments, and arithmetic on them."""

_TAGS = ("$type", "type", "py/object", "module", "class")
"""Keys by which PyBaMM finds a class to import."""

COOLING = "Total heat transfer coefficient [W.m-2.K-1]"

_INFORMATION = ("citations", "chemistry")


def parsed(name: str, text: str) -> ParameterFile:
    """A file's text as a parameter set that has been checked; ``name`` is the file's, for people.

    The text is BPX, or what ``pybamm.ParameterValues.to_json`` writes, and untrusted. Raises `BsaError` if it is
    neither, or not valid.
    """
    content = _json(name, text)
    is_bpx = {"Header", "Parameterisation"} <= set(content)
    content.pop("Validation", None)  # measured curves, which are no parameters
    found = ParameterFile(name, "bpx" if is_bpx else "parameter-values", json.dumps(content))
    read_values(found)
    return found


def read_values(file: ParameterFile) -> dict[str, Any]:
    """The values of a parameter file by PyBaMM's names. Raises `BsaError` if the file is not what it says it is."""
    readers = {"bpx": _bpx, "parameter-values": _parameter_values, "calibrated": _calibrated}
    try:
        return readers[file.kind](file)
    except BsaError as error:
        raise BsaError(f"{shown(file.name)}: {error.message}", error.hint) from None
    except Exception as error:  # whatever two libraries make of a stranger's file
        reason = " ".join(str(error).split())
        raise BsaError(
            f"{shown(file.name)} does not read as {_WORDS[file.kind]} ({type(error).__name__}: {shown(reason, 300)}).",
            "a parameter file is BPX 1.x or 0.x, or what pybamm.ParameterValues.to_json writes.",
        ) from None


_WORDS = {"bpx": "BPX", "parameter-values": "PyBaMM's parameter values", "calibrated": "a calibration"}


def as_json(values: Any) -> str:
    """The numbers and functions of a parameter set as JSON that ``pybamm.ParameterValues.from_json`` reads."""
    known = {name: value for name, value in values.items() if callable(value) or isinstance(value, (int, float))}
    return json.dumps(pybamm.ParameterValues(known).to_json(), default=_plain)


def _plain(value: Any) -> Any:
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} has no place in a parameter file")


def _json(name: str, text: str) -> dict[str, Any]:
    def refuse(constant: str) -> None:
        raise ValueError(f"{constant} is no number")

    try:
        content = json.loads(text, parse_constant=refuse)
    except (ValueError, RecursionError) as error:
        raise BsaError(f"{shown(name)} is not valid JSON: {shown(error)}.", "check it there.") from None
    if not isinstance(content, dict):
        raise BsaError(f"{shown(name)} holds no JSON object.", "give BPX or PyBaMM's parameter values.")
    return content


def _bpx(file: ParameterFile) -> dict[str, Any]:
    bpx = require("bpx", "bpx", "a BPX file")
    content = json.loads(file.text)
    for text in _texts(content.get("Parameterisation")):
        expression(text)  # before bpx sees it, whose parser a stranger's text may keep busy for ever
    with warnings.catch_warnings(), _expressions_computed_here(bpx.Function):
        warnings.simplefilter("ignore")  # about fields that have defaults, and the conversion of version 0
        values = dict(pybamm.ParameterValues.create_from_bpx_obj(content))
    reason = why_no_full_cell(values)
    if reason:
        raise BsaError(f"{reason}.", "only full cells with one material in each electrode are simulated.")
    if not _states_cooling(content):
        values.pop(COOLING, None)  # PyBaMM's 0 is an adiabatic cell, of which the file says nothing
    return values


def _states_cooling(content: Mapping[str, Any]) -> bool:
    """Whether a BPX file has a heat transfer coefficient; the standard has one from version 1 on, and may lack it."""
    around = (content.get("State") or {}).get("Thermal environment") or {}
    return around.get("Heat transfer coefficient [W.m-2.K-1]") is not None


def _texts(content: Any) -> Iterator[str]:
    if isinstance(content, Mapping):
        for value in content.values():
            yield from _texts(value)
    elif isinstance(content, str):
        yield content


@contextmanager
def _expressions_computed_here(kind: Any) -> Iterator[None]:
    """Have `expression` compute what ``bpx.Function`` would write into a source file and import."""
    original = kind.to_python_function
    kind.to_python_function = lambda text, preamble=None: expression(str(text))
    try:
        yield
    finally:
        kind.to_python_function = original


def expression(text: str) -> Callable[[Any], Any]:
    """A BPX expression in ``x`` as a function of a number, an array or a PyBaMM symbol.

    Numbers, ``x``, ``+ - * / **``, ``exp``, ``tanh`` and ``cosh``; raises `BsaError` if it holds anything else. It is
    untrusted: it is parsed and never run.
    """
    if len(text) > _LONGEST_EXPRESSION:
        raise BsaError(f"an expression has {len(text)} characters.", f"give a table beyond {_LONGEST_EXPRESSION}.")
    try:
        tree = ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, MemoryError, RecursionError):
        raise BsaError(f'"{shown(text)}" is no expression.', "BPX has +, -, *, /, **, exp, tanh, cosh and x.") from None
    _check(tree, text, 0)
    return lambda x: _computed(tree, x)


def _check(node: ast.AST, text: str, depth: int) -> None:
    match node:
        case ast.BinOp(left, kind, right) if type(kind) in _OPERATORS:
            parts = [left, right]
        case ast.UnaryOp(kind, operand) if type(kind) in _OPERATORS:
            parts = [operand]
        case ast.Call(ast.Name(name), [argument], []) if name in _FUNCTIONS:
            parts = [argument]
        case ast.Name("x"):
            parts = []
        case ast.Constant(value) if isinstance(value, (int, float)) and not isinstance(value, bool):
            parts = []
        case _:
            raise BsaError(
                f'"{shown(text)}" holds "{shown(ast.unparse(node), 60)}".',
                "BPX has +, -, *, /, **, exp, tanh, cosh and x.",
            )
    if depth > _DEEPEST_EXPRESSION:
        raise BsaError(f'"{shown(text)}" is nested too deeply.', "give a table in its place.")
    for part in parts:
        _check(part, text, depth + 1)


def _computed(node: ast.AST, x: Any) -> Any:
    match node:
        case ast.BinOp(left, kind, right):
            return _OPERATORS[type(kind)](_computed(left, x), _computed(right, x))
        case ast.UnaryOp(kind, operand):
            return _OPERATORS[type(kind)](_computed(operand, x))
        case ast.Call(ast.Name(name), [argument], []):
            return getattr(pybamm if isinstance(x, pybamm.Symbol) else np, name)(_computed(argument, x))
        case ast.Constant(value):
            return float(value)  # type: ignore[arg-type]  # integers would grow without limit: 9**9**9
    return x


def _parameter_values(file: ParameterFile) -> dict[str, Any]:
    content = json.loads(file.text)
    lacking = [name for name in WHOLE_SET if name not in content]
    if lacking:
        raise BsaError(
            f"this is no whole parameter set: it lacks {listed(lacking)}.",
            "best_parameters.json needs its run's journal beside it; bsa export RUN --to parameter-values.",
        )
    values = {name: _value(name, value) for name, value in content.items() if name not in _INFORMATION}
    # What older versions of PyBaMM did not write is no other cell's: empty and full are then at the cut-offs.
    return {**{at_rest: values[cut_off] for cut_off, at_rest in CUT_OFFS.items() if cut_off in values}, **values}


def _value(name: str, value: Any) -> Any:
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return value
    if not isinstance(value, dict):
        raise BsaError(f'"{shown(name)}" is {shown(repr(value), 60)}.', "a value is a number or an expression.")
    _check_nodes(name, value)
    found = pybamm.ParameterValues.from_json({name: value})[name]
    return _as_function(found) if hasattr(found, "func_args") else found


def _check_nodes(name: str, node: Any) -> None:
    if isinstance(node, list):
        for part in node:
            _check_nodes(name, part)
    if not isinstance(node, dict):
        return
    tags = [key for key in _TAGS if key in node]
    if tags and (tags != ["$type"] or node["$type"] not in _ALLOWED):
        raise BsaError(
            f'"{shown(name)}" has a node of the class "{shown(str(node[tags[0]]), 80)}".',
            "only numbers, arguments and arithmetic on them are read from a file.",
        )
    for part in node.values():
        _check_nodes(name, part)


def _as_function(symbol: Any) -> Callable[..., Any]:
    """A function of its arguments, as parameter sets have them, of an expression in their names."""
    names = [str(name) for name in symbol.func_args]

    def function(*arguments: Any, **keywords: Any) -> Any:
        return _substituted(symbol.children[0], {**dict(zip(names, arguments, strict=False)), **keywords})

    take_arguments(function, names)
    return function


def _substituted(symbol: Any, arguments: Mapping[str, Any]) -> Any:
    if isinstance(symbol, pybamm.Parameter) and symbol.name in arguments:
        given = arguments[symbol.name]
        return given if isinstance(given, pybamm.Symbol) else pybamm.Scalar(given)
    if not symbol.children:
        return symbol
    return symbol.create_copy(new_children=[_substituted(child, arguments) for child in symbol.children])


def _calibrated(file: ParameterFile) -> dict[str, Any]:
    """A calibrated cell as a set of its own: the base set with everything that was found put in."""
    content = json.loads(file.text)
    cell: CellModel = shaped(CellModel, content["cell"])
    space = ParameterSpace(tuple(decode_parameter(parameter) for parameter in content["space"]))
    change = space.change(shaped(dict[str, float], content["candidate"]))
    # The area was scaled to the cell's capacity, which is what C-rates of this set refer to.
    nominal = {CAPACITY: nominal_capacity_ah(cell.parameter_set, cell.overrides)}
    return {**changed_values(cell, change), **nominal}
