"""Every law becomes the simpler one it grew from, and equals its printed formula where it is exact.

The closed forms are written here a second time, in NumPy and with trigonometry, as the papers print them.
"""

import jax
import numpy as np
import pytest

from law_examples import example, examples
from mckibben.muscles import braid
from mckibben.muscles.build import build_law
from mckibben.muscles.law import TensionLaw
from mckibben.muscles.laws.hyperelastic_braid import real_ogden_density
from mckibben.pneumatics.volume import CompliantVolume

# The nylon muscle's braid, and pressures above the rounding of the threshold (half of 0.1 bar).
B, TURNS = 0.1642, 3.1485976
D0 = B / (TURNS * np.pi)
PRESSURE = np.linspace(0.2e5, 10e5, 25)
LENGTH = np.linspace(0.3, 0.99, 40)[:, None] * B
# Two ways to write the same formula differ by rounding: a few 1e-16 of each term, and terms are 10 times the sum.
ROUNDING = 1e-13

TENSION = jax.jit(lambda law, length, pressure: law.braid_tension(length, pressure))
VOLUME = jax.jit(lambda law, length, pressure: law.braid_volume(length, pressure))


def tension(law: TensionLaw, length: np.ndarray, pressure: np.ndarray) -> np.ndarray:
    """Signed, so that the comparison includes lengths at which the muscle would be slack."""
    return np.asarray(TENSION(law, *np.broadcast_arrays(length, pressure)))


def assert_same(ours: np.ndarray, theirs: np.ndarray, share: float = ROUNDING) -> None:
    assert ours.shape == theirs.shape
    largest = np.abs(theirs).max()
    assert largest > 0.0
    assert np.abs(ours - theirs).max() <= share * largest, np.abs(ours - theirs).max() / largest


def ideal_in_print(length: np.ndarray, pressure: np.ndarray) -> np.ndarray:
    """Eq. 8b, with the angle."""
    theta = np.arccos(length / B)
    return 0.25 * np.pi * D0**2 * pressure * (3.0 * np.cos(theta) ** 2 - 1.0)


def thick_in_print(length: np.ndarray, pressure: np.ndarray, tk: float) -> np.ndarray:
    """Eq. 10, with the angle."""
    s = np.sin(np.arccos(length / B))
    return ideal_in_print(length, pressure) + np.pi * pressure * (D0 * tk * (2.0 * s - 1.0 / s) - tk**2)


def ideal() -> TensionLaw:
    return build_law("ideal", {"thread_length": B, "turns": TURNS})


def thick(tk: float, upper: float = 0.99) -> TensionLaw:
    return build_law(
        "thick_wall", {"thread_length": B, "turns": TURNS, "wall_thickness": tk, "upper_length": upper * B}
    )


def test_the_ideal_law_is_eq_8() -> None:
    assert_same(tension(ideal(), LENGTH, PRESSURE), ideal_in_print(LENGTH, PRESSURE))
    by_thread = PRESSURE * B**2 * (3.0 * (LENGTH / B) ** 2 - 1.0) / (4.0 * np.pi * TURNS**2)  # eq. 8a
    assert_same(tension(ideal(), LENGTH, PRESSURE), by_thread)


def test_the_tension_of_the_ideal_law_vanishes_at_54_7_degrees() -> None:
    neutral = B * np.cos(np.radians(54.735610317245346))
    assert abs(tension(ideal(), neutral, 5e5)) <= ROUNDING * tension(ideal(), B * 0.99, 5e5)
    # 60 halvings and one Newton step reach the last bit.
    assert float(ideal().free_length(5e5)) == pytest.approx(neutral, rel=1e-14)
    assert tension(ideal(), neutral * 1.001, 5e5) > 0.0 > tension(ideal(), neutral * 0.999, 5e5)


def test_the_thick_wall_law_is_eq_10() -> None:
    tk = 7.62e-4
    length = np.linspace(0.3, 0.94, 40)[:, None] * B
    assert_same(tension(thick(tk, 0.95), length, PRESSURE), thick_in_print(length, PRESSURE, tk))


