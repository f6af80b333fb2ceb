"""The machine of a recording, rebuilt from its resolved parameters: environment, gas, and muscles."""

from __future__ import annotations

from collections.abc import Mapping

from ..assembly.muscle_unit import MuscleUnit
from ..components import Environment
from ..documents import JsonValue
from ..errors import InputError
from ..muscles.build import construct
from ..muscles.elements import Tendon
from ..muscles.law import TensionLaw
from ..muscles.laws import LAWS, law_type
from ..pneumatics.gas import Gas
from ..quantities import declared
from ..recordings import Recording

PREFIXES = ("", "machine.")  # of the paths to a machine, where other things are written down beside it


class RecordedMachine:
    """The parameters of a recording by dotted path.

    Raises:
        InputError: if the recording has none.
    """

    def __init__(self, record: Recording) -> None:
        stated = record.meta.get("parameters")
        if not isinstance(stated, Mapping) or not stated:
            raise InputError("parameters", None, "must be in the recording: the resolved parameters of its machine")
        self._values = {k: v.get("value") if isinstance(v, Mapping) else v for k, v in stated.items()}
        room = record.meta.get("environment") or {}
        self.room = Environment(**{k: float(room[k]) for k in ("pressure_abs", "temperature") if k in room})
        self._laws: Mapping[str, str] = (record.meta.get("energy") or {}).get("laws", {})

    def find(self, path: str) -> JsonValue:
        """The value at a path [SI], None if it is not stated."""
        return next((self._values[p + path] for p in PREFIXES if p + path in self._values), None)

    def below(self, path: str) -> dict[str, JsonValue]:
        """The values of which the path begins with one, by the rest of their path."""
        for prefix in PREFIXES:
            whole = f"{prefix}{path}."
            values = {k.removeprefix(whole): v for k, v in self._values.items() if k.startswith(whole)}
            if values:
                return values
        return {}

    @property
    def gas(self) -> Gas:
        """Working gas."""
        return Gas(**self.below("circuit.gas"))

    def muscles(self) -> list[str]:
        """Their names."""
        return list(dict.fromkeys(path.split(".law.")[0] for path in self.below("units") if ".law." in path))

    def law(self, muscle: str) -> TensionLaw:
        """The tension law of a muscle.

        Raises:
            InputError: if the parameters are those of no law that is known.
        """
        parameters = self.below(f"units.{muscle}.law")
        names = (
            [self._laws[muscle]]
            if muscle in self._laws
            else [n for n in LAWS if set(declared(law_type(n))) == set(parameters)]
        )
        if len(names) != 1 or not parameters:
            raise InputError(
                f"law of {muscle}",
                ", ".join(parameters) or None,
                f"must be the parameters of {', '.join(LAWS)}",
                where="parameters",
            )
        known = {k: v for k, v in parameters.items() if v == v}  # an unknown volume is no number
        return construct(law_type(names[0]), known)

    def unit(self, muscle: str) -> MuscleUnit:
        """A muscle with its dampers, and its tendon if it has one; without friction, which the recording shows itself."""
        values = {k: v for k, v in self.below(f"units.{muscle}").items() if "." not in k}
        cord = self.below(f"units.{muscle}.tendon")
        return MuscleUnit(law=self.law(muscle), tendon=Tendon(**cord) if cord else None, **values)
