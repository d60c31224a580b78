"""The command `actionopt`: each of its commands is a module, read when it is asked for."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from importlib import import_module

from actionopt import __version__

ABOUT = "A Lagrangian and two events in, the path of stationary action between them out."
COMMANDS = {  # what each does, and the module whose `add_to` gives it its arguments
    "list": ("name the scenes, or tell of one", "cli.listing"),
    "solve": ("solve a scene or a file", "cli.solving"),
    "sweep": ("solve a scene or a file over a grid of values", "cli.sweeping"),
    "explore": ("open a window: drag a path, see its action, slide the end time", "cli.exploring"),
    "chapter": ("run the chapter on Lagrangian mechanics", "cli.chapter"),
    "exercise": ("write a lesson of the course as notebooks", "cli.exercise"),
    "suite": ("test problems for optimisers", "suite.commands"),
    "gallery": ("write the scenes as web pages", "gallery.commands"),
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command with `arguments` (by default those of the process); return its exit code.

    0 for success, 1 for a failure, whose message goes to the standard error, 2 for arguments
    that make no sense, 130 if interrupted, 141 if the output is read no further.
    """
    if "_ARGCOMPLETE" in os.environ:  # a shell asks what may follow, and no more
        complete = import_module("argcomplete").autocomplete
        complete(_parser(os.environ["COMP_LINE"].split()[1:2]))
    given = sys.argv[1:] if arguments is None else list(arguments)
    parser = _parser(given[:1])
    options, rest = parser.parse_known_args(given)
    if "asked" in options and not any(text.startswith("-") for text in rest):
        options.asked, rest = [*options.asked, *rest], []  # argparse takes none behind an option
    if rest:
        bare = [text for text in rest if "=" in text and not text.startswith("-")]
        hint = f"; write --set before each setting: --set {' --set '.join(bare)}" if bare else ""
        parser.error(f"unrecognized arguments: {' '.join(rest)}{hint}")
    try:
        code = options.run(options)
        sys.stdout.flush()
        return code
    except BrokenPipeError:  # whoever read the output has seen enough
        # What is still to be written when the process ends goes nowhere, without a word.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 141
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return 130
    except (ValueError, RuntimeError, OSError, ArithmeticError) as error:
        said = str(error)
        if isinstance(error, OSError) and error.filename is not None:
            said = (
                f"expected a place that can be written or read, found {str(error.filename)!r}: "
                f"{error.strerror}"
            )
        print(f"actionopt: {said}", file=sys.stderr)
        return 1


def _parser(asked: Sequence[str]) -> argparse.ArgumentParser:
    """Return the parser, with the arguments of the command that is `asked`."""
    parser = argparse.ArgumentParser(prog="actionopt", description=ABOUT)
    parser.add_argument("--version", action="version", version=f"actionopt {__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    for name, (text, module) in COMMANDS.items():
        command = commands.add_parser(name, help=text)
        if name in asked:
            import_module(f"actionopt.{module}").add_to(command)
    return parser
