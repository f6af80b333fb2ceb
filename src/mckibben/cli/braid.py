"""``braid``: a muscle from the dimensions of its sleeve and bladder."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated

import typer

from .. import __version__, muscles
from ..errors import InputError
from ..specimens import SpecimenNumber, save_specimen
from ._terminal import Json, caution, print_json, table, writable

# Dimension of a braid -> option that states it.
OPTIONS = {
    "rest_length": "--length", "diameter": "--diameter", "braid_angle": "--angle", "thread_diameter": "--thread",
    "bladder_thickness": "--bladder", "shore": "--shore",
}  # fmt: skip


def braid(
    length: Annotated[
        str, typer.Option(help="Length between the fittings without pressure and load, such as '300 mm'.")
    ],
    angle: Annotated[
        str, typer.Option(help="Angle of the threads from the long axis at that length, such as '25 deg'.")
    ],
    diameter: Annotated[str, typer.Option(help="Outer diameter of the braid at that length, such as '12 mm'.")],
    thread: Annotated[str, typer.Option(help="Diameter of one thread, such as '0.25 mm'.")],
    bladder: Annotated[str, typer.Option(help="Wall thickness of the bladder, such as '1 mm'.")],
    shore: Annotated[
        str | None, typer.Option(help="Shore A hardness of the bladder, such as 40A; 45 with a wide range by default.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE.toml", help="Write the muscle as a specimen file for every other command."),
    ] = None,
    as_json: Json = False,
) -> None:
    """Describe a muscle from the dimensions of its braid and bladder, with ranges for what is not known."""
    writable("--out", out, ".toml")
    name = "braid" if out is None else re.sub(r"[^A-Za-z0-9._-]+", "-", out.stem).strip("-.") or "braid"
    try:
        spec = muscles.sleeve.from_braid(
            rest_length=length,
            diameter=diameter,
            braid_angle=angle,
            thread_diameter=thread,
            bladder_thickness=bladder,
            shore=shore,
            name=name,
        )
    except InputError as error:
        raise error.changed(field=OPTIONS.get(error.field, error.field), where="") from None
    warnings = caution(muscles.sleeve.slenderness_caution(spec))
    if out is not None:
        save_specimen(
            spec, out, heading=f"computed by mckibben {__version__} from the dimensions of a braid; not measured"
        )
    if as_json:
        errors = {law: [error._asdict() for error in known] for law, known in muscles.sleeve.ERRORS.items()}
        print_json({"specimen": spec.stated(), "errors": errors, "warnings": warnings})
        return
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
    typer.echo(f"\n{muscles.sleeve.TRUST}.")
    if out is not None:
        typer.echo(f"Written: {out}")


def _amount(number: SpecimenNumber) -> str:
    return f"{number.value:g}" if number.unit == "1" else f"{number.value:g} {number.unit}"


def _interval(number: SpecimenNumber) -> str:
    return "" if number.range is None else f"{number.range[0]:g} to {number.range[1]:g}"
