"""What to do: waveforms and protocols, as data."""