def test_the_thick_wall_law_is_eq_10_at_the_upper_working_length_itself() -> None:
    # There the rounding of the bladder ends, and fits put the longest measured length exactly there.
    tk = 7.62e-4
    for upper in np.linspace(0.80, 0.94, 15):
        length = np.array([[upper * B]])
        assert_same(tension(thick(tk, upper), length, PRESSURE), thick_in_print(length, PRESSURE, tk))


def test_the_volume_of_the_thick_wall_law_is_eq_9() -> None:
    tk, length = 7.62e-4, np.linspace(0.3, 0.94, 40)[:, None] * B
    bore = D0 * np.sin(np.arccos(length / B)) - 2.0 * tk
    volume = np.asarray(VOLUME(thick(tk, 0.94), *np.broadcast_arrays(length, PRESSURE)))
    assert_same(volume, np.broadcast_to(0.25 * np.pi * bore**2 * length, volume.shape))


def test_a_thin_wall_tends_to_the_ideal_law_at_order_one() -> None:
    length = LENGTH[LENGTH[:, 0] < 0.95 * B]
    there = tension(ideal(), length, PRESSURE)
    off = [np.abs(tension(thick(tk), length, PRESSURE) - there).max() for tk in (4e-5, 2e-5, 1e-5)]
    # By eq. 10 the difference is a tk + b tk^2 with b tk/a below 0.2 % at 40 um: halving tk halves it within that.
    assert off[0] / off[1] == pytest.approx(2.0, rel=5e-3)
    assert off[1] / off[2] == pytest.approx(2.0, rel=5e-3)
    assert_same(tension(thick(0.0), length, PRESSURE), there)


def test_tondu_lopez_with_k_one_is_the_ideal_law() -> None:
    theta = 0.45
    rest = B * np.cos(theta)
    law = build_law(
        "tondu_lopez",
        {"rest_length": rest, "rest_radius": 0.5 * D0 * np.sin(theta), "rest_angle": theta, "upper_length": 0.95 * B},
    )
    # With a longer upper length the law keeps more gas than its formula, for what its threads squeeze out beyond.
    length = LENGTH[LENGTH[:, 0] < 0.95 * B]
    assert_same(tension(law, length, PRESSURE), ideal_in_print(length, PRESSURE))
    volume = np.asarray(VOLUME(law, *np.broadcast_arrays(length, PRESSURE)))
    assert_same(volume, np.asarray(VOLUME(ideal(), *np.broadcast_arrays(length, PRESSURE))))


def test_tondu_lopez_is_its_printed_formula() -> None:
    law = example("tondu_lopez").replace(
        rest_length=0.3, upper_length=0.3, rest_radius=0.01, rest_angle=0.45, end_factor=1.2, end_factor_gain=0.0
    )
    length = np.linspace(0.7, 1.0, 40)[:, None] * 0.3
    a, c = 3.0 / np.tan(0.45) ** 2, 1.0 / np.sin(0.45) ** 2
    printed = np.pi * 0.01**2 * PRESSURE * (a * (1.0 - 1.2 * (1.0 - length / 0.3)) ** 2 - c)
    assert_same(tension(law, length, PRESSURE), printed)


def test_sarosi_is_its_printed_formula() -> None:
    """F = (a1 P' + a2) exp(a3 eps) + a4 P' eps + a5 P' + a6."""
    law, length = example("sarosi"), np.linspace(0.7, 1.0, 40)[:, None] * 0.3
    eps = 1.0 - length / 0.3
    printed = (4e-5 * PRESSURE + 220.0) * np.exp(-33.0 * eps) - 6.7e-3 * PRESSURE * eps + 1.8e-3 * PRESSURE - 150.0
    assert_same(tension(law, length, PRESSURE), printed)


