"""How compiled code runs: threads, lazy values, compiling, SIMD, stopwatch."""
