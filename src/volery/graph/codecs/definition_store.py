"""Provides a typestore that loads types from definition files on demand.

Creating a dataclass takes about half a millisecond, so only the types in use are created:
`store.types["std_srvs/srv/Trigger_Request"]` reads the file that defines the type.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from rosbags.interfaces import Nodetype
from rosbags.typesys import TypesysError
from rosbags.typesys.store import Typestore

from volery.core.errors import GraphError
from volery.graph.codecs import definition_budget
from volery.graph.codecs.definition_budget import MAX_DEPTH, check_definitions, check_foreign
from volery.graph.codecs.definition_files import (
    Definition,
    DefinitionFile,
    find_definition_files,
    read_definition_file,
)
from volery.graph.message_defaults import make_arguments_optional
from volery.graph.message_methods import add_methods

EMPTY_MEMBER = definition_budget.EMPTY_MEMBER
"""The byte of a message without fields, in ROS 2 only."""
MAX_FOREIGN = 5000
"""Limit of the types that one process registers from logs."""


class _LazyDict(dict[str, Any]):
    """A dict that loads a pending type at its first lookup."""

    def __init__(self, present: dict[str, Any], pending: Callable[[str], bool]) -> None:
        super().__init__(present)
        self._pending = pending

    def __missing__(self, name: str) -> Any:
        if self._pending(name):
            return dict.__getitem__(self, name)
        raise KeyError(name)

    def __contains__(self, name: object) -> bool:
        return super().__contains__(name) or (isinstance(name, str) and self._pending(name))

    def get(self, name: str, default: Any = None) -> Any:
        try:
            return self[name]
        except KeyError:
            return default


class DefinitionStore(Typestore):
    """Holds the types of a store and of folders of definition files. Thread-safe."""

    def __init__(self, base: Typestore, module: str) -> None:
        super().__init__()
        self._files: dict[str, DefinitionFile] = {}
        self._loading: set[str] = set()
        self._lock = threading.RLock()
        self._module = module
        self._definitions: dict[str, Definition] = {}
        self._num_foreign = 0
        self.types = _LazyDict(dict(base.types), self._load)
        self.fielddefs = _LazyDict(dict(base.fielddefs), self._load)

    def names(self) -> list[str]:
        """Returns the names of all types, loaded or not, sorted."""
        return sorted({*self.fielddefs, *self._files})

    def default_of(self, msgtype: str, field: str) -> Any:
        """Returns a field's default in its definition file; None: zero."""
        definition = self._definitions.get(msgtype)
        return None if definition is None else definition.defaults.get(field)

    def constant_text(self, msgtype: str, constant: str) -> str | None:
        """Returns a constant as written in its file; None for a type without file."""
        definition = self._definitions.get(msgtype)
        return None if definition is None else definition.constant_texts.get(constant)

    def index_folder(self, folder: Path) -> None:
        """Registers a folder's types without reading the files; errors appear at first use."""
        for file in find_definition_files(folder):
            for name in file.names:
                if not dict.__contains__(self.fielddefs, name):
                    self._files.setdefault(name, file)

    def add_folder(self, folder: Path, *, foreign: bool = False) -> list[str]:
        """Reads a folder and registers its types, all or none. Returns their names.

        A known type with the same fields is skipped. Types of an untrusted log (`foreign`) have
        more limits: a process registers at most `MAX_FOREIGN` of them.

        Raises `GraphError` if a file is broken, names an unknown type, repeats a type of another
        file, or defines a known type with other fields, or if a type contains itself or is too
        large.
        """
        found: dict[str, Definition] = {}
        for file in find_definition_files(folder, foreign=foreign):
            for definition in read_definition_file(file):
                other = found.get(definition.name)
                if other is not None:
                    raise GraphError(
                        f"{definition.source}: {definition.name} is also defined in {other.source}"
                    )
                found[definition.name] = definition
        with self._lock:
            for definition in found.values():
                self._check(definition, found)
            _check_cycles(found)
            new = {n: d for n, d in found.items() if n not in self.fielddefs}
            check_definitions(new, self.fielddefs.__getitem__)
            if foreign:
                self._admit(new)
            self._register(new.values())
        return sorted(found)

    def _admit(self, new: dict[str, Definition]) -> None:
        check_foreign(new, self.fielddefs.__getitem__)
        if self._num_foreign + len(new) > MAX_FOREIGN:
            raise GraphError(
                f"this process has registered {MAX_FOREIGN} message types from logs, which is the "
                "limit; restart the process"
            )
        self._num_foreign += len(new)

    def _check(self, definition: Definition, found: dict[str, Definition]) -> None:
        name = definition.name
        for nested, line in definition.nested:
            if nested not in found and nested not in self.fielddefs:
                raise GraphError(f"{definition.source}:{line}: unknown type '{nested}'")
        known = self.fielddefs.get(name)
        if known is not None and _shape(known[1]) != _shape(definition.fields):
            raise GraphError(f"{definition.source}: {name} is already known with other fields")

    def _load(self, name: str) -> bool:
        """Registers a pending type; returns False if the name is not pending."""
        with self._lock:
            if dict.__contains__(self.types, name):
                return True  # another thread was faster
            file = self._files.get(name)
            if file is None or name in self._loading:
                return False
            definitions = read_definition_file(file)
            inside = {part.name for part in definitions}
            for part in definitions:
                for nested, line in part.nested:
                    if nested not in inside and nested not in self.fielddefs:
                        raise GraphError(f"{part.source}:{line}: unknown type '{nested}'")
            self._loading |= inside
            try:
                self._register(definitions)
            finally:
                self._loading -= inside
            for loaded in inside:
                self._files.pop(loaded, None)
        return True

    def _register(self, definitions: Iterable[Definition]) -> None:
        new = {d.name: d for d in definitions}
        if not new:
            return
        try:
            self.register({d.name: (d.constants, d.fields) for d in new.values()})
        except TypesysError as error:
            source = next(iter(new.values())).source
            raise GraphError(f"{source}: {error}") from None
        for name in new:
            # Lets pickle find the class again; rosbags' own module holds only the newest type.
            self.types[name].__module__ = self._module
        self._definitions.update(new)
        for name in new:
            make_arguments_optional(
                name, self.types[name], self.types, self.fielddefs, self.default_of
            )
            add_methods(name, self.types[name], self.fielddefs)


def _shape(fields: Any) -> Any:
    return [(name, described) for name, described in fields if name != EMPTY_MEMBER]


def _check_cycles(found: dict[str, Definition]) -> None:
    """Raises `GraphError` if a type contains itself."""
    done: set[str] = set()

    def visit(name: str, above: tuple[str, ...]) -> None:
        if name in above:
            loop = " > ".join((*above[above.index(name) :], name))
            raise GraphError(f"{found[name].source}: {name} contains itself: {loop}")
        if name in done or name not in found:
            return
        if len(above) > MAX_DEPTH:
            raise GraphError(f"{found[name].source}: types are nested more than {MAX_DEPTH} deep")
        for nested, _ in found[name].nested:
            visit(nested, (*above, name))
        done.add(name)

    for name in found:
        visit(name, ())


def element_type(described: Any) -> str | None:
    """Returns the message type of a field or its elements; None for numbers and strings."""
    kind, detail = described
    if kind == Nodetype.NAME:
        return str(detail)
    if kind in (Nodetype.ARRAY, Nodetype.SEQUENCE):
        return element_type(detail[0])
    return None
