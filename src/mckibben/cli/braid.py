"""``braid``: a muscle from the dimensions of its sleeve and bladder."""

from __future__ import annotations

import re
from typing import Annotated, Any

import typer

from .. import muscles
from .._version import __version__
from ..errors import InputError
from ..specimens import Specimen, SpecimenNumber, save_specimen
from ._outputs import OBJECT, SPECIMEN, OutputKinds, Paths
from ._terminal import Json, caution, print_json, table

OUT = OutputKinds(specimen=SPECIMEN, result=OBJECT)

# Dimension of a braid -> option that states it.
OPTIONS = {
    "rest_length": "--length", "diameter": "--diameter", "braid_angle": "--angle", "thread_diameter": "--thread",
    "bladder_thickness": "--bladder", "shore": "--shore",
}  # fmt: skip


def braid(
    length: Annotated[
        str,
        typer.Option(metavar="LENGTH", help="Length between the fittings without pressure and load, such as '300 mm'."),
    ],
    angle: Annotated[
        str,
        typer.Option(metavar="ANGLE", help="Angle of the threads from the long axis at that length, such as '25 deg'."),
    ],
    diameter: Annotated[
        str, typer.Option(metavar="SIZE", help="Outer diameter of the braid at that length, such as '12 mm'.")
    ],
    thread: Annotated[str, typer.Option(metavar="SIZE", help="Diameter of one thread, such as '0.25 mm'.")],
    bladder: Annotated[str, typer.Option(metavar="SIZE", help="Wall thickness of the bladder, such as '1 mm'.")],
    shore: Annotated[
        str | None,
        typer.Option(
            metavar="HARDNESS", help="Shore A hardness of the bladder, such as 40A; 45 with a wide range by default."
        ),
    ] = None,
    out: Annotated[Paths, OUT.option(note="Every other command takes the specimen.")] = None,
    as_json: Json = False,
) -> None:
    """Describe a muscle from the dimensions of its braid and bladder, with ranges for what is not known.

    $ mckibben braid --length '300 mm' --angle '25 deg' --diameter '12 mm' --thread '0.25 mm' --bladder '1 mm' --out my.toml
    """
    with OUT.files(out) as files:
        first = files.first("specimen")
        name = "braid" if first is None else re.sub(r"[^A-Za-z0-9._-]+", "-", first.stem).strip("-.") or "braid"
        spec = _described(
            name, rest_length=length, diameter=diameter, braid_angle=angle, thread_diameter=thread,
            bladder_thickness=bladder, shore=shore,
        )  # fmt: skip
        of_laws = muscles.sleeve.braid_caution(spec, spec.law)
        warnings = [*caution(muscles.sleeve.slenderness_caution(spec)), str(of_laws)]
        heading = f"computed by mckibben {__version__} from the dimensions of a braid; not measured"
        files.write("specimen", lambda path: save_specimen(spec, path, heading=heading))
        errors = {law: [error._asdict() for error in known] for law, known in muscles.sleeve.ERRORS.items()}
        content = {"specimen": spec.stated(), "errors": errors, "warnings": warnings}
        files.write_result(content)
        if as_json:
            print_json(content)
        else:
            _print(spec)
            typer.echo(f"\n{str(of_laws)[:1].upper()}{str(of_laws)[1:]}.")
            files.say()


def _described(name: str, **dimensions: Any) -> Specimen:
    """A specimen from dimensions; a complaint names the option."""
    try:
        return muscles.sleeve.from_braid(name=name, **dimensions)
    except InputError as error:
        raise error.changed(field=OPTIONS.get(error.field, error.field), where="") from None


def _print(spec: Specimen) -> None:
    groups = {f"laws.{spec.law}": spec.laws[spec.law], **{f"friction.{k}": g for k, g in spec.friction.items()}}
    rows = [
        [f"{path}.{key}", _amount(number), _interval(number), number.note]
        for path, group in groups.items()
        for key, number in group.items()
    ]
    table(spec.title, ["parameter", "value", "range", "from"], rows, right=[1])
    makes = [error.make for error in next(iter(muscles.sleeve.ERRORS.values()))]
    shares = [
        [law, *(f"{100 * e.rms:.0f} % rms, {100 * e.largest:.0f} %" for e in known)]
        for law, known in muscles.sleeve.ERRORS.items()
    ]
    typer.echo("")
    table("Errors on published muscles, of the largest tension: rms, largest", ["law", *makes], shares)


def _amount(number: SpecimenNumber) -> str:
    return f"{number.value:g}" if number.unit == "1" else f"{number.value:g} {number.unit}"


def _interval(number: SpecimenNumber) -> str:
    return "" if number.range is None else f"{number.range[0]:g} to {number.range[1]:g}"
