"""The command line: one file a command."""

INTERRUPTED = 130  # 128 + SIGINT, as shells count
