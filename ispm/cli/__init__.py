"""The command line: one file a command.

In come words; out go files, lines on stdout and exit codes. Nothing heavy is imported before a command
needs it.
"""
