//! NumPy arrays of complex64, read and written.
