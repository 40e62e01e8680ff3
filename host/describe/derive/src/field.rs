//! Fields of a section, and their attributes.

use proc_macro2::{Group, TokenStream, TokenTree};
use quote::{ToTokens, quote, quote_spanned};
use syn::parse::{ParseStream, Parser};
use syn::punctuated::Punctuated;
use syn::spanned::Spanned;
use syn::{
    Attribute, Error, Expr, Field, GenericArgument, Ident, Lit, LitStr, Meta, PathArguments, Token,
    Type, TypePath, parenthesized,
};

use crate::words::word;

/// Part of a section that a field declares.
pub(crate) enum Part {
    Key(KeyArgs),
    /// Section within this one.
    Section,
    /// Keys of another struct, among those of this section.
    Keys,
    /// Position of the section's header.
    At,
    /// Not in the section: its default.
    Skip,
}

/// Need, limits and selector of a key: the arguments of `#[key(...)]`.
pub(crate) struct KeyArgs {
    /// Variant of `Requirement`: `Required`, `Default` or `Optional`.
    need: Ident,
    /// TOML text of the default or the example.
    text: String,
    /// Fields of `Limits` with their values.
    limits: TokenStream,
    /// Variants of the selector.
    pub(crate) select: Vec<Ident>,
}

pub(crate) struct Declared {
    /// Field without the attributes of this macro.
    pub(crate) field: Field,
    pub(crate) name: Ident,
    pub(crate) part: Part,
    /// Variants of the selector for which the field applies; empty for all.
    pub(crate) when: Vec<Ident>,
    doc: String,
}

impl Declared {
    pub(crate) fn new(mut field: Field) -> Result<Self, Error> {
        let name = field.ident.clone();
        let name = name.ok_or_else(|| Error::new_spanned(&field, "expected a named field"))?;
        let doc = doc(&field.attrs);
        let mut when = Vec::new();
        let mut part = None;
        let mut kept = Vec::new();
        for attribute in std::mem::take(&mut field.attrs) {
            let of = |name: &str| attribute.path().is_ident(name);
            let new = if of("key") {
                let (key, applies) = attribute.parse_args_with(key)?;
                when = applies;
                Part::Key(key)
            } else if of("section") || of("keys") {
                when = match &attribute.meta {
                    Meta::Path(_) => Vec::new(),
                    _ => attribute.parse_args_with(only_when)?,
                };
                match of("keys") {
                    true => Part::Keys,
                    false => Part::Section,
                }
            } else if of("at") {
                Part::At
            } else if of("skip") {
                Part::Skip
            } else {
                kept.push(attribute);
                continue;
            };
            if part.replace(new).is_some() {
                return Err(Error::new_spanned(
                    &attribute,
                    "expected one of key, section, keys, at, skip",
                ));
            }
        }
        field.attrs = kept;
        let part = part.ok_or_else(|| {
            Error::new_spanned(
                &field,
                "expected #[key(...)], #[section], #[keys], #[at] or #[skip]",
            )
        })?;
        Ok(Self {
            field,
            name,
            part,
            when,
            doc,
        })
    }

    /// Whether the field belongs to variants of the selector instead of the struct: an optional key is a field of the struct, where it is
    /// `None` if it does not apply.
    pub(crate) fn is_of_variants(&self) -> bool {
        let optional = matches!(&self.part, Part::Key(key) if key.need == "Optional");
        !self.when.is_empty() && !optional
    }

