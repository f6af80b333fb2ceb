"""What a specimen file may contain."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, StrictFloat, StrictInt, field_validator

SCHEMA = 1


class Parameter(BaseModel):
    """One number of a specimen as its source states it."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    value: StrictFloat | StrictInt | Annotated[list[StrictFloat | StrictInt], Field(min_length=1)]
    unit: str
    source: str = ""
    inferred: bool = False
    note: str = ""
    range: tuple[float, float] | None = None

    @field_validator("value")
    @classmethod
    def _finite(cls, value: float | list[float]) -> float | list[float]:
        import math

        if not all(math.isfinite(v) for v in (value if isinstance(value, list) else [value])):
            raise ValueError("allowed is a finite number")
        return value

    def si(self, unit: str, *, field: str, where: str | None = None) -> float | list[float]:
        """The value in an SI unit; raises `InputError` when the dimension is another."""
        from ..quantities import to_si

        if isinstance(self.value, list):
            return [to_si(v, self.unit, unit, field=field, where=where) for v in self.value]
        return to_si(self.value, self.unit, unit, field=field, where=where)


Group = dict[str, Parameter]


class Specimen(BaseModel):
    """A muscle or a valve as published: its dimensions, and the parameters of every law that was stated for it.

    A valve names the pneumatic element that it is, and states that element's parameters in the group `valve`.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    schema_version: Literal[1] = Field(alias="schema")
    id: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*$")
    kind: Literal["mckibben", "biological", "valve"]
    title: str
    sources: list[str]
    law: str = ""
    element: str = ""
    note: str = ""
    properties: Group = {}
    laws: dict[str, Group] = {}
    friction: dict[str, Group] = {}
    valve: Group = {}
    map: str | None = None
    where: str = ""

    def source(self) -> str:
        """The first source, as a citation key."""
        return self.sources[0]

    def inferred(self) -> list[str]:
        """Dotted paths of all numbers that no source prints; those of the default law first."""
        order = [self.law] * bool(self.law) + [name for name in self.laws if name != self.law]
        groups: dict[str, Group] = {"properties": self.properties}
        groups |= {f"laws.{name}": self.laws[name] for name in order}
        groups |= {f"friction.{name}": group for name, group in self.friction.items()}
        groups["valve"] = self.valve
        return [f"{path}.{name}" for path, group in groups.items() for name, p in group.items() if p.inferred]

    def property_si(self, name: str, unit: str) -> float:
        """A scalar property in an SI unit."""
        from ..errors import InputError

        if name not in self.properties:
            raise InputError(f"properties.{name}", "missing", "this step needs it", where=self.where or self.id)
        value = self.properties[name].si(unit, field=f"properties.{name}", where=self.where or self.id)
        assert isinstance(value, float)
        return value