class TestLinearWithThreshold:
    """Eqs. 12a, 12b, 13 and 38b with the printed numbers of the nylon muscle, in cm, bar and N."""

    KG, LMIN, PTH, KP, L0, V0 = 0.466, 9.91, 0.903, 3.92, 14.0, 5.63
    HALF_WIDTH = 0.425  # bar
    L = np.linspace(9.0, 15.4, 33)[:, None]  # cm, up to the upper working length

    def test_above_the_threshold_it_is_eq_12a(self) -> None:
        P = np.linspace(self.PTH + self.HALF_WIDTH, 8.0, 20)
        # 1 cm bar of Kg P' is 10 N: 0.466 cm x 1 bar = 4.66 N/cm.
        printed = 10.0 * self.KG * (P - self.PTH) * (self.L - self.LMIN) + self.KP * (self.L - self.L0)
        assert_same(self.ours(P), printed)

    def test_below_the_threshold_it_is_eq_12b(self) -> None:
        P = np.linspace(-0.95, self.PTH - self.HALF_WIDTH, 20)
        assert_same(self.ours(P), self.KP * (self.L - self.L0) + 0.0 * P)

    def test_above_the_threshold_it_is_eq_13(self) -> None:
        P = np.linspace(self.PTH + self.HALF_WIDTH, 8.0, 20)
        law = self.law()
        offset, force = float(law.offset_pressure) / 1e5, float(law.offset_tension)
        assert_same(self.ours(P), 10.0 * self.KG * (P - offset) * (self.L - self.LMIN) + force)
        assert (offset, force) == (pytest.approx(0.062, abs=1e-3), pytest.approx(-16.0, abs=0.05))  # as printed

    def test_above_the_threshold_the_volume_is_eq_38b(self) -> None:
        P = np.linspace(self.PTH + self.HALF_WIDTH, 8.0, 20)
        printed = self.V0 - 5.0 * self.KG * 0.1 * ((self.L - self.LMIN) ** 2 - (self.L0 - self.LMIN) ** 2)  # cm3
        ours = np.asarray(VOLUME(self.law(), *np.broadcast_arrays(self.L * 1e-2, P * 1e5))) * 1e6
        assert_same(ours, np.broadcast_to(printed, ours.shape))

    def test_between_them_it_is_monotonic(self) -> None:
        P = np.linspace(self.PTH - self.HALF_WIDTH, self.PTH + self.HALF_WIDTH, 50)
        rise = np.diff(self.ours(P)[self.L[:, 0] > self.LMIN], axis=1)
        assert (rise >= 0.0).all()

    def law(self) -> TensionLaw:
        return examples()["linear_threshold nylon"]

    def ours(self, P: np.ndarray) -> np.ndarray:
        return tension(self.law(), self.L * 1e-2, P * 1e5)


def test_the_gas_spring_is_the_linear_law_without_threshold_and_passive_part() -> None:
    spring = examples()["gas_spring nylon"]
    shared = {name: getattr(spring, name) for name in ("stiffness_per_pressure", "shortest_length", "rest_length")}
    linear = examples()["linear_threshold nylon"].replace(
        **shared, threshold_pressure=0.0, passive_stiffness=0.0, stop_stiffness=0.0, threshold_width=1e4
    )
    length, pressure = np.linspace(0.05, 0.2, 40)[:, None], np.linspace(-0.95e5, 10e5, 60)
    assert_same(tension(spring, length, pressure), tension(linear, length, pressure))
    # and eq. 11 above the rounding, up to the upper working length
    length = np.linspace(0.05, 0.154, 40)[:, None]
    assert_same(tension(spring, length, PRESSURE), 4.66e-3 * PRESSURE * (length - 0.0991))


class TestBraid:
    """Eqs. 5-7: one right triangle, unrolled."""

    L = np.linspace(0.01, 0.999, 50) * B

    def test_angle_and_length_are_inverse(self) -> None:
        theta = np.asarray(braid.angle(self.L, thread_length=B))
        assert_same(np.asarray(braid.length_at(theta, thread_length=B)), self.L)

    def test_thread_length_and_turns_make_a_right_triangle(self) -> None:
        around = TURNS * np.pi * np.asarray(braid.diameter(self.L, thread_length=B, turns=TURNS))
        assert_same(around**2 + self.L**2, np.full_like(self.L, B**2))
        assert_same(around / B, np.sin(np.asarray(braid.angle(self.L, thread_length=B))), 1e-12)  # arccos near 0

    def test_volume_is_that_of_the_cylinder(self) -> None:
        D = np.asarray(braid.diameter(self.L, thread_length=B, turns=TURNS))
        V = np.asarray(braid.volume(self.L, thread_length=B, turns=TURNS))
        assert_same(V, 0.25 * np.pi * D**2 * self.L)
        theta = np.asarray(braid.angle(self.L, thread_length=B))
        assert_same(V, B**3 * np.sin(theta) ** 2 * np.cos(theta) / (4.0 * np.pi * TURNS**2), 1e-12)

    def test_a_wall_of_no_thickness_takes_no_volume(self) -> None:
        V = np.asarray(braid.volume(self.L, thread_length=B, turns=TURNS))
        inner = np.asarray(braid.inner_volume(self.L, thread_length=B, turns=TURNS, wall_thickness=0.0))
        assert_same(inner, V)

    def test_volume_is_largest_at_54_7_degrees(self) -> None:
        V = np.asarray(braid.volume(self.L, thread_length=B, turns=TURNS))
        assert abs(self.L[V.argmax()] - B / np.sqrt(3.0)) < self.L[1] - self.L[0]


