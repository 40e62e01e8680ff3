//! Expansion of `#[section]`: the struct, the enum of its selector, and both read from the values of a section.

use proc_macro2::TokenStream;
use quote::{format_ident, quote};
use syn::punctuated::Punctuated;
use syn::{Attribute, Data, DeriveInput, Error, Field, Fields, Ident, Type};

use crate::field::{Declared, Part, doc, wrapper};
use crate::words::word;

/// Selector of a section, and the enum made for it.
struct Selector<'d> {
    field: &'d Declared,
    /// Name of the enum.
    name: &'d Ident,
    variants: &'d [Ident],
}

impl<'d> Selector<'d> {
    fn of(fields: &'d [Declared]) -> Option<Self> {
        let mut selectors = fields.iter().filter_map(|field| match &field.part {
            Part::Key(key) if !key.select.is_empty() => Some((field, key)),
            _ => None,
        });
        let (field, key) = selectors.next()?;
        let ty = &field.field.ty;
        let named = wrapper(ty).map_or(ty, |(_, inner)| inner);
        let Type::Path(named) = named else {
            return None;
        };
        Some(Self {
            field,
            name: named.path.get_ident()?,
            variants: &key.select,
        })
    }

    /// Struct of a variant's keys.
    fn keys_of(&self, variant: &Ident) -> Ident {
        format_ident!("{}{variant}", self.name)
    }

    /// Fields of a variant.
    fn fields_of(&self, fields: &'d [Declared], variant: &Ident) -> Vec<&'d Declared> {
        let of = |field: &&Declared| field.is_of_variants() && field.when.contains(variant);
        fields.iter().filter(of).collect()
    }

    /// The enum: a variant for every word, with the keys that apply to it.
    fn declaration(&self, fields: &[Declared], input: &DeriveInput) -> TokenStream {
        let derives = derives(&input.attrs);
        let (name, vis) = (self.name, &input.vis);
        let about = format!("Values of `{}`, with the keys of each.", self.field.name);
        let mut structs = TokenStream::new();
        let mut variants = TokenStream::new();
        for variant in self.variants {
            let about = format!("Keys of `{}`.", word(variant));
            let own = self.fields_of(fields, variant);
            let own: Vec<&Field> = own.into_iter().map(|field| &field.field).collect();
            if own.is_empty() {
                variants.extend(quote!(#[doc = #about] #variant,));
                continue;
            }
            let keys = self.keys_of(variant);
            variants.extend(quote!(#[doc = #about] #variant(#keys),));
            structs.extend(quote!(#(#derives)* #[doc = #about] #vis struct #keys { #(#own),* }));
        }
        quote! {
            #(#derives)*
            #[doc = #about]
            #vis enum #name { #variants }
            #structs
        }
    }

    /// Expression that reads the selector's field.
    fn read(&self, fields: &[Declared]) -> TokenStream {
        let (key, name) = (self.field.name.to_string(), self.name);
        let (last, others) = self.variants.split_last().expect("a selector has variants");
        let make = |variant: &Ident| {
            let own = self.fields_of(fields, variant);
            let names = own.iter().map(|field| &field.name);
            let reads = own.iter().map(|field| field.read());
            let keys = self.keys_of(variant);
            match own.is_empty() {
                true => quote!(#name::#variant),
                false => quote!(#name::#variant(#keys { #(#names: #reads),* })),
            }
        };
        let others = others.iter().map(|variant| {
            let (word, made) = (word(variant), make(variant));
            quote!(#word => #made)
        });
        let last = make(last);
        let read = quote!(match &*values.key::<String>(#key) { #(#others,)* _ => #last });
        match wrapper(&self.field.field.ty) {
            Some(_) => quote!(declare::Located::new(#read, values.at(#key))),
            None => read,
        }
    }
}

fn derives(attributes: &[Attribute]) -> Vec<&Attribute> {
    let derive = |attribute: &&Attribute| attribute.path().is_ident("derive");
    attributes.iter().filter(derive).collect()
}

pub(crate) fn expand(mut input: DeriveInput) -> Result<TokenStream, Error> {
    let Data::Struct(data) = &mut input.data else {
        return Err(Error::new_spanned(&input.ident, "expected a struct"));
    };
    let Fields::Named(named) = &mut data.fields else {
        return Err(Error::new_spanned(&input.ident, "expected named fields"));
    };
    let fields = std::mem::take(&mut named.named).into_iter();
    let fields: Vec<Declared> = fields.map(Declared::new).collect::<Result<_, _>>()?;
    let selector = Selector::of(&fields);
    for field in &fields {
        let variants = selector.as_ref().map_or(&[][..], |s| s.variants);
        if let Some(unknown) = field.when.iter().find(|v| !variants.contains(v)) {
            return Err(Error::new_spanned(
                unknown,
                "expected a variant of the section's selector",
            ));
        }
    }
    let own: Vec<&Declared> = fields.iter().filter(|f| !f.is_of_variants()).collect();
    named.named = own
        .iter()
        .map(|field| field.field.clone())
        .collect::<Punctuated<_, _>>();

    let reads = own.iter().map(|field| match &selector {
        Some(selector) if selector.field.name == field.name => selector.read(&fields),
        _ => field.read(),
    });
    let names = own.iter().map(|field| &field.name);
    let keys = fields.iter().map(Declared::keys);
    let sections = fields.iter().map(Declared::sections);
    let groups = fields
        .iter()
        .filter(|f| matches!(f.part, Part::Keys) && f.when.is_empty());
    let groups = groups.map(|field| &field.field.ty);
    let selected_by = match &selector {
        Some(selector) => {
            let name = selector.field.name.to_string();
            quote!(#name)
        }
        None => quote!(declare::first(&[#(<#groups as Declared>::SELECTOR),*])),
    };
    let declaration = selector.as_ref().map(|s| s.declaration(&fields, &input));
    let (name, about) = (&input.ident, doc(&input.attrs));
    Ok(quote! {
        #input

        #declaration

        const _: () = {
            use ::subaperture_describe::declare::{self, Declared};
            use ::subaperture_describe::values::Values;
            use ::subaperture_describe::{Dimension, schema};

            impl Declared for #name {
                const DOC: &'static str = #about;
                const SELECTOR: &'static str = #selected_by;

                fn keys() -> Vec<schema::Key> {
                    let mut keys = Vec::new();
                    #(#keys)*
                    keys
                }

                fn sections(path: &str, sections: &mut Vec<schema::Section>) {
                    #(#sections)*
                }

                fn read(values: &Values) -> Self {
                    Self { #(#names: #reads),* }
                }
            }
        };
    })
}
