//! Attribute macro of `subaperture-describe`: [`macro@section`], and [`macro@Choice`] for the words of a key.
//!
//! Part of [Subaperture](https://docs.rs/subaperture), radar image formation. The declaration is documented in
//! `subaperture_describe::declare`.
#![forbid(unsafe_code)]

mod field;
mod section;
mod words;

use proc_macro::TokenStream;
use syn::{DeriveInput, Error, parse_macro_input};

/// Declare a section of a description as a struct: `subaperture_describe::declare`.
#[proc_macro_attribute]
pub fn section(_: TokenStream, item: TokenStream) -> TokenStream {
    let input = parse_macro_input!(item as DeriveInput);
    let expanded = section::expand(input);
    expanded.unwrap_or_else(Error::into_compile_error).into()
}

/// Make an enum without fields the type of a key: one of the variants' names in kebab case. A variant with `#[skip]` has no name in the text.
#[proc_macro_derive(Choice, attributes(skip))]
pub fn choice(item: TokenStream) -> TokenStream {
    let input = parse_macro_input!(item as DeriveInput);
    let expanded = words::expand(&input);
    expanded.unwrap_or_else(Error::into_compile_error).into()
}