    /// Statement that adds the field's keys to `keys`.
    pub(crate) fn keys(&self) -> TokenStream {
        let (name, ty, doc) = (self.name.to_string(), &self.field.ty, &self.doc);
        let when = words(&self.when);
        match &self.part {
            Part::Key(key) => {
                let (need, text, limits) = (&key.need, &key.text, &key.limits);
                let check = (key.need == "Optional").then(|| {
                    let message = format!("key `{name}` may be absent: expected an Option");
                    quote_spanned!(ty.span()=> const { assert!(<#ty as declare::KeyType>::MAY_BE_ABSENT, #message) };)
                });
                let chosen = words(&key.select);
                let kind = match key.select.is_empty() {
                    true => {
                        quote!(<#ty as declare::KeyType>::kind(&limits))
                    }
                    false => quote!(schema::ValueType::Choice(#chosen)),
                };
                quote! {{
                    let (name, dimension) = declare::split(#name);
                    #check
                    let limits = declare::Limits { dimension, #limits ..declare::Limits::NONE };
                    let kind = #kind;
                    let need = schema::Requirement::#need(#text);
                    keys.push(schema::Key::new(name, kind, need, #doc).when(#when));
                }}
            }
            Part::Keys => {
                quote!(keys.extend(declare::applicable(<#ty as Declared>::keys(), #when));)
            }
            Part::Section | Part::At | Part::Skip => TokenStream::new(),
        }
    }

    /// Statement that adds the sections within to `sections`.
    pub(crate) fn sections(&self) -> TokenStream {
        let (name, ty) = (self.name.to_string(), &self.field.ty);
        match &self.part {
            Part::Section => {
                let (presence, inner) = match wrapper(ty) {
                    Some(("Option", inner)) => (quote!(Optional), inner),
                    Some(("Vec", inner)) => (quote!(Many), inner),
                    _ => (quote!(Always), ty),
                };
                let when = words(&self.when);
                let doc = match self.doc.is_empty() {
                    true => quote!(<#inner as Declared>::DOC),
                    false => {
                        let doc = &self.doc;
                        quote!(#doc)
                    }
                };
                quote! {
                    let presence = schema::Presence::#presence;
                    declare::within::<#inner>((path, #name, presence, #when, #doc), sections);
                }
            }
            Part::Keys => quote!(<#ty as Declared>::sections(path, sections);),
            Part::Key(_) | Part::At | Part::Skip => TokenStream::new(),
        }
    }

    /// Expression that reads the field from `values`; not of a selector.
    pub(crate) fn read(&self) -> TokenStream {
        let (name, ty) = (self.name.to_string(), &self.field.ty);
        match &self.part {
            Part::Key(_) => quote!(values.key(#name)),
            Part::Keys => quote!(Declared::read(values)),
            Part::At => quote!(values.at.clone()),
            Part::Skip => quote!(Default::default()),
            Part::Section => match wrapper(ty) {
                Some(("Option", _)) => {
                    quote!(values.sections(#name).first().map(Declared::read))
                }
                Some(("Vec", _)) => {
                    quote!(values.sections(#name).iter().map(Declared::read).collect())
                }
                _ => quote!(Declared::read(values.section(#name))),
            },
        }
    }
}

/// Type argument of `Option`, `Vec` or `Located`.
pub(crate) fn wrapper(ty: &Type) -> Option<(&'static str, &Type)> {
    let Type::Path(TypePath { path, .. }) = ty else {
        return None;
    };
    let last = path.segments.last()?;
    let mut known = ["Option", "Vec", "Located"].into_iter();
    let name = known.find(|name| last.ident == name)?;
    let PathArguments::AngleBracketed(arguments) = &last.arguments else {
        return None;
    };
    match arguments.args.first()? {
        GenericArgument::Type(inner) => Some((name, inner)),
        _ => None,
    }
}

/// Text of the doc comments.
pub(crate) fn doc(attributes: &[Attribute]) -> String {
    let lines = attributes.iter().filter_map(|attribute| {
        let Meta::NameValue(pair) = &attribute.meta else {
            return None;
        };
        match &pair.value {
            Expr::Lit(literal) if pair.path.is_ident("doc") => match &literal.lit {
                Lit::Str(line) => Some(line.value().trim().to_owned()),
                _ => None,
            },
            _ => None,
        }
    });
    lines.collect::<Vec<_>>().join(" ")
}

/// Slice of the words of variants.
pub(crate) fn words(variants: &[Ident]) -> TokenStream {
    let words = variants.iter().map(word);
    quote!(&[#(#words),*])
}

fn idents(input: ParseStream) -> Result<Vec<Ident>, Error> {
    let inside;
    parenthesized!(inside in input);
    let all = Punctuated::<Ident, Token![,]>::parse_terminated(&inside)?;
    Ok(all.into_iter().collect())
}

/// Variants of the selector in `when(A, B)`.
fn only_when(input: ParseStream) -> Result<Vec<Ident>, Error> {
    let name: Ident = input.parse()?;
    match name == "when" {
        true => idents(input),
        false => Err(Error::new(name.span(), "expected when(...)")),
    }
}

/// Tokens up to a comma.
fn up_to_comma(input: ParseStream) -> Result<TokenStream, Error> {
    let mut tokens = TokenStream::new();
    while !input.is_empty() && !input.peek(Token![,]) {
        input.parse::<TokenTree>()?.to_tokens(&mut tokens);
    }
    Ok(tokens)
}

/// Arguments of `#[key(...)]`, and the variants of `when`.
fn key(input: ParseStream) -> Result<(KeyArgs, Vec<Ident>), Error> {
    let mut need = None;
    let mut limits = TokenStream::new();
    let (mut select, mut when) = (Vec::new(), Vec::new());
    let start = input.span();
    while !input.is_empty() {
        let name: Ident = input.parse()?;
        match &*name.to_string() {
            known @ ("required" | "default" | "example") => {
                input.parse::<Token![=]>()?;
                let text = up_to_comma(input)?.to_string();
                let of = match known {
                    "required" => "Required",
                    "default" => "Default",
                    _ => "Optional",
                };
                need = Some((Ident::new(of, name.span()), text));
            }
            "positive" => limits.extend(quote!(bounds: schema::Bounds::Positive,)),
            "not_negative" => limits.extend(quote!(bounds: schema::Bounds::NotNegative,)),
            "within" => {
                let bounds: Group = input.parse()?;
                limits.extend(quote!(bounds: schema::Bounds::Within #bounds,));
            }
            "whole" => {
                let bounds: Group = input.parse()?;
                limits.extend(quote!(whole: #bounds,));
            }
            "words" => {
                let inside;
                parenthesized!(inside in input);
                let words = Punctuated::<LitStr, Token![,]>::parse_terminated(&inside)?;
                limits.extend(quote!(words: &[#words],));
            }
            "rows" => {
                let group: Group = input.parse()?;
                let (columns, least) = Parser::parse2(rows, group.stream())?;
                limits.extend(quote!(rows: (#least, &[#(Dimension::#columns),*]),));
            }
            "select" => select = idents(input)?,
            "when" => when = idents(input)?,
            _ => {
                let expected = "expected required, default, example, positive, not_negative, within, whole, words, rows, select or when";
                return Err(Error::new(name.span(), expected));
            }
        }
        if !input.is_empty() {
            input.parse::<Token![,]>()?;
        }
    }
    let Some((need, text)) = need else {
        return Err(Error::new(
            start,
            "expected required = ..., default = ... or example = ...",
        ));
    };
    let key = KeyArgs {
        need,
        text,
        limits,
        select,
    };
    Ok((key, when))
}

/// `2, Time, Length`: least number of rows, and the dimensions of a row.
fn rows(input: ParseStream) -> Result<(Vec<Ident>, TokenTree), Error> {
    let least: TokenTree = input.parse()?;
    input.parse::<Token![,]>()?;
    let columns = Punctuated::<Ident, Token![,]>::parse_terminated(input)?;
    Ok((columns.into_iter().collect(), least))
}
