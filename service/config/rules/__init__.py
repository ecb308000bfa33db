"""Cross-checks of a configuration, once its schema holds: ``crosschecks`` runs those of the other files."""
