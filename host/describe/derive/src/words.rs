//! Words of a key as variants of an enum.

use proc_macro2::TokenStream;
use quote::quote;
use syn::{Attribute, Data, DeriveInput, Error, Fields, Ident};

/// Name in kebab case: `UpDown` is `up-down`.
pub(crate) fn word(variant: &Ident) -> String {
    let mut word = String::new();
    for letter in variant.to_string().chars() {
        if letter.is_uppercase() && !word.is_empty() {
            word.push('-');
        }
        word.extend(letter.to_lowercase());
    }
    word
}

pub(crate) fn expand(input: &DeriveInput) -> Result<TokenStream, Error> {
    let Data::Enum(data) = &input.data else {
        return Err(Error::new_spanned(&input.ident, "expected an enum"));
    };
    let skips = |attribute: &Attribute| attribute.path().is_ident("skip");
    let taken = data
        .variants
        .iter()
        .filter(|variant| !variant.attrs.iter().any(skips));
    if let Some(variant) = taken
        .clone()
        .find(|variant| !matches!(variant.fields, Fields::Unit))
    {
        return Err(Error::new_spanned(
            variant,
            "expected a variant without fields",
        ));
    }
    let name = &input.ident;
    let variants: Vec<&Ident> = taken.map(|variant| &variant.ident).collect();
    let words: Vec<String> = variants.iter().map(|variant| word(variant)).collect();
    Ok(quote! {
        impl ::subaperture_describe::declare::KeyType for #name {
            fn kind(_: &::subaperture_describe::declare::Limits) -> ::subaperture_describe::schema::ValueType {
                ::subaperture_describe::schema::ValueType::Choice(&[#(#words),*])
            }

            fn of(value: &::subaperture_describe::values::Value) -> Option<Self> {
                match value.as_text()? {
                    #(#words => Some(Self::#variants),)*
                    _ => None,
                }
            }
        }
    })
}
