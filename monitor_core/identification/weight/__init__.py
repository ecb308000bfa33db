"""The weight that an axis bears: its links, gear ratios between motors and links, its turn with the motion."""
