"""A sensor as another package declares it: the temperature of the gas in the muscle."""

from mckibben.bench.sensors import SensorKind

GAS_TEMPERATURE = SensorKind(
    unit="K", quantity="temperature", label="temperature, gas", symbol="T", meaning="temperature of the gas, measured",
    true_value=lambda plant, *at: plant.machine.outputs(*at)["muscle.temperature"],
)  # fmt: skip
