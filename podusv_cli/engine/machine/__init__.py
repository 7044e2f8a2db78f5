"""A kernel in, a C function out: signatures, compilers, and compiled code on disk."""
