"""What is printed about biological muscle: Gordon's polygon, Hill's hyperbola, and the row of Chou and Hannaford."""

import math
import tomllib
from importlib import resources

import jax
import numpy as np
import pytest
from scipy.integrate import quad

from mckibben.analysis import characteristics
from mckibben.components import derivative
from mckibben.errors import InputError
from mckibben.muscles.biological import BiologicalMuscle, active_curve, passive_curve, velocity_curve
from mckibben.quantities import declared, from_si, to_si

INTENSITY = to_si(35.0, "N/cm^2", "N/m^2", field="tension intensity")
MUSCLE = BiologicalMuscle(
    rest_length=0.14, section_area=0.95e-4, maximum_tension_intensity=INTENSITY, maximum_velocity=20.0
)


# ---- Gordon, Huxley and Julian 1966


@pytest.mark.parametrize(
    ("sarcomere", "tension"), [(1.27, 0.0), (1.67, 0.84), (2.0, 1.0), (2.1, 1.0), (2.25, 1.0), (3.65, 0.0)]
)
def test_polygon_passes_through_the_nodes(sarcomere, tension):
    # Sarcomere lengths in um over the optimal 2.00 um; two divisions and a product of rounding.
    assert float(active_curve(sarcomere / 2.0)) == pytest.approx(tension, abs=1e-14)


@pytest.mark.parametrize(("low", "high"), [(1.27, 1.67), (1.67, 2.0), (2.0, 2.25), (2.25, 3.65)])
def test_polygon_is_straight_between_the_nodes(low, high):
    ends = active_curve(np.array([low, high]) / 2.0)
    third = float(active_curve((2.0 * low + high) / 6.0))
    assert third == pytest.approx(float(2.0 * ends[0] + ends[1]) / 3.0, abs=1e-14)


def test_polygon_is_between_zero_and_one_and_exactly_zero_outside():
    lengths = np.linspace(0.0, 3.0, 3001)
    tension = np.asarray(active_curve(lengths))
    assert tension.min() == 0.0 and tension.max() == 1.0
    assert not tension[(lengths < 0.635) | (lengths > 1.825)].any()


def test_polygon_follows_a_knee_that_hangs_below_the_chord():
    # A convex ascending limb is as good an input as Gordon's concave one.
    at = active_curve(np.array([0.635, 0.9, 1.0]), knee=0.9, knee_tension=0.2)
    np.testing.assert_allclose(at, [0.0, 0.2, 1.0], atol=1e-14)


# ---- the passive curve


def test_passive_tension_has_increasing_stiffness_beyond_a_length():
    lengths = np.linspace(0.0, 3.0, 301)
    stiffness = np.asarray(derivative(passive_curve, lengths))
    assert not np.asarray(passive_curve(lengths))[lengths <= 1.0].any()
    assert (np.diff(stiffness[lengths >= 1.0]) > 0.0).all()
    # (1.6 - 1)/0.6 is 1 to a last bit, to the fourth power.
    assert float(passive_curve(1.6)) == pytest.approx(1.0, abs=1e-14)


def test_passive_tension_stays_near_the_exponential_of_thelen():
    lengths = np.linspace(1.0, 1.6, 601)
    exponential = np.expm1(5.0 * (lengths - 1.0) / 0.6) / math.expm1(5.0)
    # 0.06 is what the docstring states; 0.054 measured.
    assert np.abs(np.asarray(passive_curve(lengths)) - exponential).max() < 0.06


def test_total_tension_has_a_local_maximum():
    lengths = np.linspace(1.13, 1.6, 200)
    total = np.asarray(MUSCLE.tension(lengths * 0.14, 1.0))
    assert 0 < np.argmin(total) < 199


# ---- Hill 1938


def test_isometric_limit_and_the_end_at_vmax():
    assert float(velocity_curve(0.0)) == 1.0
    assert not np.asarray(velocity_curve(np.array([-1.0, -1.001, -50.0]))).any()


def test_shortening_follows_the_hyperbola_of_hill():
    # (F + a)(u + b) = (1 + a) b with b = a vmax: Hill's own form, last bits.
    u = np.linspace(0.0, 1.0, 101)
    np.testing.assert_allclose((np.asarray(velocity_curve(-u)) + 0.25) * (u + 0.25), 1.25 * 0.25, rtol=1e-14)


@pytest.mark.parametrize("curvature", [0.05, 0.25, 1.0, 4.0])
@pytest.mark.parametrize("plateau", [1.05, 1.4, 1.8])
def test_slope_is_continuous_where_shortening_becomes_lengthening(curvature, plateau):
    def curve(v):
        return velocity_curve(v, curvature=curvature, lengthening_tension=plateau)

    expected = 1.0 + 1.0 / curvature
    at, left, right = (float(jax.grad(curve)(v)) for v in (0.0, -1e-9, 1e-9))
    # 1e-9 away the slope has moved by its curvature times 1e-9, at most 2 (1 + 1/c)^2 / (m - 1) = 2e4 of it.
    assert at == pytest.approx(expected, rel=1e-14)
    assert left == pytest.approx(expected, rel=1e-4)
    assert right == pytest.approx(expected, rel=1e-4)


def test_tension_grows_with_velocity_up_to_a_plateau():
    v = np.linspace(-1.0, 50.0, 5101)
    tension = np.asarray(velocity_curve(v))
    assert (np.diff(tension) > 0.0).all()
    # A hyperbola of scale 0.08: 0.4 * 0.08/50 below its plateau at 50 vmax.
    assert tension[-1] == pytest.approx(1.4, abs=1e-3)
    assert float(velocity_curve(1e300)) == pytest.approx(1.4)


