"""What a fit is worth: the verdict on it, what can be watched with it, the drive beside black boxes."""
