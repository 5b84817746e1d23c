"""As much of pydantic as the check needs: JSON to classes and back, unknown and missing keys refused."""

import json
import types
import typing

HINTS: dict[typing.Any, dict[str, typing.Any]] = {}  # types of fields, by class


class ValidationError(ValueError):
    """JSON that is not what a class says."""

    def errors(self) -> list[dict[str, typing.Any]]:
        """Return what is wrong."""
        return [{"loc": self.args[1:], "msg": self.args[0]}]


class BaseModel:
    """Fields by annotation, defaults as class attributes."""

    def __init__(self, **values: typing.Any) -> None:
        for name in _hints(type(self)):
            if name == "model_config":
                continue
            if name not in values and not hasattr(type(self), name):
                raise ValidationError("Field required", name)
            setattr(self, name, values.pop(name, getattr(type(self), name, None)))
        for name in values:
            raise ValidationError("Extra inputs are not permitted", name)

    @classmethod
    def model_validate(cls, content: typing.Any) -> typing.Any:
        """Return an instance of what JSON holds."""
        if not isinstance(content, dict):
            raise ValidationError("Input should be an object")
        hints = _hints(cls)
        return cls(**{name: _from_json(hints.get(name, typing.Any), one, name) for name, one in content.items()})

    @classmethod
    def model_validate_json(cls, text: bytes) -> typing.Any:
        """Return an instance of a file's text."""
        try:
            return cls.model_validate(json.loads(text))
        except (json.JSONDecodeError, UnicodeDecodeError) as error:
            raise ValidationError(f"Invalid JSON: {error}") from error

    def model_copy(self, update: typing.Any) -> typing.Any:
        """Return a copy with other values of some fields."""
        return type(self)(**{**vars(self), **update})

    def model_dump(self, **_: typing.Any) -> dict[str, typing.Any]:
        """Return what differs from the defaults, as JSON has it."""
        return {name: _to_json(one) for name, one in vars(self).items()
                if not hasattr(type(self), name) or getattr(type(self), name) != one}


def _hints(cls: typing.Any) -> dict[str, typing.Any]:
    if cls not in HINTS:
        HINTS[cls] = typing.get_type_hints(cls)
    return HINTS[cls]


def _to_json(value: typing.Any) -> typing.Any:
    if isinstance(value, BaseModel):
        return value.model_dump()
    return [_to_json(one) for one in value] if isinstance(value, tuple) else value


def _from_json(hint: typing.Any, value: typing.Any, name: str) -> typing.Any:
    """Return a value of JSON as a field has it."""
    kind, inner = typing.get_origin(hint), typing.get_args(hint)
    if hint is typing.Any:
        return value
    if kind in (types.UnionType, typing.Union):
        return None if value is None else _from_json(inner[0], value, name)
    if kind is typing.Literal and value in inner:
        return value
    if kind is tuple and isinstance(value, list) and (inner[-1] is ... or len(inner) == len(value)):
        hints = [inner[0]] * len(value) if inner[-1] is ... else inner
        return tuple(_from_json(one, part, name) for one, part in zip(hints, value, strict=True))
    if kind is dict and isinstance(value, dict):
        return {key: _from_json(inner[1], one, name) for key, one in value.items()}
    if kind is None and issubclass(hint, BaseModel):
        return hint.model_validate(value)
    if kind is None and isinstance(value, (int, float) if hint is float else hint):
        return float(value) if hint is float else value
    raise ValidationError(f"Input should be {hint}", name)
