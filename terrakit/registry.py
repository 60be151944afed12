"""Finds plugins, keeps broken ones apart, and turns names into operators.

Built-ins come through the same entry points (group ``terrakit``) as third parties. They are loaded
first; third parties only when a name is not a built-in's, or when everything is listed. So a
plugin that hangs or crashes at import cannot harm a recipe that does not use it, and no plugin can
quietly take a built-in's name: its operator is then reached as ``distribution:name``.
"""

from __future__ import annotations

import contextlib
import functools
import importlib.metadata
import inspect
import os
import signal
import threading
import traceback
import warnings
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

import pluggy

from terrakit import hookspecs
from terrakit.errors import ParameterError, PluginError
from terrakit.layers import layer_kind
from terrakit.operators import Erosion, Exporter, Filter, Generator, Importer, Operator, Texture
from terrakit.parameters import suggestion

GROUP = "terrakit"
BUILT_IN = "terrakit"
FAMILIES: dict[str, type[Operator]] = {
    "terrakit_generators": Generator,
    "terrakit_filters": Filter,
    "terrakit_erosions": Erosion,
    "terrakit_textures": Texture,
    "terrakit_importers": Importer,
    "terrakit_exporters": Exporter,
}
KINDS: dict[str, type[Operator]] = {base.kind: base for base in FAMILIES.values()}


@dataclass(eq=False)
class Plugin:
    """One entry point and what became of it."""

    name: str
    distribution: str
    version: str
    module: str
    problem: str = ""
    operators: list[type[Operator]] = field(default_factory=list)

    @property
    def label(self) -> str:
        """``distribution version``, as messages name it."""
        return f"{self.distribution} {self.version}".strip()

    @property
    def is_built_in(self) -> bool:
        """Whether it ships with terrakit."""
        return self.distribution == BUILT_IN