@pytest.mark.parametrize("curvature", [0.1, 0.25, 0.5])
def test_peak_power_is_where_calculus_puts_it(curvature):
    found = characteristics.peak_power(lambda v: velocity_curve(v, curvature=curvature))
    u = curvature * (math.sqrt(1.0 + 1.0 / curvature) - 1.0)
    # A search by values finds the place to the root of the rounding, 1e-8, and the height to rounding.
    assert found.relative_velocity == pytest.approx(u, abs=1e-6)
    assert found.fraction == pytest.approx(u * u, abs=1e-13)


def test_peak_power_is_about_a_tenth():
    # McMahon 1984: about 0.1 Fmax vmax; 0.0955 with a/F0 = 0.25, which rounds to 0.1.
    assert round(characteristics.peak_power(MUSCLE.velocity_curve).fraction, 1) == 0.1


# ---- the row of Table 1 in Chou and Hannaford 1996


def test_dynamic_range_is_found_from_the_curve():
    found = characteristics.dynamic_range(MUSCLE.active_curve)
    # The search ends within 3/1000^5 of a kink.
    assert found.shortest == pytest.approx(1.27 / 2.0, abs=1e-12)
    assert found.longest == pytest.approx(2.25 / 2.0, abs=1e-12)
    assert found.rounded() == (0.64, 1.12)
    assert round(found.rounded().width, 2) == 0.48


def test_dynamic_range_follows_the_curve_and_not_the_paper():
    other = MUSCLE.replace(shortest_active_length=0.5, plateau_end=1.0)
    found = characteristics.dynamic_range(other.active_curve)
    assert found == pytest.approx((0.5, 1.0), abs=1e-12)
    # A smooth peak: its top is where the slope, flat to 1e-9 of the steepest, vanishes.
    parabola = characteristics.dynamic_range(lambda x: 1.0 - ((x - 1.3) / 0.5) ** 2)
    assert parabola == pytest.approx((0.8, 1.3), abs=1e-8)
    # The scale of the curve, and so its unit, does not matter.
    assert characteristics.dynamic_range(lambda x: 33.0 * other.active_curve(x)) == pytest.approx((0.5, 1.0), abs=1e-12)


def test_a_curve_without_tension_has_no_dynamic_range():
    with pytest.raises(InputError, match="a tension above 0 N"):
        characteristics.dynamic_range(lambda x: 0.0 * x)


def test_stiffness_intensity_is_73_with_the_printed_ends_and_71_with_the_nodes():
    found = characteristics.dynamic_range(MUSCLE.active_curve)
    printed, exact = (
        from_si(characteristics.stiffness_intensity(INTENSITY, r), "N/m^2", "N/cm^2") for r in (found.rounded(), found)
    )
    assert round(printed) == 73
    assert round(exact) == 71


def test_work_density_is_0_13_joules_per_cubic_centimetre():
    work = characteristics.work_density(MUSCLE.active_curve, INTENSITY)
    independent = quad(lambda x: float(active_curve(x)), 0.635, 1.125, points=[0.835, 1.0])[0] * INTENSITY
    # Trapezoids across kinks: an error of slope jump times h^2 / 8, 1e-9 of the result.
    assert work == pytest.approx(independent, rel=1e-8)
    # By hand: triangle, trapezoid, rectangle.
    assert work == pytest.approx(INTENSITY * (0.5 * 0.2 * 0.84 + 0.165 * 0.92 + 0.125), rel=1e-8)
    in_print = from_si(work, "J/m^3", "J/cm^3")
    assert round(in_print, 2) == 0.13 and round(in_print, 3) == 0.126


def test_peak_power_density_is_0_7_watts_per_cubic_centimetre():
    as_printed = from_si(characteristics.peak_power_density(MUSCLE, fraction=0.1), "W/m^3", "W/cm^3")
    from_the_curve = from_si(characteristics.peak_power_density(MUSCLE), "W/m^3", "W/cm^3")
    assert as_printed == pytest.approx(0.70, rel=1e-12)
    assert round(from_the_curve, 1) == 0.7


def test_comparison_gathers_the_same_numbers():
    row = characteristics.comparison(MUSCLE)
    assert row.stiffness_intensity == characteristics.stiffness_intensity(INTENSITY, row.dynamic_range)
    assert row.work_density == characteristics.work_density(MUSCLE.active_curve, INTENSITY)
    assert row.peak_power_density == characteristics.peak_power_density(MUSCLE)
    assert (row.tension_intensity, row.maximum_velocity) == (INTENSITY, 20.0)


# ---- the two reference specimens


@pytest.mark.parametrize(("name", "velocity"), [("slow-fibre", 2.0), ("fast-fibre", 8.0)])
def test_specimen_states_every_parameter_with_its_source(name, velocity):
    data = tomllib.loads((resources.files("mckibben.specimens") / "data" / f"{name}.toml").read_text(encoding="utf-8"))
    group, known = data["laws"]["biological"], declared(BiologicalMuscle)
    assert (data["id"], data["kind"], data["law"]) == (name, "biological", "biological")
    assert set(group) == set(known)
    assert {entry["source"] for entry in group.values()} <= set(data["sources"])
    muscle = BiologicalMuscle(**{k: to_si(p["value"], p["unit"], known[k].unit, field=k) for k, p in group.items()})
    assert float(muscle.maximum_velocity) == velocity
    # The files print three decimals; so do Gordon's nodes over 2.00 um, exactly.
    np.testing.assert_allclose(
        muscle.active_curve(np.linspace(0, 3, 301)), active_curve(np.linspace(0, 3, 301)), atol=1e-14
    )
    assert characteristics.dynamic_range(muscle.active_curve).rounded() == (0.64, 1.12)
