"""Which hooks a plugin implements, and what about its methods would silently be passed over."""

import inspect
from collections.abc import Mapping
from typing import Any

import pluggy

from ..errors import did_you_mean
from ..hooks import PROJECT


def hook_methods(plugin: object, specifications: type) -> tuple[Mapping[str, pluggy.HookImpl], dict[str, str]]:
    """The hooks that an object implements.

    Gives them by name, and by name what is wrong with others: a name that is no hook, a hook without @hookimpl. Where
    a hook has other arguments than it should, none is given, and the fault has the name "". The object is a module, or
    what a factory made.
    """
    known = [name for name, _ in inspect.getmembers(specifications, inspect.isfunction)]
    manager = pluggy.PluginManager(PROJECT)
    manager.add_hookspecs(specifications)
    try:
        manager.register(plugin, "plugin")
    except pluggy.PluginValidationError as error:
        return {}, {"": " ".join(str(error).split()).removeprefix("Plugin 'plugin' for hook ")}
    methods: dict[str, pluggy.HookImpl] = {}
    callers = {caller.name: caller for caller in manager.get_hookcallers(plugin) or ()}
    faults: dict[str, str] = {}
    for name, caller in callers.items():
        (method,) = caller.get_hookimpls()
        if not caller.has_spec():
            faults[name] = f'"{name}" is no hook: {did_you_mean(name, known) or "see docs/plugins.md"}'
        elif method.hookwrapper or method.wrapper:
            faults[name] = f'"{name}" wraps the hook; wrappers are not called'
        else:
            methods[name] = method
    faults |= {
        name: f'"{name}" is named as a hook and not marked: put @hookimpl above it, or rename it'
        for name in known
        if name not in callers and inspect.isroutine(getattr(plugin, name, None))
    }
    return methods, faults


def call(method: pluggy.HookImpl, arguments: Mapping[str, Any]) -> Any:
    """Call a hook's method with those arguments that it names."""
    named = [arguments[name] for name in method.argnames]
    return method.function(*named, **{name: arguments[name] for name in method.kwargnames if name in arguments})
