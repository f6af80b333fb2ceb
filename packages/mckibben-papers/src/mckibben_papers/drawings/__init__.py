"""What draws the figures of the papers, each module when one of its figures is asked for."""
