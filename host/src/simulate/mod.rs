//! Simulated phase history.
