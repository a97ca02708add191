"""What every configuration of this package is made of: one typed, bounded, documented field."""
from collections.abc import Callable
import dataclasses
from dataclasses import dataclass
from dataclasses import field
from functools import wraps
import math
import re
from typing import Any
from typing import cast
from typing import ClassVar
from typing import Self
import warnings

import numpy as np

Value = bool | int | float | str


class InputError(ValueError):
    """What the caller handed in cannot be used; the message names the field and the value.

    It is one line that a terminal shows as it is, whatever the value holds.
    """

    def __init__(self, message: str) -> None:
        line = re.sub(r'\s*\n\s*', ' ', message.strip())
        super().__init__(''.join(c if c.isprintable() else ascii(c)[1:-1] for c in line))


def setting(default: Value, meaning: str, unit: str = '', *, minimum: float | None = None,
            maximum: float | None = None, choices: tuple[str, ...] = (), group: str = '',
            common: bool = False) -> Any:
    """Return a dataclass field that carries its unit, meaning and bounds.

    Parameters
    ----------
    default : bool, int, float or str
    meaning : str
        One sentence for ``--help``, the YAML comment and the ROS parameter description.
    unit : str
        ``'m'``, ``'rad'``, ``'s'``, a quotient of them such as ``'m/s'``, or empty.
    minimum, maximum : float, optional
        Bounds, both inclusive.
    choices : tuple of str
        The words that a string may be; empty for any.
    group : str
        Heading under which shells show it.
    common : bool
        Whether many users change it: shells show it first.
    """
    metadata = {'meaning': meaning, 'unit': unit, 'minimum': minimum, 'maximum': maximum,
                'choices': choices, 'group': group, 'common': common}
    return field(default=default, metadata=metadata)


@dataclass(frozen=True)
class Setting:
    """One field of a configuration, as shells need it to declare, parse or print it."""

    name: str
    default: Value
    meaning: str
    unit: str
    minimum: float | None
    maximum: float | None
    choices: tuple[str, ...]
    group: str
    common: bool

    @property
    def kind(self) -> type:
        """The type of the value."""
        return type(self.default)

    @property
    def description(self) -> str:
        """Meaning, unit and choices in one line."""
        unit = f' [{self.unit}]' if self.unit else ''
        choices = f' ({", ".join(self.choices)})' if self.choices else ''
        return f'{self.meaning}{unit}{choices}'

    def check(self, given: object) -> Value:
        """Return `given` as this setting's type.

        Raises
        ------
        InputError
            Wrong type, not finite, out of bounds, or not one of the choices.
        """
        plain = given.item() if isinstance(given, np.generic) else given
        value = float(plain) if self.kind is float and type(plain) is int else plain
        if type(value) is not self.kind or not isinstance(value, bool | int | float | str):
            raise InputError(f'{self.name} = {value!r}: expected {self.kind.__name__}, '
                             f'got {type(value).__name__}')
        if isinstance(value, float) and not math.isfinite(value):
            raise InputError(f'{self.name} = {value!r}: not a finite number')
        if not isinstance(value, str):
            if self.minimum is not None and value < self.minimum:
                raise InputError(f'{self.name} = {value!r}: below the minimum {self.minimum}')
            if self.maximum is not None and value > self.maximum:
                raise InputError(f'{self.name} = {value!r}: above the maximum {self.maximum}')
        if self.choices and value not in self.choices:
            raise InputError(f'{self.name} = {value!r}: not one of {", ".join(self.choices)}')
        return value


@dataclass(frozen=True)
class Settings:
    """Base of the frozen configurations: checks each value when it is built."""

    FOR_STUDIES: ClassVar[bool] = False
    """Whether shells leave out the fields of this class, which subclasses inherit."""
    RENAMED: ClassVar[dict[str, str]] = {}
    """Names that fields had before, which are still taken: see `renamed`."""

    def __post_init__(self) -> None:
        for item in self.settings():
            object.__setattr__(self, item.name, item.check(getattr(self, item.name)))

    @classmethod
    def settings(cls) -> tuple[Setting, ...]:
        """Return the fields in their order, with defaults, units and bounds."""
        return tuple(Setting(f.name, cast(Value, f.default), **f.metadata)
                     for f in dataclasses.fields(cls))

    @classmethod
    def shown(cls) -> tuple[Setting, ...]:
        """Return the fields that users see in nodes and parameter files: no ablations."""
        hidden = {item.name for base in cls.__mro__
                  if issubclass(base, Settings) and vars(base).get('FOR_STUDIES')
                  for item in base.settings()}
        return tuple(item for item in cls.settings() if item.name not in hidden)

    @classmethod
    def common(cls) -> tuple[Setting, ...]:
        """Return the fields that many users change, which shells show first."""
        return tuple(item for item in cls.settings() if item.common)

    @classmethod
    def current(cls, values: dict[str, Any]) -> dict[str, Any]:
        """Return values by the names of today; those of before are taken with a warning."""
        found = {name: value for name, value in values.items() if name not in cls.RENAMED}
        for name in values.keys() - found.keys():
            warnings.warn(f'{name} is {cls.RENAMED[name]} now', DeprecationWarning, stacklevel=4)
            found[cls.RENAMED[name]] = values[name]
        return found

    @classmethod
    def given(cls, config: Self | None) -> Self:
        """Return a configuration as a caller hands it in; the defaults where that is None.

        Raises
        ------
        InputError
            Something else, such as a dict.
        """
        if config is None:
            return cls()
        if isinstance(config, cls):
            return config
        advice = f'; {cls.__name__}(**values) makes one of it' if isinstance(config, dict) else ''
        raise InputError(f'config: expected {cls.__name__}, got {type(config).__name__}{advice}')

    @classmethod
    def from_values(cls, values: dict[str, Any]) -> Self:
        """Build from a mapping, refusing names that are no fields.

        Raises
        ------
        InputError
            Unknown name, or a refused value.
        """
        values = cls.current(values)
        names = [item.name for item in cls.settings()]
        for name in values:
            if name not in names:
                raise InputError(f'{name}: no such setting; there are {", ".join(names)}')
        return cls(**values)

    def replace(self, **values: Any) -> Self:
        """Return a copy with some values changed and everything checked again."""
        return type(self).from_values({**dataclasses.asdict(self), **self.current(values)})


def _renamed_to(old: str, new: str) -> Callable[[Settings], Value]:
    def value(self: Settings) -> Value:
        warnings.warn(f'{old} is {new} now', DeprecationWarning, stacklevel=2)
        return cast(Value, getattr(self, new))
    return value


def renamed[Config: type[Settings]](**names: str) -> Callable[[Config], Config]:
    """Let a configuration take and tell fields by the names that they had before, old to new."""
    def decorate(cls: Config) -> Config:
        build: Any = cls.__init__

        @wraps(build)
        def init(self: Settings, *args: Any, **values: Any) -> None:
            build(self, *args, **cls.current(values))

        named: Any = cls
        named.RENAMED, named.__init__ = names, init
        for old, new in names.items():
            setattr(cls, old, property(_renamed_to(old, new)))
        return cls

    return decorate
