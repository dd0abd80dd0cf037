//! Fields and documentation of a struct that derives.

use syn::{Attribute, Data, DataStruct, DeriveInput, Error, Expr, ExprLit, Field, Fields, Lit, Result};

/// Refuses a type with generics; `why` it has none.
pub(crate) fn require_no_generics(input: &DeriveInput, why: &str) -> Result<()> {
    if input.generics.params.is_empty() { Ok(()) } else { Err(Error::new_spanned(&input.generics, why)) }
}

/// The fields of a struct with named ones, at least one.
pub(crate) fn named_fields(
    input: &DeriveInput,
) -> Result<&syn::punctuated::Punctuated<Field, syn::Token![,]>> {
    match &input.data {
        Data::Struct(DataStruct { fields: Fields::Named(fields), .. }) if !fields.named.is_empty() => {
            Ok(&fields.named)
        }
        _ => Err(Error::new_spanned(&input.ident, "expected a struct with named fields")),
    }
}

/// The doc comment of an item as one line.
pub(crate) fn doc_text(attributes: &[Attribute]) -> String {
    let text = |attribute: &Attribute| match &attribute.meta.require_name_value().ok()?.value {
        Expr::Lit(ExprLit { lit: Lit::Str(text), .. }) => Some(text.value().trim().to_owned()),
        _ => None,
    };
    let lines = attributes.iter().filter(|attribute| attribute.path().is_ident("doc")).filter_map(text);
    lines.take_while(|line| !line.is_empty()).collect::<Vec<_>>().join(" ")
}