def hyperelastic(**changes: float) -> TensionLaw:
    given = {
        "rest_length": 0.3, "rest_diameter": 0.02, "wall_thickness": 1.8e-3, "thread_depth": 0.0, "rest_angle": 0.48,
        "shear_modulus": 1e6, "thread_compliance": 0.0, "inactive_share": 0.0, "upper_length": 0.3,
    }  # fmt: skip
    return build_law("hyperelastic_braid", given | changes)


def test_the_hyperelastic_braid_without_rubber_is_the_ideal_braid() -> None:
    length = np.linspace(0.65, 1.0, 30)[:, None] * 0.3
    # The wall's force is proportional to its modulus, so two moduli give the force without any wall exactly.
    soft, stiff = (tension(hyperelastic(shear_modulus=mu), length, PRESSURE) for mu in (1e5, 2e5))
    law = build_law("ideal", {"thread_length": 0.3 / np.cos(0.48), "turns": 0.3 * np.tan(0.48) / (np.pi * 0.02)})
    assert_same(2.0 * soft - stiff, tension(law, length, PRESSURE))
    # and a softer wall comes nearer, at order one
    there = tension(law, length, PRESSURE)
    assert np.abs(stiff - there).max() == pytest.approx(2.0 * np.abs(soft - there).max(), rel=1e-9)


def test_the_seated_braid_is_a_neo_hookean_braid_that_is_shorter_by_its_seats() -> None:
    shape = {"rest_length": 0.182, "rest_diameter": 0.01, "wall_thickness": 1.8e-3, "rest_angle": 0.42}
    shape |= {"shear_modulus": 1.1e6, "upper_length": 0.182}
    from mckibben.muscles.laws.hyperelastic_braid import HyperelasticBraid

    bare = HyperelasticBraid(**shape, thread_depth=0.0, thread_compliance=0.0, inactive_share=0.0, ogden_exponent=2)
    length, pressure = np.linspace(0.8, 1.0, 21)[:, None] * 0.182, np.linspace(0.5e5, 7e5, 20)
    there = tension(bare, length, pressure)
    off = []
    for q in (4e-4, 2e-7, 1e-7):
        ours = tension(build_law("seated_braid", shape | {"seat_compliance": q}), length, pressure)
        seats = q * np.sqrt(np.maximum(ours, 0.0))
        pulls = ours > 0.0
        assert pulls.any()
        # u = q sqrt(F), the equation that the five inner steps solve: they leave 1e-9 of the largest force, at a
        # compliance of ten times what was measured.
        assert np.abs(tension(bare, length - seats, pressure) - ours)[pulls].max() <= 1e-9 * ours.max()
        off.append(np.abs(ours - there).max())
    # Vanishing seats leave the bare braid, at order one: the second-order term is about 1e-3 of the first at these q,
    # and q sqrt(F) dF/dL = 1e-7 x 22 x 4e4 = 0.1 N of 496 N remain at the smallest q allowed.
    assert off[1] / off[2] == pytest.approx(2.0, rel=1e-2)
    assert off[2] < 1e-3 * there.max()


SHAPE = {
    "rest_length": 0.25, "rest_diameter": 0.01, "wall_thickness": 1.8e-3, "rest_angle": 0.45, "shear_modulus": 2e6,
    "upper_length": 0.25,
}  # fmt: skip