class Registry:
    """The operators that this process knows.

    Parameters
    ----------
    third_parties
        Whether plugins of other distributions may be loaded.
    disabled
        Names of entry points or distributions to leave out.
    """

    def __init__(self, third_parties: bool = True, disabled: Iterable[str] = ()) -> None:
        self._manager = pluggy.PluginManager("terrakit")
        self._manager.add_hookspecs(hookspecs)
        self._disabled = frozenset(disabled)
        self._third_parties = third_parties
        self._lock = threading.RLock()
        self._waiting = list(self._entry_points())
        self._loaded: list[Plugin] = []
        self._load(lambda plugin: plugin.is_built_in)

    def tell(self, event: str, **facts: Any) -> None:
        """Tell every observer of an event; one that fails is named in a warning."""
        for implementation in getattr(self._manager.hook, event).get_hookimpls():
            try:
                implementation.function(**{name: facts[name] for name in implementation.argnames})
            except Exception as error:
                warnings.warn(
                    f"plugin {implementation.plugin_name}: {event}: {_reason(error)}", stacklevel=2
                )

    def load_observers(self) -> None:
        """Load the plugins that watch every run: entry points that begin with ``observer``."""
        self._load(lambda plugin: plugin.name.startswith("observer"))

    def plugins(self) -> list[Plugin]:
        """Load every plugin and return all of them, broken ones included."""
        self._load(lambda plugin: True)
        return sorted(self._loaded, key=lambda p: (not p.is_built_in, p.distribution, p.name))

    def operators(self, kind: str | None = None, built_in: bool = False) -> list[type[Operator]]:
        """Return the operators, sorted by kind and name.

        Parameters
        ----------
        kind
            Only these; all of them by default.
        built_in
            Whether to leave third parties alone, which are loaded otherwise.
        """
        return sorted(
            (
                operator
                for plugin in (self._loaded if built_in else self.plugins())
                if plugin.is_built_in or not built_in
                for operator in plugin.operators
                if kind is None or operator.kind == kind
            ),
            key=lambda operator: (list(KINDS).index(operator.kind), operator.name),
        )

    def get(self, name: str, kind: str | None = None) -> type[Operator]:
        """Return the operator called ``name``, or ``distribution:name``.

        Raises
        ------
        ParameterError
            If there is none; the message suggests the nearest name.
        PluginError
            If two distributions claim the name, or the plugin that should bring it is broken.
        """
        distribution, _, bare = name.rpartition(":")
        found = self._find(bare, distribution, kind)
        if not found or (len(found) == 1 and found[0][0].distribution != BUILT_IN):
            self._load(lambda plugin: plugin.name == bare or plugin.distribution == distribution)
            self._load(lambda plugin: True)
            found = self._find(bare, distribution, kind)
        elif not distribution:
            claims = [p for p, _ in self._waiting if p.name == bare and not p.is_built_in]
            if claims:
                raise PluginError(
                    f"operator '{bare}' comes from {found[0][0].label} and {claims[0].label}; "
                    f"name one: {found[0][0].distribution}:{bare} or "
                    f"{claims[0].distribution}:{bare}"
                )
        built_in = [pair for pair in found if pair[0].is_built_in]
        if len(built_in) == 1 and not distribution:
            found = built_in
        if len(found) > 1:
            owners = [plugin for plugin, _ in found]
            raise PluginError(
                f"operator '{bare}' comes from {owners[0].label} and {owners[1].label}; "
                f"name one: {owners[0].distribution}:{bare} or {owners[1].distribution}:{bare}"
            )
        if found:
            return found[0][1]
        for plugin in self._loaded:
            if plugin.problem and bare in (plugin.name, plugin.module.rpartition("_")[2]):
                raise PluginError(f"plugin {plugin.label}: {plugin.problem}")
        known = [o.name for p in self._loaded for o in p.operators if kind in (None, o.kind)]
        raise ParameterError(f"no {kind or 'operator'} '{name}'{suggestion(bare, known)}")

    def owner(self, operator: type[Operator]) -> Plugin:
        """Return the plugin that brought ``operator``."""
        for plugin in self._loaded:
            if operator in plugin.operators:
                return plugin
        return Plugin(operator.name, "unregistered", "", operator.__module__)

    def _find(
        self, name: str, distribution: str, kind: str | None
    ) -> list[tuple[Plugin, type[Operator]]]:
        return [
            (plugin, operator)
            for plugin in self._loaded
            for operator in plugin.operators
            if operator.name == name
            and (kind is None or operator.kind == kind)
            and distribution in ("", plugin.distribution)
        ]

    def _entry_points(self) -> Iterator[tuple[Plugin, importlib.metadata.EntryPoint]]:
        seen: set[tuple[str, str, str]] = set()
        for entry in importlib.metadata.entry_points(group=GROUP):
            named = entry.dist.name if entry.dist else "unknown"
            plugin = Plugin(
                entry.name, named, entry.dist.version if entry.dist else "", entry.value
            )
            key = (named, entry.name, entry.value)
            left_out = self._disabled & {entry.name, named, entry.value}
            if key in seen or left_out or not (self._third_parties or plugin.is_built_in):
                continue
            seen.add(key)
            yield plugin, entry

    def _load(self, wanted: Any) -> None:
        with self._lock:
            chosen = [pair for pair in self._waiting if wanted(pair[0])]
            self._waiting = [pair for pair in self._waiting if not wanted(pair[0])]
            for plugin, entry in chosen:
                self._loaded.append(plugin)
                try:
                    with _undisturbed():
                        self._take(plugin, entry)
                except KeyboardInterrupt:
                    raise
                except BaseException as error:
                    plugin.operators = []
                    plugin.problem = plugin.problem or _reason(error)
                    warnings.warn(f"plugin {plugin.label}: {plugin.problem}", stacklevel=4)

    def _take(self, plugin: Plugin, entry: importlib.metadata.EntryPoint) -> None:
        module = entry.load()
        name = f"{plugin.distribution}:{plugin.name}"
        try:
            self._manager.register(module, name)
            unknown = [
                attribute
                for attribute in dir(module)
                if _is_hook(module, attribute) and not hasattr(hookspecs, attribute)
            ]
            if unknown:
                known = [n for n in dir(hookspecs) if n.startswith("terrakit_")]
                raise TypeError(f"unknown hook '{unknown[0]}'{suggestion(unknown[0], known)}")
            for hook, base in FAMILIES.items():
                if _is_hook(module, hook):
                    for operator in _listed(getattr(module, hook)(), hook):
                        check_declaration(operator, base)
                        plugin.operators.append(operator)
        except BaseException:
            if self._manager.has_plugin(name):
                self._manager.unregister(name=name)
            raise


