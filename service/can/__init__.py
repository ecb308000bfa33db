"""CAN: buses, readers, descriptions of messages, log files."""