@pytest.mark.slow  # a quarter of a minute of compilation
def test_the_seated_hyperelastic_braid_becomes_either_law_of_which_it_is_made() -> None:
    length, pressure = np.linspace(0.8, 1.0, 9)[:, None] * 0.25, np.linspace(0.5e5, 7e5, 8)
    plain = {"thread_depth": 0.0, "thread_compliance": 0.0, "inactive_share": 0.0}
    ours = build_law("seated_hyperelastic_braid", SHAPE | plain | {"ogden_exponent": 2.0, "seat_compliance": 1.2e-4})
    seated = build_law("seated_braid", SHAPE | {"seat_compliance": 1.2e-4})
    assert_same(tension(ours, length, pressure), tension(seated, length, pressure))
    wall = {"thread_depth": 0.8, "thread_compliance": 4e-9, "inactive_share": 0.6}
    there = tension(build_law("hyperelastic_braid", SHAPE | wall), length, pressure)
    off = []
    for q in (2e-7, 1e-7):
        bare = ours.replace(**wall, ogden_exponent=-4.0, seat_compliance=q)
        off.append(np.abs(tension(bare, length, pressure) - there).max())
    # Vanishing seats: at order one, up to 1e-3 of it; q sqrt(F) dF/dL = 1e-7 x 23 x 4e4 = 0.1 N remain at the smallest q.
    assert off[0] / off[1] == pytest.approx(2.0, rel=1e-2)
    assert off[1] < 5e-4 * there.max()


def test_a_real_ogden_exponent_gives_the_energy_of_the_whole_number_and_passes_through_zero() -> None:
    axial, hoop = np.linspace(0.6, 1.05, 7)[:, None] ** 2, np.linspace(0.8, 1.6, 6) ** 2
    for alpha in (-4, 2, 6):
        half = alpha // 2
        whole = 0.5e6 / half**2 * (axial**half + hoop**half + (axial * hoop) ** (-half) - 3.0)
        # 1e6 Pa times rounding of the sum of three powers up to 30
        np.testing.assert_allclose(real_ogden_density(axial, hoop, 1e6, float(alpha)), whole, rtol=0, atol=1e-7)
    # at zero the energy is quadratic in the logarithms of the stretches; 1e-3 away it differs by a third-order term
    logs = np.log(axial), np.log(hoop)
    hencky = 0.25e6 * (logs[0] ** 2 + logs[1] ** 2 + (logs[0] + logs[1]) ** 2)
    np.testing.assert_allclose(real_ogden_density(axial, hoop, 1e6, 0.0), hencky, rtol=2e-3)


@pytest.mark.parametrize("angle", [0.0, 0.4, 1.2, 1.6, 3.0])
def test_a_muscle_sweeps_less_the_shorter_it_is_until_it_sweeps_nothing(angle):
    share, swept = 0.8, 2e-5
    volume = CompliantVolume(volume=4e-5, compliance=1e-11, swept=swept, saturation=share)
    state = volume.volume_state(3e5, angle, 2.0)
    plane = CompliantVolume(volume=4e-5, compliance=1e-11, swept=swept).volume_state(3e5, angle, 2.0)
    reach = min(angle, 1.0 / share)
    # the same polynomial in another order: rounding
    assert float(plane.value - state.value) == pytest.approx(
        swept * (angle - reach + 0.5 * share * reach**2), abs=1e-18
    )
    slope = jax.grad(lambda x: volume.volume_state(3e5, x, 0.0).value)(angle)
    assert float(state.moving) == pytest.approx(2.0 * float(slope), rel=1e-12, abs=1e-18)
    assert float(state.per_pressure) == 1e-11


def test_an_end_factor_is_never_below_a_twentieth_whatever_the_pressure() -> None:
    law = example("tondu_lopez").replace(end_factor=0.5, end_factor_gain=-0.5, end_factor_pressure=1e5)
    factor = np.array([float(law.end_factor_at(p)) for p in (-1e5, 0.0, 1e3, 1e5, 3e5)])
    assert factor[:3].tolist() == [0.05, 0.05, 0.05]  # 0.5 - 0.5 exp(-0.01) is a tenth of that
    # two roundings of an exponential
    assert factor[3:] == pytest.approx([0.5 - 0.5 * np.exp(-1.0), 0.5 - 0.5 * np.exp(-3.0)], rel=1e-14)
