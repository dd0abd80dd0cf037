//! `#[derive(Parameters)]`: the table of parameters of a component.

use crate::fields::{doc_text, named_fields, require_no_generics};
use proc_macro2::TokenStream as Tokens;
use quote::{format_ident, quote};
use syn::{
    Attribute, Data, DeriveInput, Error, Expr, Field, Fields, GenericArgument, Ident, LitStr, Path,
    PathArguments, Result, Type,
};

/// Units of parameters by the end of their names; the longest end counts, and so stands first.
const UNITS: [(&str, &str); 32] = [
    ("_m_s2_sqrt_hz", "m/s²/√Hz"),
    ("_m_s3_sqrt_hz", "m/s³/√Hz"),
    ("_rad_s_sqrt_hz", "rad/s/√Hz"),
    ("_rad_s2_sqrt_hz", "rad/s²/√Hz"),
    ("_Pa_sqrt_s", "Pa/√s"),
    ("_m_sqrt_s", "m/√s"),
    ("_m_s2_k", "m/s²/K"),
    ("_rad_s_k", "rad/s/K"),
    ("_deg_s", "°/s"),
    ("_rad_s2", "rad/s²"),
    ("_rad_s", "rad/s"),
    ("_m_s2", "m/s²"),
    ("_N_m", "N·m"),
    ("_m_s", "m/s"),
    ("_s_m", "s/m"),
    ("_1_s3", "1/s³"),
    ("_1_s2", "1/s²"),
    ("_1_s", "1/s"),
    ("_1_m", "1/m"),
    ("_rad", "rad"),
    ("_deg", "°"),
    ("_k", "K"),
    ("_hz", "Hz"),
    ("_ms", "ms"),
    ("_Ah", "A·h"),
    ("_Pa", "Pa"),
    ("_N", "N"),
    ("_T", "T"),
    ("_V", "V"),
    ("_A", "A"),
    ("_m", "m"),
    ("_s", "s"),
];

/// Answer to an unknown key of `#[parameter(…)]`.
const EXPECTED: &str = "expected `rename`, `unit`, `default`, `shown`, `range`, `check`, `table`, `entry`, `example`, \
                        `file` or `initial`";

/// Stand-in for the number of a table in a list.
const NUMBER: &str = "N";

/// A field with its attributes.
struct Declared<'f> {
    field: &'f Field,
    ident: &'f Ident,
    /// Name in the manifest.
    name: String,
    options: Options,
}

/// Content of `#[parameter(…)]`.
#[derive(Default)]
struct Options {
    rename: Option<LitStr>,
    unit: Option<LitStr>,
    default: Option<Expr>,
    shown: Option<LitStr>,
    range: Option<Expr>,
    check: Option<Expr>,
    table: Option<Path>,
    entry: Option<LitStr>,
    example: Option<LitStr>,
    file: Option<Expr>,
    initial: bool,
}

pub(crate) fn expand(input: &DeriveInput) -> Result<Tokens> {
    require_no_generics(input, "parameters are read from a manifest: they cannot be generic")?;
    let fields = fields(input)?;
    let name = &input.ident;
    let declarations = fields.iter().map(Declared::declaration);
    let checks: Vec<_> = fields.iter().filter_map(Declared::validation).collect();
    let checks = (!checks.is_empty()).then(|| {
        quote! {
            fn out_of_range(&self) -> ::std::vec::Vec<__component::ParameterError> {
                let mut errors = ::std::vec::Vec::new();
                #(#checks)*
                errors
            }
        }
    });
    let deserialize = deserialize(name, &fields);
    let default = has_default(input)?.then(|| default(name, &fields)).transpose()?;
    Ok(quote! {
        #[automatically_derived]
        impl __component::Parameters for #name {
            const DECLARED: &'static [__component::parameters::Parameter] = &[#(#declarations),*];

            #checks
        }
        #deserialize
        #default
    })
}

/// The fields; a struct without fields takes no parameters.
fn fields(input: &DeriveInput) -> Result<Vec<Declared<'_>>> {
    if let Data::Struct(data) = &input.data
        && matches!(&data.fields, Fields::Named(fields) if fields.named.is_empty())
    {
        return Ok(Vec::new());
    }
    named_fields(input)?.iter().map(Declared::of).collect()
}

