"""What commands share at the command line: options, exit codes, progress, signals, output files, frames to look at."""
