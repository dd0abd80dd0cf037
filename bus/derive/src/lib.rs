//! `#[derive(Message)]`: a fixed-layout message with its schema, checked when it is compiled; `#[derive(InputPorts)]` and
//! `#[derive(OutputPorts)]`, the ports of a component; `#[derive(Parameters)]`, its parameters.
//!
//! The derive refuses a struct that is not `repr(C)`, has implicit padding, or has a field name that ROS 2
//! tools reject. A floating-point field without its unit is refused too.
//!
//! The generated code names the crate `component`. The `Cargo.toml` of the deriving crate has a dependency on it, or on a package
//! that exports it: `hummingbus-component`, `hummingbus-bus` or `hummingbus`.

mod fields;
mod parameters;
mod root;

use fields::{doc_text, named_fields, require_no_generics};
use proc_macro::TokenStream;
use proc_macro2::TokenStream as Tokens;
use quote::quote;
use syn::{Attribute, DeriveInput, Error, Field, LitStr, Result, Type, parse_macro_input};

/// Derives `component::Message` for a `repr(C)` struct without padding.
///
/// On the struct: `#[message(type_name = "package/msg/Name")]`, and `definition = "…"` where the ROS 2
/// definition is nested differently from the Rust struct; `role = "state"` for the state of a component that no topic
/// carries, in which sequences may stand anywhere. On fields: `#[field(unit = "m", frame =
/// "world")]`; an empty unit means "that of the field that holds this message".
#[proc_macro_derive(Message, attributes(message, field))]
pub fn derive_message(input: TokenStream) -> TokenStream {
    expanded(&parse_macro_input!(input), expand)
}

fn expanded(input: &DeriveInput, expand: fn(&DeriveInput) -> Result<Tokens>) -> TokenStream {
    let expanded = root::path().and_then(|root| {
        let items = expand(input)?;
        Ok(quote! {
            const _: () = {
                use #root as __component;

                #items
            };
        })
    });
    expanded.unwrap_or_else(Error::into_compile_error).into()
}

