"""Numbers from laws and recordings: characteristics, loops, energy, biology. Nothing here simulates."""
