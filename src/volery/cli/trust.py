"""Asks once whether node code from the folder of a scenario or launch profile may run.

A node is a module, and importing a module runs its code with all rights of the user. Shipped and
installed nodes start without a question. Nodes from the file's folder start only with `--trust` or
after a yes at a terminal, which is saved for this file and these modules.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import typer

from volery.cli.error_reporting import warn
from volery.cli.flight import RunOptions
from volery.cli.terminal import echo_line
from volery.core.errors import ScenarioError
from volery.core.private_folders import (
    UnsafeFolderError,
    check_own_file,
    private_folder,
    state_root,
)
from volery.core.whole_files import write_whole
from volery.scenario import library
from volery.scenario.access import ScenarioAccess
from volery.scenario.node_names import node_module


def with_trust(options: RunOptions) -> RunOptions:
    """Returns the options, with `trust` set if the code that the scenario names may run.

    Raises `ScenarioError` if there is such code and it may not run.
    """
    if options.trust or options.scenario in library.names():
        return options
    file = Path(options.scenario)
    if not file.is_file():  # an unknown name, or that of a log's scenario
        return options
    return replace(options, trust=may_run_code_of(file, nodes=options.nodes))


def may_run_code_of(file: Path, *, nodes: bool = True) -> bool:
    """Returns whether a scenario file names local nodes or predicates and the user trusts them.

    nodes: whether its nodes start. Raises `ScenarioError` if they may not run.
    """
    from volery.scenario.expectations import PredicateExpectation
    from volery.scenario.load import load_scenario

    scenario = load_scenario(file)
    functions = [e.function for e in scenario.expect if isinstance(e, PredicateExpectation)]
    modules = list(dict.fromkeys(function.partition(":")[0] for function in functions))
    if nodes:
        modules += _local_modules([e.node for e in scenario.node_entries], scenario.access)
    return may_run_local_code(file, modules)


def may_run_local_nodes(file: Path, nodes: Iterable[str], access: ScenarioAccess) -> bool:
    """Returns whether a file names nodes from its own folder and the user trusts them.

    Asks at a terminal if no answer is saved. Raises `ScenarioError` if they may not run.
    """
    return may_run_local_code(file, _local_modules(nodes, access))


def _local_modules(nodes: Iterable[str], access: ScenarioAccess) -> list[str]:
    """Returns the modules of nodes that lie beside their scenario."""
    from volery.runtime.construction.node_loading import is_local

    named = dict.fromkeys(node_module(node) for node in nodes)
    return [module for module in named if module is not None and is_local(module, access)]


def may_run_local_code(file: Path, modules: list[str]) -> bool:
    """Returns whether a file names `modules` beside it and the user trusts them.

    Asks at a terminal if no answer is saved. Raises `ScenarioError` if they may not run.
    """
    if not modules:
        return False
    if not set(modules) <= _trusted(file):
        names = ", ".join(modules)
        if not at_terminal():
            raise ScenarioError(
                f"{file}: runs code of its own ({names}); give --trust if it is yours"
            )
        echo_line(f"{file} runs code of its own: {names}.", err=True)
        echo_line("It can do whatever you can. Answer yes only if you know the code.", err=True)
        if not typer.confirm("Trust it from now on?", default=False, err=True):
            raise ScenarioError(f"{file}: its own code ({names}) is not trusted")
        _remember(file, modules)
    return True


def at_terminal() -> bool:
    """Returns whether a user can be asked."""
    return sys.stdin.isatty() and sys.stderr.isatty()


def trust_file() -> Path:
    """Returns the file of saved answers.

    Raises `OSError` for a user without a home folder, whose answers are not saved.
    """
    return state_root() / "trusted.json"


def _trusted(file: Path) -> set[str]:
    found = _read().get(str(file.resolve()), [])
    return {str(module) for module in found} if isinstance(found, list) else set()


def _read() -> dict[str, Any]:
    try:
        file = trust_file()
        check_own_file(file)
        found = json.loads(file.read_text(encoding="utf-8"))
    except UnsafeFolderError as error:
        warn(f"{error}: saved answers about nodes are ignored")
        return {}
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}


def _remember(file: Path, modules: Iterable[str]) -> None:
    """Saves an answer; if that fails, the user is asked again next time."""
    known = _read()
    known[str(file.resolve())] = sorted(_trusted(file) | set(modules))
    try:
        target = trust_file()
        private_folder(target.parent.parent, target.parent.name)
        write_whole(target, json.dumps(known, indent=1), private=True)
    except OSError:
        return
