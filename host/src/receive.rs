//! From echoes to phase history: what a receiver's samples need before any image former can use them.
