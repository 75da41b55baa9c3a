//! Schemas of our own messages: Protocol Buffers whose description travels in every file.

use prost_types::field_descriptor_proto::{Label, Type};
use prost_types::{DescriptorProto, FieldDescriptorProto, OneofDescriptorProto};

pub(super) const PACKAGE: &str = "skillet";

/// Writes a message once: as a struct, as its encoding, and as what a reader needs to decode it; the file
/// that uses it has a `schema` of all its messages, by name. Numbers of fields are part of the format: they are never used again for another field.
macro_rules! recorded {
    (
        $(#[$meta:meta])*
        pub struct $name:ident {
            $( $(#[$field_meta:meta])* $tag:literal [$($kind:tt)+] $field:ident : $type:ty, )*
        }
    ) => {
        $(#[$meta])*
        #[derive(Clone, PartialEq, prost::Message)]
        pub struct $name {
            $( $(#[$field_meta])* #[prost($($kind)+, tag = $tag)] pub $field: $type, )*
        }

        impl $name {
            pub(super) fn descriptor() -> prost_types::DescriptorProto {
                super::schema::message(stringify!($name), &[$(
                    (stringify!($field), $tag, stringify!($($kind)+), stringify!($type)),
                )*])
            }
        }

        impl foxglove::Encode for $name {
            type Error = prost::EncodeError;

            fn get_schema() -> Option<foxglove::Schema> {
                Some(schema(stringify!($name)))
            }

            fn get_message_encoding() -> String {
                "protobuf".into()
            }

            fn encode(
                &self,
                buffer: &mut impl prost::bytes::BufMut,
            ) -> Result<(), prost::EncodeError> {
                prost::Message::encode(self, buffer)
            }

            fn encoded_len(&self) -> Option<usize> {
                Some(prost::Message::encoded_len(self))
            }
        }
    };
}
pub(super) use recorded;

/// One message; each field as its name, number, kind as prost writes it, and Rust type.
pub(super) fn message(name: &str, fields: &[(&str, &str, &str, &str)]) -> DescriptorProto {
    let mut descriptor = DescriptorProto { name: Some(name.into()), ..Default::default() };
    for (field, tag, kind, rust_type) in fields {
        let (kind, label) = kind.split_once(',').map_or((*kind, ""), |(k, l)| (k, l.trim()));
        let is_optional = label == "optional";
        let oneof = is_optional.then_some(descriptor.oneof_decl.len() as i32);
        if is_optional {
            // How proto3 tells "absent" from zero.
            let name = Some(format!("_{field}"));
            descriptor.oneof_decl.push(OneofDescriptorProto { name, ..Default::default() });
        }
        let inner = rust_type.trim_start_matches("Vec<").trim_end_matches('>');
        descriptor.field.push(FieldDescriptorProto {
            name: Some((*field).into()),
            number: tag.parse().ok(),
            label: Some(if label == "repeated" { Label::Repeated } else { Label::Optional } as i32),
            r#type: Some(type_of(kind.trim()) as i32),
            type_name: (kind.trim() == "message").then(|| format!(".{PACKAGE}.{inner}")),
            proto3_optional: is_optional.then_some(true),
            oneof_index: oneof,
            ..FieldDescriptorProto::default()
        });
    }
    descriptor
}

fn type_of(kind: &str) -> Type {
    match kind {
        "uint32" => Type::Uint32,
        "uint64" => Type::Uint64,
        "float" => Type::Float,
        "double" => Type::Double,
        "bool" => Type::Bool,
        "string" => Type::String,
        "message" => Type::Message,
        other => unreachable!("no message has a field of kind {other}"),
    }
}
