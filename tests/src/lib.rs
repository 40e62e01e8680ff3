//! Shared by the integration tests.

pub mod matlab;
pub mod subap;
