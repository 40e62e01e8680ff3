//! Sub-CPI processing in bounded buffers.
#![no_std]
#![forbid(unsafe_code)]