fn expand(input: &DeriveInput) -> Result<Tokens> {
    require_repr_c(input)?;
    require_no_generics(input, "a message has one layout: it cannot be generic")?;
    let MessageOptions { type_name, definition, is_state } = message_options(input)?;
    let fields = named_fields(input)?;
    let name = &input.ident;
    let types: Vec<&Type> = fields.iter().map(|field| &field.ty).collect();
    let schemas = fields.iter().map(|field| field_schema(input, field)).collect::<Result<Vec<_>>>()?;
    let doc = doc_text(&input.attrs);
    let definition = match definition {
        Some(text) => quote!(::core::option::Option::Some(#text)),
        None => quote!(::core::option::Option::None),
    };
    Ok(quote! {
        const _: () = {
            assert!(
                ::core::mem::size_of::<#name>() == 0 #(+ ::core::mem::size_of::<#types>())*,
                concat!("message ", stringify!(#name), " has implicit padding: reorder its fields or add `pad0`"),
            );
            assert!(::core::mem::align_of::<#name>() <= 8, "a message's alignment is at most 8 bytes");
            assert!(
                #is_state || __component::schema::sequences_are_last(<#name as __component::Message>::SCHEMA.fields),
                concat!(
                    "message ", stringify!(#name), " has a `Bounded` that is not its last field, stands in a nested ",
                    "message, or states no unit: move it to the end, or add #[field(unit = \"m/s\")]",
                ),
            );
        };
        // SAFETY: every field is `Pod` (required by `FieldType`), the struct is `repr(C)` and has no
        // padding (asserted above), so every bit pattern is a value and every value is plain bytes.
        unsafe impl __component::__private::bytemuck::Zeroable for #name {}
        // SAFETY: as above.
        unsafe impl __component::__private::bytemuck::Pod for #name {}
        impl __component::schema::FieldType for #name {
            const KIND: __component::schema::Kind = __component::schema::Kind::Message(<#name as __component::Message>::SCHEMA);
        }
        impl __component::Message for #name {
            const SCHEMA: &'static __component::schema::Schema = &__component::schema::Schema {
                type_name: #type_name,
                doc: #doc,
                size: ::core::mem::size_of::<#name>(),
                definition: #definition,
                fields: &[#(#schemas),*],
            };
        }
    })
}

/// Attributes of a message.
struct MessageOptions {
    /// ROS 2 name.
    type_name: LitStr,
    /// ROS 2 definition, where it is stated.
    definition: Option<LitStr>,
    /// True for the state of a component, which no topic carries.
    is_state: bool,
}

fn message_options(input: &DeriveInput) -> Result<MessageOptions> {
    let [type_name, definition, role] =
        options(&input.attrs, "message", ["type_name", "definition", "role"])?;
    let missing = || Error::new_spanned(&input.ident, "add #[message(type_name = \"package/msg/Name\")]");
    let type_name = type_name.ok_or_else(missing)?;
    require_ros_type_name(&type_name)?;
    match role {
        Some(role) if role.value() != "state" => Err(Error::new_spanned(role, "expected \"state\"")),
        role => Ok(MessageOptions { type_name, definition, is_state: role.is_some() }),
    }
}

/// Derives `component::ports::InputPorts` for a struct `Name<'a>` whose fields are `&'a T` and `Option<&'a T>`.
#[proc_macro_derive(InputPorts)]
pub fn derive_input_ports(input: TokenStream) -> TokenStream {
    expanded(&parse_macro_input!(input), expand_inputs)
}

/// Derives `component::ports::OutputPorts` for a struct whose fields are `T` and `Option<T>`.
#[proc_macro_derive(OutputPorts)]
pub fn derive_output_ports(input: TokenStream) -> TokenStream {
    expanded(&parse_macro_input!(input), expand_outputs)
}

/// Derives `component::Parameters` and `serde::Deserialize` for a struct: the content of a `parameters` table of a manifest, which refuses
/// unknown keys. The doc comment of a field is its meaning in the documentation.
///
/// `#[parameter(…)]` on a field takes
/// - `default = EXPRESSION`: the value where the manifest has none; without it a parameter is required, unless it is an `Option`.
/// - `shown = "…"`: the default in words, where the value says less.
/// - `unit = "…"`: the unit, where the end of the name does not say it.
/// - `check = FUNCTION`: a check of each of its numbers, `Fn(&str, f64) -> Result<(), ParameterError>`, as `diagnostics::parameter` has.
/// - `range = EXPRESSION`: the accepted values in words, where the constructor checks them.
/// - `table = TYPE`: the type that declares and checks the keys of the table; with `entry = "NAME"` those of each table in it, or in the list
///   (`"N"`).
/// - `example = "…"`: a value for examples, as TOML.
/// - `file = EXPRESSION`: the kind of the file whose path it is, a `inputs::FileKind`. The launcher reads it of a component's own parameters, not
///   within tables.
/// - `initial`: the parameter counts only at the start. A run from a checkpoint refuses other values. As `file`, it has no effect within
///   tables.
/// - `rename = "…"`: its name in the manifest.
///
/// `#[parameters(default)]` on the struct derives `Default` too.
#[proc_macro_derive(Parameters, attributes(parameter, parameters))]
pub fn derive_parameters(input: TokenStream) -> TokenStream {
    expanded(&parse_macro_input!(input), parameters::expand)
}

fn expand_inputs(input: &DeriveInput) -> Result<Tokens> {
    let lifetime = input.generics.lifetimes().next().filter(|_| input.generics.params.len() == 1);
    let wrong =
        || Error::new_spanned(&input.ident, "inputs are a struct with one lifetime, that of the samples");
    let lifetime = lifetime.ok_or_else(wrong)?;
    let (name, lifetime) = (&input.ident, &lifetime.lifetime);
    let fields = named_fields(input)?;
    let specs =
        fields.iter().map(|field| port_spec(field, &quote!(__component::ports::InputPort<#lifetime>)));
    let names = fields.iter().map(|field| &field.ident);
    let ports = 0..fields.len();
    Ok(quote! {
        impl<#lifetime> __component::ports::InputPorts<#lifetime> for #name<#lifetime> {
            const DECLARED: __component::ports::Inputs = __component::ports::Inputs::Ports(&[#(#specs),*]);

            fn read(samples: __component::ports::InputSamples<#lifetime>) -> Self {
                Self { #(#names: __component::ports::InputPort::read(samples, #ports)),* }
            }
        }
    })
}

fn expand_outputs(input: &DeriveInput) -> Result<Tokens> {
    require_no_generics(input, "outputs are sent by value: they cannot be generic")?;
    let name = &input.ident;
    let fields = named_fields(input)?;
    let specs = fields.iter().map(|field| port_spec(field, &quote!(__component::ports::OutputPort)));
    let names: Vec<_> = fields.iter().map(|field| &field.ident).collect();
    let ports: Vec<usize> = (0..fields.len()).collect();
    Ok(quote! {
        impl __component::ports::OutputPorts for #name {
            const DECLARED: &'static [__component::ports::PortSpec] = &[#(#specs),*];

            fn write(
                &self,
                samples: &mut __component::ports::OutputSamples<'_>,
            ) -> ::core::result::Result<(), __component::BusError> {
                #(__component::ports::OutputPort::write(&self.#names, samples, #ports)?;)*
                ::core::result::Result::Ok(())
            }

            fn read(samples: __component::ports::InputSamples<'_>) -> ::core::option::Option<Self> {
                ::core::option::Option::Some(Self {
                    #(#names: __component::ports::OutputPort::read(samples, #ports)?),*
                })
            }
        }
    })
}

/// Declaration of the port of a field whose type is a `port`.
fn port_spec(field: &Field, port: &Tokens) -> Tokens {
    let Field { ident, ty, attrs, .. } = field;
    let (name, doc) = (ident.as_ref().map(ToString::to_string), doc_text(attrs));
    quote! {
        __component::ports::PortSpec {
            name: #name,
            doc: #doc,
            schema: <#ty as #port>::SCHEMA,
            required: <#ty as #port>::REQUIRED,
        }
    }
}

/// The texts that the attributes `#[attribute(…)]` give for `keys`.
fn options<const N: usize>(
    attributes: &[Attribute],
    attribute: &str,
    keys: [&str; N],
) -> Result<[Option<LitStr>; N]> {
    let mut texts = [const { None }; N];
    for attribute in attributes.iter().filter(|found| found.path().is_ident(attribute)) {
        attribute.parse_nested_meta(|meta| {
            let expected = || meta.error(format_args!("expected `{}`", keys.join("` or `")));
            let key = keys.iter().position(|key| meta.path.is_ident(key)).ok_or_else(expected)?;
            texts[key] = Some(meta.value()?.parse()?);
            Ok(())
        })?;
    }
    Ok(texts)
}

fn require_ros_type_name(type_name: &LitStr) -> Result<()> {
    let text = type_name.value();
    let parts: Vec<&str> = text.split('/').collect();
    match parts.as_slice() {
        [package, "msg", name]
            if is_field_name(package) && name.starts_with(|c: char| c.is_ascii_uppercase()) =>
        {
            Ok(())
        }
        _ => Err(Error::new_spanned(type_name, "a type name has three parts: \"package/msg/Name\"")),
    }
}

fn require_repr_c(input: &DeriveInput) -> Result<()> {
    let mut is_c = false;
    for attribute in input.attrs.iter().filter(|attribute| attribute.path().is_ident("repr")) {
        attribute.parse_nested_meta(|meta| {
            is_c = meta.path.is_ident("C");
            // `packed` would hide padding that CDR has, `align` would add some that it has not.
            if is_c { Ok(()) } else { Err(meta.error("a message is #[repr(C)] and nothing else")) }
        })?;
    }
    if is_c { Ok(()) } else { Err(Error::new_spanned(&input.ident, "a message needs #[repr(C)]")) }
}

fn field_schema(input: &DeriveInput, field: &Field) -> Result<Tokens> {
    let owner = &input.ident;
    let ident = field.ident.as_ref().ok_or_else(|| Error::new_spanned(field, "unnamed field"))?;
    let name = ident.to_string();
    if !is_field_name(&name) {
        return Err(Error::new_spanned(
            ident,
            "a field name matches ^[a-z](_?[a-z0-9]+)*$ (ROS 2 tools refuse others)",
        ));
    }
    let [unit, frame] = options(&field.attrs, "field", ["unit", "frame"])?;
    if unit.is_none() && is_float(&field.ty) {
        return Err(Error::new_spanned(field, "state the unit: #[field(unit = \"m/s\")]"));
    }
    let [unit, frame] = [unit, frame].map(|text| text.map_or(String::new(), |text| text.value()));
    let (ty, doc) = (&field.ty, doc_text(&field.attrs));
    Ok(quote! {
        __component::schema::Field {
            name: #name,
            doc: #doc,
            unit: #unit,
            frame: #frame,
            offset: ::core::mem::offset_of!(#owner, #ident),
            kind: <#ty as __component::schema::FieldType>::KIND,
        }
    })
}

/// True if `ty` is `f32`, `f64`, or an array of either.
fn is_float(ty: &Type) -> bool {
    match ty {
        Type::Array(array) => is_float(&array.elem),
        Type::Path(path) => path.path.is_ident("f64") || path.path.is_ident("f32"),
        _ => false,
    }
}

/// True if `name` matches `^[a-z](_?[a-z0-9]+)*$`, the rule of ROS 2 field names.
fn is_field_name(name: &str) -> bool {
    name.starts_with(|c: char| c.is_ascii_lowercase())
        && name.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_')
        && !name.contains("__")
        && !name.ends_with('_')
}
