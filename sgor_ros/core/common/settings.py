"""What every configuration of this package is made of: one typed, bounded, documented field."""
import dataclasses
from dataclasses import dataclass
from dataclasses import field
import math
import re
from typing import Any
from typing import cast
from typing import Self

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
            maximum: float | None = None, choices: tuple[str, ...] = ()) -> Any:
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
    """
    metadata = {'meaning': meaning, 'unit': unit, 'minimum': minimum, 'maximum': maximum,
                'choices': choices}
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

    def __post_init__(self) -> None:
        for item in self.settings():
            object.__setattr__(self, item.name, item.check(getattr(self, item.name)))

    @classmethod
    def settings(cls) -> tuple[Setting, ...]:
        """Return the fields in their order, with defaults, units and bounds."""
        return tuple(Setting(f.name, cast(Value, f.default), **f.metadata)
                     for f in dataclasses.fields(cls))

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
        names = [item.name for item in cls.settings()]
        for name in values:
            if name not in names:
                raise InputError(f'{name}: no such setting; there are {", ".join(names)}')
        return cls(**values)

    def replace(self, **values: Any) -> Self:
        """Return a copy with some values changed and everything checked again."""
        return type(self).from_values({**dataclasses.asdict(self), **values})
