"""The weight that an axis holds: its links, gear ratios between motors and links, how far it turns."""
