"""How compiled code runs: threads, lazy values, compiling and its cache, stopwatch."""
