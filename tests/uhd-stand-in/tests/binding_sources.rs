//! The binding's sources with their unit tests, which need its feature: the library's own tests with this feature would build all of its
//! dependencies again.

#[allow(dead_code, unreachable_pub)]
#[path = "../../../host/radio/src/uhd"]
mod uhd {
    mod burst;
    mod calls;
    mod errors;
    mod ffi;
    mod streams;
}
