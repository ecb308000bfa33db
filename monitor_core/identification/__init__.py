"""Off-line identification: from records to nominal parameters with their uncertainty (paper, sections 4 and 6.1)."""
