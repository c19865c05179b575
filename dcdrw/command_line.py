"""Reads the command line and runs the command that it names."""

import argparse
import os
import signal
import sys
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from difflib import get_close_matches
from importlib import import_module
from typing import Any, NoReturn

from dcdrw.commands import Command
from dcdrw.console import Interrupted, end_signals, in_words
from dcdrw.help_text import HelpFormatter


class CommandParser(argparse.ArgumentParser):
    """The parser of one command: its module is imported, and tells the arguments, when the command is chosen."""

    def __init__(self, module: str = '', **kwargs: Any) -> None:
        super().__init__(formatter_class=HelpFormatter, **kwargs)
        self._module = module

    def load(self) -> None:
        """Import the command's module and take its arguments."""
        if self._module:
            module = import_module(f'dcdrw.commands.{self._module}')
            self._module = ''
            module.add_arguments(self)
            self.set_defaults(run=module.run, prog=self.prog)

    @property
    def option_strings(self) -> list[str]:
        """Its options as they are written."""
        return list(self._option_string_actions)

    def error(self, message: str) -> NoReturn:
        """End with the message, and where to read on."""
        self.exit(2, f'{self.prog}: {message} ({self.prog} --help tells what it takes)\n')

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """As argparse has it, once the arguments are known."""
        self.load()
        return super().parse_known_args(args, namespace)


class CommandLine:
    """The commands, by their names."""

    def __init__(self, commands: Mapping[str, Command], description: str, epilog: str) -> None:
        self.parser = CommandParser(prog='dcdrw', description=description, epilog=epilog)
        self.parser.add_argument('--version', action='store_true', help='tell the version, and end')
        listed = self.parser.add_subparsers(title='commands', metavar='COMMAND', parser_class=CommandParser)
        self.commands = {
            name: listed.add_parser(name, help=command.help, module=command.module)
            for name, command in commands.items()
        }

    def run(self, arguments: Sequence[str]) -> int:
        """Run the command that these arguments name; returns the exit status."""
        try:
            try:
                return self._run(arguments)
            finally:  # also of --help, which ends by itself
                if sys.stdout:
                    sys.stdout.flush()
        except BrokenPipeError:  # whoever read has seen enough
            status = 128 + signal.SIGPIPE
        except OSError as error:  # a full disk
            print(f'dcdrw: {in_words(error)}', file=sys.stderr)
            status = 2
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return status

    def _run(self, arguments: Sequence[str]) -> int:
        if '_ARGCOMPLETE' in os.environ:  # the shell asks what could be typed next
            self._complete(os.environ['COMP_LINE'].split())
        chosen = next((argument for argument in arguments if not argument.startswith('-')), None)
        if chosen and chosen not in self.commands:
            mend = _suggestion(chosen, self.commands) or '; dcdrw --help lists them'
            print(f'dcdrw: there is no command {chosen!r}{mend}', file=sys.stderr)
            return 2
        options, unknown = self.parser.parse_known_args(arguments)
        if options.version:
            print(f'dcdrw {_version()}')
            return 0
        parser = self.commands[chosen] if chosen else self.parser
        if unknown:
            mend = _suggestion(unknown[0], parser.option_strings)
            print(f'{parser.prog}: there is no argument {unknown[0]!r}{mend}', file=sys.stderr)
            return 2
        if chosen is None:
            self.parser.print_help()
            return 0
        prog: str = options.prog
        try:
            with _raised_signals():
                status: int = options.run(options)
            return status
        except KeyboardInterrupt as interrupt:
            print(f'{prog}: interrupted', file=sys.stderr)
            return 128 + getattr(interrupt, 'number', signal.SIGINT)
        except BrokenPipeError:
            raise
        except (ValueError, OSError) as error:
            print(f'{prog}: {in_words(error)}', file=sys.stderr)
            return 2

    def _complete(self, words: Sequence[str]) -> None:
        """Tell the shell how a line can go on; only the command that stands there is imported."""
        from argcomplete import autocomplete

        for word in words[1:2]:
            if word in self.commands:
                self.commands[word].load()
        autocomplete(self.parser)


def _suggestion(word: str, known: Mapping[str, Any] | Sequence[str]) -> str:
    near = get_close_matches(word, known, 1)
    return f'; did you mean {near[0]}?' if near else ''


@contextmanager
def _raised_signals() -> Iterator[None]:
    """Signals that ask for an end raise `Interrupted` in the main thread, so that all is left in order.

    Where a library drops that exception (Python does so in callbacks of C) it is raised again; where one turns it into
    an error of its own (an import that was broken off), it is taken for what it was.
    """
    asked: list[int] = []

    def interrupt(number: int, _: object) -> None:
        asked.append(number)
        raise Interrupted(number)

    def dropped(what: Any) -> None:
        if isinstance(what.exc_value, Interrupted):  # a little later, for in this hook it would be dropped again
            threading.Timer(0.02, os.kill, (os.getpid(), what.exc_value.number)).start()
        else:
            sys.__unraisablehook__(what)

    if threading.current_thread() is not threading.main_thread():  # where no signal comes
        yield
        return
    sys.unraisablehook = dropped
    try:
        with end_signals(interrupt):
            yield
    except Exception as error:
        if asked:
            raise Interrupted(asked[0]) from error
        raise
    finally:
        sys.unraisablehook = sys.__unraisablehook__


def _version() -> str:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version('dcdrw')
    except PackageNotFoundError:
        return '(not installed)'
