"""Kernels for runs side by side: one function, `object_code.object_code`, is what others call."""