@functools.lru_cache(maxsize=1)
def default_registry() -> Registry:
    """Return the registry of this process; what is installed does not change while it runs."""
    disabled = os.environ.get("TERRAKIT_DISABLE", "")
    return Registry(
        third_parties=os.environ.get("TERRAKIT_NO_PLUGINS", "") in ("", "0"),
        disabled=[name.strip() for name in disabled.split(",") if name.strip()],
    )


def check_declaration(operator: Any, base: type[Operator]) -> None:
    """Raise TypeError unless ``operator`` is a whole declaration of its kind."""
    if not (isinstance(operator, type) and issubclass(operator, base)):
        raise TypeError(f"returned {operator!r}, must be a {base.__name__} subclass")
    if inspect.isabstract(operator):
        missing = ", ".join(sorted(operator.__abstractmethods__))
        raise TypeError(f"{operator.__name__} lacks {missing}()")
    if not operator.name.replace("_", "").isalnum() or operator.name != operator.name.lower():
        raise TypeError(f"{operator.__name__}.name = {operator.name!r}: must be lower_case")
    if not (operator.__doc__ or "").strip():  # its own, not what getdoc() finds in its base
        raise TypeError(f"{operator.__name__} has no docstring")
    for declared in (*operator.reads, *operator.uses, *operator.writes):
        if layer_kind(declared) is None and layer_kind(declared + "x") is None:
            raise TypeError(
                f"{operator.__name__} declares layer {declared!r}, which the vocabulary "
                "(terrakit.layers) does not have"
            )
    for name, parameter in operator.model_fields.items():
        if not parameter.description:
            raise TypeError(f"{operator.__name__}.{name} has no description; use parameter()")


def _listed(returned: Any, hook: str) -> list[Any]:
    if not isinstance(returned, (list, tuple)):
        raise TypeError(f"{hook} returned {type(returned).__name__}, must be a list of classes")
    return list(returned)


def _is_hook(module: Any, attribute: str) -> bool:
    """Return whether the module marks this attribute with ``hookimpl``."""
    value = getattr(module, attribute, None)
    return callable(value) and getattr(value, "terrakit_impl", None) is not None


def _reason(error: BaseException) -> str:
    if isinstance(error, SystemExit):
        return f"tried to end the program (exit {error.code})"
    if isinstance(error, pluggy.PluginValidationError):
        return " ".join(str(error).split())[:300]
    place = ""
    frames = traceback.extract_tb(error.__traceback__)
    if frames and not isinstance(error, (TypeError, ImportError)):
        place = f" at {os.path.basename(frames[-1].filename)}:{frames[-1].lineno}"
    text = " ".join(str(error).split())[:300]
    return f"{type(error).__name__}{place}: {text}" if text else f"{type(error).__name__}{place}"


@contextlib.contextmanager
def _undisturbed() -> Iterator[None]:
    """Put back what a plugin may change while it is imported: working folder and Ctrl-C."""
    folder = os.getcwd()
    in_main = threading.current_thread() is threading.main_thread()
    handler = signal.getsignal(signal.SIGINT) if in_main else None
    try:
        yield
    finally:
        if os.getcwd() != folder:
            os.chdir(folder)
        if in_main and handler is not None and signal.getsignal(signal.SIGINT) != handler:
            signal.signal(signal.SIGINT, handler)