/// True if the struct has `#[parameters(default)]`.
fn has_default(input: &DeriveInput) -> Result<bool> {
    let mut has_default = false;
    for attribute in input.attrs.iter().filter(|attribute| attribute.path().is_ident("parameters")) {
        attribute.parse_nested_meta(|meta| {
            has_default = meta.path.is_ident("default");
            if has_default { Ok(()) } else { Err(meta.error("expected `default`")) }
        })?;
    }
    Ok(has_default)
}

/// Reads a twin of the struct by serde, which has the functions of the defaults.
fn deserialize(name: &Ident, fields: &[Declared<'_>]) -> Tokens {
    let idents: Vec<_> = fields.iter().map(|declared| declared.ident).collect();
    let types: Vec<_> = fields.iter().map(|declared| &declared.field.ty).collect();
    let functions = fields.iter().filter_map(|declared| {
        let (function, ty) = (declared.default_function(), &declared.field.ty);
        let default = declared.options.default.as_ref()?;
        Some(quote!(fn #function() -> #ty { #default }))
    });
    let attributes = fields.iter().map(|declared| {
        let rename = &declared.name;
        let function = declared.default_function().to_string();
        let default = declared.options.default.as_ref().map(|_| quote!(default = #function,));
        quote!(#[serde(#default rename = #rename)])
    });
    let text = name.to_string();
    quote! {
        #[allow(non_snake_case, clippy::all, clippy::pedantic, reason = "a twin of the struct as it was written")]
        const _: () = {
            #(#functions)*

            #[derive(__component::__private::serde::Deserialize)]
            #[serde(crate = "__component::__private::serde", rename = #text, deny_unknown_fields)]
            struct Twin {
                #(#attributes #idents: #types,)*
            }

            #[automatically_derived]
            impl<'de> __component::__private::serde::Deserialize<'de> for #name {
                fn deserialize<D: __component::__private::serde::Deserializer<'de>>(
                    deserializer: D,
                ) -> ::core::result::Result<Self, D::Error> {
                    let Twin { #(#idents),* } = __component::__private::serde::Deserialize::deserialize(deserializer)?;
                    ::core::result::Result::Ok(Self { #(#idents),* })
                }
            }
        };
    }
}

/// `Default` of a struct whose fields all have one.
fn default(name: &Ident, fields: &[Declared<'_>]) -> Result<Tokens> {
    let values = fields.iter().map(|Declared { field, ident, options, .. }| match &options.default {
        Some(value) => Ok(quote!(#ident: #value)),
        None if is_option(&field.ty) => Ok(quote!(#ident: ::core::option::Option::None)),
        None => Err(Error::new_spanned(field, "state a default: #[parameter(default = 1.0)]")),
    });
    let values = values.collect::<Result<Vec<_>>>()?;
    Ok(quote! {
        #[automatically_derived]
        impl ::core::default::Default for #name {
            fn default() -> Self {
                Self { #(#values),* }
            }
        }
    })
}

impl<'f> Declared<'f> {
    fn of(field: &'f Field) -> Result<Self> {
        let ident = field.ident.as_ref().ok_or_else(|| Error::new_spanned(field, "unnamed field"))?;
        let options = Options::of(&field.attrs)?;
        let name = options.rename.as_ref().map_or_else(|| ident.to_string(), LitStr::value);
        Ok(Self { field, ident, name, options })
    }

    fn default_function(&self) -> Ident {
        format_ident!("default_{}", self.ident)
    }

    fn unit(&self) -> String {
        if let Some(unit) = &self.options.unit {
            return unit.value();
        }
        let of_name = UNITS.iter().find(|(end, _)| self.name.ends_with(end)).map(|(_, unit)| *unit);
        of_name.unwrap_or(if is_number(&self.field.ty) { "1" } else { "" }).to_owned()
    }

    fn declaration(&self) -> Tokens {
        let Self { field, name, options, .. } = self;
        let (doc, unit) = (doc_text(&field.attrs), self.unit());
        let default = match (&options.shown, &options.default) {
            (Some(shown), _) => quote!(__component::parameters::DefaultValue::Text(#shown)),
            (None, Some(value)) => {
                let ty = &field.ty;
                quote!(__component::parameters::DefaultValue::Value(|| {
                    let value: #ty = #value;
                    ::std::format!("{value:?}")
                }))
            }
            (None, None) if is_option(&field.ty) => {
                quote!(__component::parameters::DefaultValue::Text("none"))
            }
            (None, None) => quote!(__component::parameters::DefaultValue::Required),
        };
        let range = match (&options.range, &options.check) {
            (Some(range), _) => quote!(|| ::std::string::String::from(#range)),
            (None, Some(check)) => quote!(|| __component::parameters::range_of(&#check)),
            (None, None) => quote!(::std::string::String::new),
        };
        let table = options
            .table
            .as_ref()
            .map_or_else(|| quote!(&[]), |table| quote!(<#table as __component::Parameters>::DECLARED));
        let [entry, example] = [&options.entry, &options.example]
            .map(|text| text.as_ref().map(LitStr::value).unwrap_or_default());
        let file = match &options.file {
            Some(kind) => quote!(::core::option::Option::Some(#kind)),
            None => quote!(::core::option::Option::None),
        };
        let is_initial = options.initial;
        quote! {
            __component::parameters::Parameter {
                name: #name,
                doc: #doc,
                unit: #unit,
                default: #default,
                range: #range,
                table: #table,
                entry: #entry,
                example: #example,
                file: #file,
                is_initial: #is_initial,
            }
        }
    }

    /// Checks of its numbers, or of the tables in it.
    fn validation(&self) -> Option<Tokens> {
        let Self { ident, name, options, .. } = self;
        if let Some(check) = &options.check {
            return Some(quote! {
                errors.extend(__component::parameters::Numbers::all(&self.#ident, &|number| (#check)(#name, number)).err());
            });
        }
        options.table.as_ref()?;
        let validated = |table: Tokens, key: Tokens| quote!(errors.extend(__component::Parameters::out_of_range(#table).into_iter().map(|error| error.within(#key))););
        Some(match options.entry.as_ref().map(LitStr::value).as_deref() {
            None => validated(quote!(&self.#ident), quote!(#name)),
            Some(NUMBER) => {
                let each = validated(quote!(table), quote!(&::std::format!("{}.{number}", #name)));
                quote!(for (number, table) in self.#ident.iter().enumerate() { #each })
            }
            Some(_) => {
                let each = validated(quote!(table), quote!(&::std::format!("{}.{entry}", #name)));
                quote!(for (entry, table) in &self.#ident { #each })
            }
        })
    }
}

impl Options {
    fn of(attributes: &[Attribute]) -> Result<Self> {
        let mut options = Self::default();
        for attribute in attributes.iter().filter(|attribute| attribute.path().is_ident("parameter")) {
            attribute.parse_nested_meta(|meta| {
                let Options {
                    rename,
                    unit,
                    default,
                    shown,
                    range,
                    check,
                    table,
                    entry,
                    example,
                    file,
                    initial,
                } = &mut options;
                let texts = [
                    ("rename", rename),
                    ("unit", unit),
                    ("shown", shown),
                    ("entry", entry),
                    ("example", example),
                ];
                let is_named = |key: &str| meta.path.is_ident(key);
                if let Some((_, text)) = texts.into_iter().find(|(key, _)| is_named(key)) {
                    *text = Some(meta.value()?.parse()?);
                } else if is_named("default") {
                    *default = Some(meta.value()?.parse()?);
                } else if is_named("range") {
                    *range = Some(meta.value()?.parse()?);
                } else if is_named("check") {
                    *check = Some(meta.value()?.parse()?);
                } else if is_named("table") {
                    *table = Some(meta.value()?.parse()?);
                } else if is_named("file") {
                    *file = Some(meta.value()?.parse()?);
                } else if is_named("initial") {
                    *initial = true;
                } else {
                    return Err(meta.error(EXPECTED));
                }
                Ok(())
            })?;
        }
        Ok(options)
    }
}

/// True if `ty` is a number, an array of numbers, or an `Option` of either.
fn is_number(ty: &Type) -> bool {
    match ty {
        Type::Array(array) => is_number(&array.elem),
        Type::Path(path) => path.path.segments.last().is_some_and(|last| match &last.arguments {
            PathArguments::AngleBracketed(inner) if last.ident == "Option" => {
                matches!(inner.args.first(), Some(GenericArgument::Type(inner)) if is_number(inner))
            }
            _ => ["f64", "u32", "u64", "usize"].iter().any(|number| last.ident == number),
        }),
        _ => false,
    }
}

/// True if `ty` is an `Option`.
fn is_option(ty: &Type) -> bool {
    let Type::Path(path) = ty else { return false };
    path.path.segments.last().is_some_and(|segment| segment.ident == "Option")
}
